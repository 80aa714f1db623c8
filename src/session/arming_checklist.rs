//! The arming checklist: findings of the control thread, checks of the session, confirmations of the operator.

use crate::control::arming::{self, Sentence};
use crate::control::settings::{ArmingLimits, ControlSettings};
use crate::realtime::scheduling::{DeniedSetting, RealtimeSetting};
use crate::recording::disk::FreeSpace;
use crate::recording::record::ArmingCheckRecord;
use crate::recording::recorder::RecorderStatus;
use crate::telemetry::{ArmingCheck, ArmingCheckSet, ArmingCheckState, ArmingFindings, Mode, TransitionCause};

use super::operator_request::OperatorCheck;

/// Progress of the test of the STOP key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StopTest {
    Open,
    Pressed,
    Passed,
}

/// The arming checks of one session.
#[derive(Debug, Clone)]
pub struct ArmingChecklist {
    limits: ArmingLimits,
    /// Free space that a trial needs, MB.
    trial_mb: u32,
    hardware: bool,
    /// Fingerprint of the configuration.
    configuration: String,
    /// Free space in the folder of the recording; none where nothing is kept.
    space: Option<FreeSpace>,
    /// Checks that the operator has confirmed.
    confirmed: ArmingCheckSet,
    /// Time of the last confirmation of the clear area, ns.
    area_ns: u64,
    /// Restarts of the robot that were taken in.
    reboots: u64,
    stop: StopTest,
    /// Real-time settings that the control thread was granted.
    granted: Vec<RealtimeSetting>,
    /// Those that it was denied.
    denied: Vec<DeniedSetting>,
    /// Reason why the loss of the operator's connection cannot be detected; none if it can.
    unseen_connection: Option<String>,
    /// Way to the robot's low-level mode.
    low_level: &'static str,
}

impl ArmingChecklist {
    /// A list without confirmations. `configuration` is the fingerprint for the operator; `space` is that of the folder of the
    /// recording, none where nothing is kept.
    pub fn new(settings: &ControlSettings, configuration: String, space: Option<FreeSpace>) -> ArmingChecklist {
        ArmingChecklist {
            limits: settings.arming,
            trial_mb: settings.failsafe.disk_free_mb,
            hardware: settings.hardware,
            configuration,
            space,
            confirmed: ArmingCheckSet::EMPTY,
            area_ns: 0,
            reboots: 0,
            stop: StopTest::Open,
            granted: Vec::new(),
            denied: Vec::new(),
            unseen_connection: None,
            low_level: "the robot's low-level mode",
        }
    }

    /// Sets the way to low-level mode that the operator confirms.
    pub fn with_low_level(mut self, way: &'static str) -> ArmingChecklist {
        self.low_level = way;
        self
    }

    /// Records the real-time settings of the control thread.
    pub fn scheduled(&mut self, granted: &[RealtimeSetting], denied: &[DeniedSetting]) {
        (self.granted, self.denied) = (granted.to_vec(), denied.to_vec());
    }

    /// Adds the reason why the loss of the operator's connection cannot be detected; none if it can.
    pub fn with_unseen_connection(mut self, reason: Option<String>) -> ArmingChecklist {
        self.unseen_connection = reason;
        self
    }

    /// Records the operator's confirmation of a check.
    pub fn confirm(&mut self, check: OperatorCheck, time_ns: u64) {
        self.confirmed.insert(check.check());
        if check == OperatorCheck::AreaClear {
            self.area_ns = time_ns;
        }
    }

    /// Withdraws the confirmation of the clear area if it is too old at `time_ns`. Returns the reason if it was withdrawn.
    pub fn expire(&mut self, time_ns: u64) -> Option<String> {
        let age_s = time_ns.saturating_sub(self.area_ns) as f64 * 1e-9;
        let allowed_s = self.limits.area_clear_s;
        if age_s <= allowed_s || !self.confirmed.contains(ArmingCheck::AreaClear) {
            return None;
        }
        self.confirmed.remove(ArmingCheck::AreaClear);
        Some(format!(
            "the confirmation that the area is clear is older than {allowed_s:.0} s: check the area and confirm it again"
        ))
    }

    /// Records a change of mode: confirmations that it invalidates are withdrawn, and a STOP may be the test of the key.
    pub fn mode_changed(&mut self, from: Mode, to: Mode, cause: &TransitionCause) {
        if from.energised() && !to.energised() {
            // A person may go to the robot now.
            self.confirmed.remove(ArmingCheck::AreaClear);
        }
        if !from.commanded() && to.commanded() {
            // Before, restarts and losses of the robot are not watched.
            self.withdraw();
        }
        if let TransitionCause::Fault(fault) = cause
            && fault.voids_confirmations()
        {
            self.withdraw();
        }
        self.stop = match (self.stop, from, to, cause) {
            (StopTest::Open, Mode::Observe | Mode::Disarmed, Mode::Damped, TransitionCause::Stop) => StopTest::Pressed,
            (StopTest::Pressed, Mode::Damped, Mode::Disarmed, _) => StopTest::Passed,
            (StopTest::Pressed, ..) => StopTest::Open,
            (state, ..) => state,
        };
    }

    /// Records the number of restarts of the robot. Returns true if there was one since the last call: the operator's
    /// confirmations are withdrawn then, in every mode.
    pub fn robot_restarted(&mut self, reboots: u64) -> bool {
        let restarted = reboots > self.reboots;
        self.reboots = reboots;
        if restarted {
            self.withdraw();
        }
        restarted
    }

    /// Withdraws low-level mode, which a restart ends, and the clear area, because a person may be at the robot.
    fn withdraw(&mut self) {
        self.confirmed.remove(ArmingCheck::LowLevel);
        self.confirmed.remove(ArmingCheck::AreaClear);
    }

    /// Returns the present state of every check.
    pub fn items(&self, findings: &ArmingFindings, recorder: &RecorderStatus) -> Vec<ArmingCheckRecord> {
        let found = findings.0.iter().map(|finding| {
            let Sentence { found, needed } = arming::sentence(finding, &self.limits);
            self.item(finding.check, finding.state, found, needed)
        });
        let own = [
            self.recorder(recorder),
            self.disk(),
            self.confirmation(
                OperatorCheck::LowLevel,
                String::new(),
                &format!("{}; the operator's confirmation", self.low_level),
            ),
            self.confirmation(
                OperatorCheck::Configuration,
                format!("{}, ", self.configuration),
                "the operator's confirmation of config/",
            ),
            self.confirmation(
                OperatorCheck::AreaClear,
                String::new(),
                "no person within 2 m; the operator's confirmation",
            ),
            self.stop_tested(),
            self.realtime(OperatorCheck::Priority, |setting| matches!(setting, RealtimeSetting::Priority(_))),
            self.realtime(OperatorCheck::LockedMemory, |setting| *setting == RealtimeSetting::LockedMemory),
            self.connection(),
        ];
        found.chain(own).collect()
    }

    /// Returns the reason if the disk is too full for another trial, or it is not known whether it is.
    pub fn disk_low(&self) -> Option<String> {
        let needed = u64::from(self.trial_mb);
        match self.space.as_ref()?.mb() {
            Ok(free) if free >= needed => None,
            Ok(free) => Some(format!(
                "{free} MB free in the recording's folder, a trial needs at least {needed}; free some space"
            )),
            Err(error) => Some(format!("the free space in the recording's folder is not known: {error}")),
        }
    }

    fn recorder(&self, status: &RecorderStatus) -> ArmingCheckRecord {
        let (state, found) = match (status.incomplete(), &self.space) {
            (Some(error), _) => (ArmingCheckState::Failed, error.to_owned()),
            (None, Some(_)) if status.finished => (ArmingCheckState::Failed, "has ended".to_owned()),
            (None, Some(_)) => (ArmingCheckState::Passed, "recording".to_owned()),
            // A simulation may run without a recording, a real robot may not.
            (None, None) if self.hardware => (ArmingCheckState::Failed, "no recording".to_owned()),
            (None, None) => (ArmingCheckState::NotNeeded, "no recording requested".to_owned()),
        };
        self.item(ArmingCheck::Recorder, state, found, "every tick from here on is recorded".to_owned())
    }

    fn disk(&self) -> ArmingCheckRecord {
        let needed = format!("at least {} MB", self.limits.disk_free_mb);
        let (state, found) = match &self.space {
            None => (ArmingCheckState::NotNeeded, "no recording requested".to_owned()),
            Some(space) => match space.mb() {
                Ok(free) if free >= u64::from(self.limits.disk_free_mb) => {
                    (ArmingCheckState::Passed, format!("{free} MB"))
                }
                Ok(free) => (ArmingCheckState::Failed, format!("{free} MB")),
                Err(error) => (ArmingCheckState::Failed, error),
            },
        };
        self.item(ArmingCheck::Disk, state, found, needed)
    }

    fn confirmation(&self, check: OperatorCheck, about: String, needed: &str) -> ArmingCheckRecord {
        let check = check.check();
        let given = self.confirmed.contains(check);
        let state = if given { ArmingCheckState::Passed } else { ArmingCheckState::Waiting };
        let found = format!("{about}{}", if given { "confirmed" } else { "not confirmed" });
        self.item(check, state, found, needed.to_owned())
    }

    /// A real-time setting: granted, or confirmed by an operator who knows that it was denied.
    fn realtime(&self, check: OperatorCheck, is: fn(&RealtimeSetting) -> bool) -> ArmingCheckRecord {
        if let Some(setting) = self.granted.iter().find(|setting| is(setting)) {
            return self.item(check.check(), ArmingCheckState::Passed, setting.to_string(), String::new());
        }
        match self.denied.iter().find(|denied| is(&denied.setting)) {
            Some(denied) => {
                let needed = format!("{} ({}), or the operator's confirmation", denied.remedy, denied.reason);
                self.confirmation(check, "denied, ".to_owned(), &needed)
            }
            None => self.confirmation(
                check,
                "not requested, ".to_owned(),
                "[realtime] of control.toml requests it, or the operator's confirmation",
            ),
        }
    }

    fn connection(&self) -> ArmingCheckRecord {
        let needed = "its loss is detected, or the operator's confirmation";
        match &self.unseen_connection {
            Some(reason) => self.confirmation(OperatorCheck::Connection, format!("{reason}, "), needed),
            None => {
                let found = "its loss is detected".to_owned();
                self.item(ArmingCheck::Connection, ArmingCheckState::Passed, found, needed.to_owned())
            }
        }
    }

    fn stop_tested(&self) -> ArmingCheckRecord {
        let (state, found) = match self.stop {
            StopTest::Open => (ArmingCheckState::Waiting, "not in this session"),
            StopTest::Pressed => (ArmingCheckState::Waiting, "pressed, not acknowledged"),
            StopTest::Passed => (ArmingCheckState::Passed, "pressed and acknowledged"),
        };
        // In DAMPED and FAULT, which damp already, STOP has no effect that could be seen.
        let needed = "press STOP while DISARMED, then acknowledge".to_owned();
        self.item(ArmingCheck::StopTested, state, found.to_owned(), needed)
    }

    fn item(&self, check: ArmingCheck, state: ArmingCheckState, found: String, needed: String) -> ArmingCheckRecord {
        if self.hardware || check.needed_in_simulation() {
            ArmingCheckRecord { check, found, needed, state }
        } else {
            ArmingCheckRecord {
                check,
                found,
                needed: "not needed in simulation".to_owned(),
                state: ArmingCheckState::NotNeeded,
            }
        }
    }
}

/// Returns all failing checks; none if arming is allowed.
pub fn refusals(list: &[ArmingCheckRecord]) -> Option<String> {
    let open: Vec<String> = list
        .iter()
        .filter(|item| !item.state.allows())
        .map(|item| format!("{}: {}, needed: {}", item.check.name(), item.found, item.needed))
        .collect();
    (!open.is_empty()).then(|| open.join("; "))
}
