//! Steps of the automatic rule.

use super::Supervisor;
use super::unattended::Unattended;
use super::unfinished::Asker;
use crate::control::limit_key::limit_key;
use crate::control::settings::ControlSettings;
use crate::recording::record::LogLevel;
use crate::session::objective;
use crate::session::operator_request::{OperatorRequest, StampedRequest};
use crate::telemetry::{Mode, TrialEnd};
use crate::trial::{Approval, ExperimentStage, Verdict};

impl Supervisor {
    /// Returns the session with the given rule of approval.
    pub fn approving(mut self, approval: Approval, simulated: bool) -> Supervisor {
        self.unattended = Unattended { approval, simulated, ..Unattended::default() };
        self
    }

    /// Returns the session that logs the key of a limit that ended a trial under `settings`.
    pub fn naming_limits(mut self, settings: ControlSettings) -> Supervisor {
        self.limits = Some(settings);
        self
    }

    /// Logs the limit that ended a trial, with its key.
    pub(super) fn log_limit(&mut self, trial: u32, end: &TrialEnd, time_ns: u64) {
        if let Some(key) = self.limits.and_then(|settings| limit_key(end, &settings)) {
            let cause = objective::suggest(end).1;
            self.log(LogLevel::Info, format!("trial {trial}: {cause}; the limit is {key}"), time_ns);
        }
    }

    /// Takes the next step, if the rule allows one.
    pub fn act_unattended(&mut self, time_ns: u64) {
        let Unattended { approval, simulated, paused, arming, retry_ns, .. } = self.unattended;
        if approval == Approval::Each || paused || self.observe || self.ended.is_some() || !self.unfinished.is_empty() {
            return;
        }
        let auto = approval == Approval::Auto && simulated;
        let stops = self.control.stop.count();
        let step = match self.experiment.view().stage {
            ExperimentStage::Review => {
                let suggested = self.experiment.view().suggested.unwrap_or(Verdict::Void);
                // A trial that was cancelled or stopped waits for a person under every rule.
                let judged = if auto { suggested != Verdict::Void } else { suggested == Verdict::Accept };
                judged.then_some(OperatorRequest::Judge(suggested))
            }
            ExperimentStage::Proposed if self.mode == Mode::Ready && simulated => {
                self.experiment.view().proposal.map(|(trial, revision)| OperatorRequest::Approve { trial, revision })
            }
            ExperimentStage::Proposed if self.mode == Mode::Disarmed && auto && !arming && time_ns >= retry_ns => {
                Some(OperatorRequest::Arm)
            }
            _ => None,
        };
        let Some(request) = step else { return };
        self.unattended.arming = request == OperatorRequest::Arm;
        let stamped = StampedRequest { request, stops, time_ns };
        if let Some(answer) = self.execute(&stamped, Asker::Rule, time_ns) {
            self.respond(&stamped, Asker::Rule, answer, time_ns);
        }
        self.finish_jobs(time_ns);
    }

    /// Records the answer to a request of the rule.
    pub(super) fn rule_answered(&mut self, request: &OperatorRequest, answer: Result<String, String>, time_ns: u64) {
        let approval = self.unattended.approval;
        match answer {
            Ok(answer) => self.log(LogLevel::Info, format!("{}: {request}: {answer}", approval.name()), time_ns),
            Err(reason) if *request == OperatorRequest::Arm => {
                self.unattended.arming_refused(time_ns);
                if self.unattended.refused != reason {
                    self.log(LogLevel::Info, format!("{} cannot arm yet: {reason}", approval.name()), time_ns);
                    self.unattended.refused = reason;
                }
            }
            Err(reason) => {
                self.unattended.paused = true;
                self.log(LogLevel::Warning, format!("{} waits for a person: {reason}", approval.name()), time_ns);
            }
        }
    }
}
