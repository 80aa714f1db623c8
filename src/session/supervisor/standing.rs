//! State between the trials: reasons against the next trial, a STOP of a damped robot, the arming checklist, the release by an
//! observer.

use super::Supervisor;
use crate::recording::record::{ArmingCheckRecord, LogLevel, Record, Stamped};
use crate::telemetry::{Command, Mode};

/// Least time between two logged cautions, ns.
const WARNING_PERIOD_NS: u64 = 10_000_000_000;
/// Period of the arming checklist's records for the console, ns.
const CHECKLIST_PERIOD_NS: u64 = 500_000_000;

impl Supervisor {
    /// Returns the reason that forbids the next trial; none if nothing does.
    pub(super) fn inhibit(&mut self) -> Option<String> {
        let hold = self.control.readiness.read().inhibit.map(|hold| hold.to_string());
        hold.or_else(|| self.checklist.disk_low())
    }

    /// Logs once the reason that forbids the next trial, and the values on which a failsafe will soon act.
    pub(super) fn warn(&mut self, time_ns: u64) {
        let inhibit = self.inhibit();
        if let Some(reason) = &inhibit
            && self.inhibited.is_none()
        {
            self.log(LogLevel::Warning, format!("no further trial can be approved: {reason}"), time_ns);
        }
        self.inhibited = inhibit;
        let due = self.warned_ns.is_none_or(|logged_ns| time_ns >= logged_ns + WARNING_PERIOD_NS);
        if let Some(warning) = self.control.readiness.read().warning.filter(|_| due) {
            self.warned_ns = Some(time_ns);
            self.log(LogLevel::Warning, warning.to_string(), time_ns);
        }
    }

    /// Logs a STOP that changes no mode, because the robot is damped already.
    pub(super) fn report_stop(&mut self, time_ns: u64) {
        let stops = self.control.stop.count();
        if stops > self.stops_reported && matches!(self.mode, Mode::Damped | Mode::Fault) {
            self.stops_reported = stops;
            let message = format!("STOP while {}: the robot stays damped", self.mode.name());
            self.log(LogLevel::Info, message, time_ns);
        }
    }

    /// Returns to OBSERVE after an observer has acknowledged its STOP.
    pub(super) fn release(&mut self) {
        if self.observe && self.mode == Mode::Disarmed && !self.releasing {
            self.releasing = self.command(Command::Release).is_ok();
        }
    }

    /// Publishes the arming checklist while the robot is disarmed: to the console twice a second, to the recorder, too, when a
    /// check changes its state.
    pub(super) fn publish_checklist(&mut self, time_ns: u64) {
        if self.mode != Mode::Disarmed || self.observe {
            return;
        }
        let findings = self.control.readiness.read().findings;
        let list = self.checklist.items(&findings, &self.recorder.get());
        let states = |list: &[ArmingCheckRecord]| list.iter().map(|item| item.state).collect::<Vec<_>>();
        let stamped = Stamped { time_ns, record: Record::ArmingChecks(list.clone()) };
        if states(&list) != states(&self.published_checklist) {
            self.recorder_gone |= !self.sinks.send(stamped);
        } else if time_ns >= self.checklist_ns + CHECKLIST_PERIOD_NS {
            let _ = self.sinks.console.send(stamped);
        } else {
            return;
        }
        self.checklist_ns = time_ns;
        self.published_checklist = list;
    }

    /// Records the checklist with which the robot leaves DISARMED, as it was shown last.
    pub(super) fn record_checklist(&mut self) {
        let list = std::mem::take(&mut self.published_checklist);
        if !list.is_empty() {
            let stamped = Stamped { time_ns: self.checklist_ns, record: Record::ArmingChecks(list) };
            self.recorder_gone |= !self.sinks.send(stamped);
        }
    }
}
