//! What the session does without being asked: nothing, unless it was started with `falls-only` or `auto`.
//!
//! A person's hand outranks it: after STOP, a fault, a cancelled countdown, an undone verdict or a wish to sit down it holds
//! still until a person arms or approves again. It never acknowledges a stop.

use super::{OperatorRequest, StampedRequest, Supervisor};
use crate::recording::record::LogLevel;
use crate::telemetry::{Mode, TransitionCause};
use crate::trial::{Approval, ExperimentStage, Verdict};

/// Whether and how the session acts by itself.
#[derive(Debug, Default)]
pub struct Unattended {
    approval: Approval,
    simulated: bool,
    /// A person has stopped the course of things.
    held: bool,
    /// Arming was asked for and the answer is not here yet.
    arming: bool,
    /// When arming is tried again, ns: what must hold before it may take a moment.
    again_ns: u64,
    /// Why it was refused when that was said last.
    refused: String,
}

/// How long a refused arming is waited with, ns.
const AGAIN_NS: u64 = 500_000_000;

impl Unattended {
    /// STOP, a fault, and a robot that sits down although nobody asked it to (its operator is silent) end the course.
    pub fn mode_changed(&mut self, to: Mode, cause: TransitionCause) {
        self.arming &= to == Mode::Disarmed;
        if matches!(cause, TransitionCause::Stop | TransitionCause::Fault(_)) || to == Mode::SitDown {
            self.held = true;
        }
    }

    /// The control thread does not stand the robot up now; later it may.
    pub fn arming_refused(&mut self, time_ns: u64) {
        self.arming = false;
        self.again_ns = time_ns + AGAIN_NS;
    }
}

impl Supervisor {
    /// The same session with another rule of approval.
    pub fn approving(mut self, approval: Approval, simulated: bool) -> Supervisor {
        self.unattended = Unattended { approval, simulated, ..Unattended::default() };
        self
    }

    /// A person has wished something.
    pub(super) fn noticed(&mut self, intent: &OperatorRequest) {
        match intent {
            OperatorRequest::Cancel
            | OperatorRequest::SitDown
            | OperatorRequest::Undo
            | OperatorRequest::Acknowledge => self.unattended.held = true,
            // Towards more energy only: a verdict given after a stop does not set the robot going.
            OperatorRequest::Arm | OperatorRequest::Approve { .. } => self.unattended.held = false,
            _ => {}
        }
    }

    /// One step of the course, if it is one that this session takes by itself.
    pub(super) fn act_by_itself(&mut self, time_ns: u64) {
        let Unattended { approval, simulated, held, arming, again_ns, .. } = self.unattended;
        if approval == Approval::Each || held || self.observe || self.ended.is_some() {
            return;
        }
        let auto = approval == Approval::Auto && simulated;
        let stops = self.control.stop.count();
        let step = match self.life.stage() {
            ExperimentStage::Review => {
                let suggested = self.life.under_review().and_then(|row| row.suggested).unwrap_or(Verdict::Void);
                // What was cancelled or stopped in mid-jump waits for a person, whatever the rule.
                let judged = if auto { suggested != Verdict::Void } else { suggested == Verdict::Accept };
                judged.then_some(OperatorRequest::Judge(suggested))
            }
            ExperimentStage::Proposed if self.mode == Mode::Ready && simulated => {
                self.life.proposal().map(|card| OperatorRequest::Approve { trial: card.trial, revision: card.revision })
            }
            ExperimentStage::Proposed if self.mode == Mode::Disarmed && auto && !arming && time_ns >= again_ns => {
                Some(OperatorRequest::Arm)
            }
            _ => None,
        };
        let Some(intent) = step else { return };
        self.unattended.arming = intent == OperatorRequest::Arm;
        let wish = StampedRequest { intent, stops, time_ns };
        match self.obey(&wish) {
            Ok(answer) => {
                let wish = super::describe(&wish.intent);
                self.log(LogLevel::Info, format!("{}: {wish}: {answer}", approval.name()), time_ns);
            }
            Err(reason) if wish.intent == OperatorRequest::Arm => {
                self.unattended.arming_refused(time_ns);
                if self.unattended.refused != reason {
                    self.log(LogLevel::Info, format!("{} cannot arm yet: {reason}", approval.name()), time_ns);
                    self.unattended.refused = reason;
                }
            }
            Err(reason) => {
                // Said once: a person must look.
                self.unattended.held = true;
                self.log(LogLevel::Warning, format!("{} waits for a person: {reason}", approval.name()), time_ns);
            }
        }
        self.publish(time_ns);
    }
}
