//! Automatic approval and judgement, if the session was started with `falls-only` or `auto`.
//!
//! The operator has precedence: after STOP, a fault, a cancelled countdown, an undone verdict or a request to sit down the
//! automatic rule pauses until a person arms or approves again. It never acknowledges a stop.

use super::Supervisor;
use crate::recording::record::LogLevel;
use crate::session::operator_request::{OperatorRequest, StampedRequest};
use crate::telemetry::{Mode, TransitionCause};
use crate::trial::{Approval, ExperimentStage, Verdict};

/// State of the automatic rule.
#[derive(Debug, Default)]
pub struct Unattended {
    approval: Approval,
    simulated: bool,
    /// A person has interrupted the rule.
    paused: bool,
    /// Arming was commanded and has not taken effect yet.
    arming: bool,
    /// Time of the next attempt to arm, ns.
    retry_ns: u64,
    /// Reason of the last refusal to arm, as it was logged.
    refused: String,
}

/// Time from a refused arming to the next attempt, ns.
const RETRY_NS: u64 = 500_000_000;

impl Unattended {
    /// Pauses the rule after STOP, a fault, and sitting down, which may be the failsafe for a lost operator.
    pub fn mode_changed(&mut self, to: Mode, cause: TransitionCause) {
        self.arming &= to == Mode::Disarmed;
        if matches!(cause, TransitionCause::Stop | TransitionCause::Fault(_)) || to == Mode::SitDown {
            self.paused = true;
        }
    }

    /// Takes in that arming was refused: it is tried again later.
    pub fn arming_refused(&mut self, time_ns: u64) {
        self.arming = false;
        self.retry_ns = time_ns + RETRY_NS;
    }

    /// Takes in a request of the operator.
    pub fn requested(&mut self, request: &OperatorRequest) {
        match request {
            OperatorRequest::Cancel
            | OperatorRequest::SitDown
            | OperatorRequest::Undo
            | OperatorRequest::Acknowledge => self.paused = true,
            // Requests towards more energy only: a verdict that is given after a stop does not resume the rule.
            OperatorRequest::Arm | OperatorRequest::Approve { .. } => self.paused = false,
            _ => {}
        }
    }
}

impl Supervisor {
    /// Returns the session with the given rule of approval.
    pub fn approving(mut self, approval: Approval, simulated: bool) -> Supervisor {
        self.unattended = Unattended { approval, simulated, ..Unattended::default() };
        self
    }

    /// Takes the next step, if the rule allows one.
    pub fn act_unattended(&mut self, time_ns: u64) {
        let Unattended { approval, simulated, paused, arming, retry_ns, .. } = self.unattended;
        if approval == Approval::Each || paused || self.observe || self.ended.is_some() {
            return;
        }
        let auto = approval == Approval::Auto && simulated;
        let stops = self.control.stop.count();
        let step = match self.experiment.stage() {
            ExperimentStage::Review => {
                let suggested = self.experiment.under_review().and_then(|row| row.suggested).unwrap_or(Verdict::Void);
                // A trial that was cancelled or stopped waits for a person under every rule.
                let judged = if auto { suggested != Verdict::Void } else { suggested == Verdict::Accept };
                judged.then_some(OperatorRequest::Judge(suggested))
            }
            ExperimentStage::Proposed if self.mode == Mode::Ready && simulated => self
                .experiment
                .proposal()
                .map(|proposal| OperatorRequest::Approve { trial: proposal.trial, revision: proposal.revision }),
            ExperimentStage::Proposed if self.mode == Mode::Disarmed && auto && !arming && time_ns >= retry_ns => {
                Some(OperatorRequest::Arm)
            }
            _ => None,
        };
        let Some(request) = step else { return };
        self.unattended.arming = request == OperatorRequest::Arm;
        let stamped = StampedRequest { request, stops, time_ns };
        match self.answer(&stamped) {
            Ok(answer) => {
                self.log(LogLevel::Info, format!("{}: {}: {answer}", approval.name(), stamped.request), time_ns);
            }
            Err(reason) if stamped.request == OperatorRequest::Arm => {
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
        self.publish_experiment(time_ns);
    }
}
