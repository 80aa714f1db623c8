//! Automatic approval and judgement, if the session was started with `falls-only` or `auto`.
//!
//! The operator has precedence: after STOP, a fault, a cancelled countdown, an undone or changed verdict or a request to sit down
//! the automatic rule pauses until a person arms or approves again. It never acknowledges a stop.

use crate::session::operator_request::OperatorRequest;
use crate::telemetry::{Mode, TransitionCause};
use crate::trial::Approval;

#[derive(Debug, Default)]
pub struct Unattended {
    pub approval: Approval,
    pub simulated: bool,
    /// A person has interrupted the rule.
    pub paused: bool,
    /// Arming was commanded and has not taken effect yet.
    pub arming: bool,
    /// Time of the next attempt to arm, ns.
    pub retry_ns: u64,
    /// Reason of the last refusal to arm, as it was logged.
    pub refused: String,
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

    /// Records that arming was refused: it is tried again later.
    pub fn arming_refused(&mut self, time_ns: u64) {
        self.arming = false;
        self.retry_ns = time_ns + RETRY_NS;
    }

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

    /// Pauses the rule after a changed verdict: a finished study may have room for another trial then, and the robot is at rest.
    pub fn answered(&mut self, request: &OperatorRequest, accepted: bool) {
        self.paused |= accepted && matches!(request, OperatorRequest::ChangeVerdict { .. });
    }
}
