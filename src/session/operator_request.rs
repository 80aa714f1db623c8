//! Requests of the operator to the session. Every request is answered by a `RequestRecord`: carried out, or refused with the
//! reason. STOP is not among them: it has its own latch (`engine::EngineHandle::stop`).

use std::fmt;

use crate::telemetry::ArmingCheck;
use crate::trial::{Verdict, counted, six_digits};

/// Arming check that only the operator can confirm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OperatorCheck {
    /// The robot is in low-level mode, and was damped with the remote before.
    LowLevel,
    /// The displayed configuration is the intended one.
    Configuration,
    /// No person is within 2 m of the robot, and the remote is in hand. Holds for one arming.
    AreaClear,
    /// The control thread may run without the real-time priority that the system denied.
    Priority,
    /// The program may run without the locked memory that the system denied.
    LockedMemory,
    /// The loss of the operator's connection cannot be detected; another person watches the robot.
    Connection,
}

impl OperatorCheck {
    /// All of them.
    pub const ALL: [OperatorCheck; 6] = [
        OperatorCheck::LowLevel,
        OperatorCheck::Configuration,
        OperatorCheck::AreaClear,
        OperatorCheck::Priority,
        OperatorCheck::LockedMemory,
        OperatorCheck::Connection,
    ];

    /// Returns the arming check.
    pub const fn check(self) -> ArmingCheck {
        match self {
            OperatorCheck::LowLevel => ArmingCheck::LowLevel,
            OperatorCheck::Configuration => ArmingCheck::Configuration,
            OperatorCheck::AreaClear => ArmingCheck::AreaClear,
            OperatorCheck::Priority => ArmingCheck::Priority,
            OperatorCheck::LockedMemory => ArmingCheck::LockedMemory,
            OperatorCheck::Connection => ArmingCheck::Connection,
        }
    }
}

/// A request with the state at which it was made: a request that energises the robot is not carried out if STOP was pressed
/// after it, or if it arrives too late.
#[derive(Debug, Clone, PartialEq)]
pub struct StampedRequest {
    /// The request.
    pub request: OperatorRequest,
    /// Count of the STOP latch when the request was made.
    pub stops: u64,
    /// Time of the request, ns since the engine started.
    pub time_ns: u64,
}

/// A request of the operator. `Display` names it for the log.
#[expect(missing_docs, reason = "the variants describe their fields")]
#[derive(Debug, Clone, PartialEq)]
pub enum OperatorRequest {
    /// Energise the robot: it stands up.
    Arm,
    /// The operator's confirmation of an arming check.
    Confirm(OperatorCheck),
    /// Sit down and disarm.
    SitDown,
    /// The operator has checked the damped or faulted robot.
    Acknowledge,
    /// Run the proposal as it was seen.
    Approve { trial: u32, revision: u32 },
    /// Cancel the countdown.
    Cancel,
    /// Refuse the proposal as it was seen; the sampler proposes another.
    Skip { trial: u32, revision: u32 },
    /// Set one parameter of the proposal, in its unit.
    Override { parameter: String, value: f64 },
    /// Set one of the controller's gains (`kp`, `kd`, `kd_joint` or `k_att`) for the proposed trial, in its unit.
    OverrideGain { gain: String, value: f64 },
    /// Take all overrides back, also those of gains.
    ClearOverrides,
    /// Fix a parameter for the next trials; the others are still proposed.
    Fix { parameter: String, value: f64, trials: u32 },
    /// Let a fixed parameter be searched again.
    Unfix { parameter: String },
    /// Search a parameter within these bounds from now on; the configured ones undo it.
    NarrowBounds { parameter: String, low: f64, high: f64 },
    /// Repeat the best points until one leads with enough confidence, at most so often in all; 0 ends that.
    ConfirmBest { repeats: u32 },
    /// Judge the trial under review.
    Judge(Verdict),
    /// Void the trial under review, or repeat an earlier one, and queue the parameters again; no number for the one under
    /// review.
    Rerun { trial: Option<u32> },
    /// Take the last verdict back.
    Undo,
    /// Use a value measured by hand for the trial under review; none removes it.
    HandValue(Option<f64>),
    /// A note on a trial.
    Note { trial: u32, text: String },
    /// Queue a point, in table order of the parameters.
    Enqueue(Vec<(String, f64)>),
    /// Remove a queued point: it never runs.
    RemoveQueued { trial: u32 },
    /// Exchange a queued point with the one before it, or after it.
    MoveQueued { trial: u32, earlier: bool },
    /// Raise the budget by this many trials.
    Continue(u32),
    /// Void the trial under review for this reason, with `rerun` also queue the parameters again. Needed where the trial
    /// tripped a limit.
    VoidBecause { reason: String, rerun: bool },
    /// Change the final verdict of a trial, for this reason.
    ChangeVerdict { trial: u32, verdict: Verdict, reason: String },
    /// Take control of a real robot: the first commands are sent to it.
    TakeControl,
}

impl fmt::Display for OperatorRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OperatorRequest::Arm => f.write_str("arm"),
            OperatorRequest::Confirm(check) => write!(f, "confirm {}", check.check().name()),
            OperatorRequest::SitDown => f.write_str("sit down"),
            OperatorRequest::Acknowledge => f.write_str("acknowledge"),
            OperatorRequest::Approve { trial, .. } => write!(f, "approve trial {trial}"),
            OperatorRequest::Cancel => f.write_str("cancel the countdown"),
            OperatorRequest::Skip { trial, .. } => write!(f, "skip trial {trial}"),
            OperatorRequest::Override { parameter, value } => {
                write!(f, "override {parameter} = {}", six_digits(*value))
            }
            OperatorRequest::OverrideGain { gain, value } => write!(f, "set the gain {gain} = {}", six_digits(*value)),
            OperatorRequest::ClearOverrides => f.write_str("clear the overrides"),
            OperatorRequest::Fix { parameter, value, trials } => {
                write!(f, "fix {parameter} = {} for {}", six_digits(*value), counted(*trials as usize, "trial"))
            }
            OperatorRequest::Unfix { parameter } => write!(f, "search {parameter} again"),
            OperatorRequest::NarrowBounds { parameter, low, high } => {
                write!(f, "search {parameter} from {} to {}", six_digits(*low), six_digits(*high))
            }
            OperatorRequest::ConfirmBest { repeats: 0 } => f.write_str("end the repeats"),
            OperatorRequest::ConfirmBest { repeats } => {
                write!(f, "confirm the best with {}", counted(*repeats as usize, "repeat"))
            }
            OperatorRequest::Judge(verdict) => f.write_str(verdict.name()),
            OperatorRequest::Rerun { trial: None } => f.write_str("re-run"),
            OperatorRequest::Rerun { trial: Some(trial) } => write!(f, "re-run trial {trial}"),
            OperatorRequest::Undo => f.write_str("undo the verdict"),
            OperatorRequest::HandValue(Some(value)) => write!(f, "value measured by hand {}", six_digits(*value)),
            OperatorRequest::HandValue(None) => f.write_str("no value measured by hand"),
            OperatorRequest::Note { trial, text } => write!(f, "note on trial {trial}: {text}"),
            OperatorRequest::Enqueue(point) => {
                let values: Vec<_> =
                    point.iter().map(|(name, value)| format!("{name} = {}", six_digits(*value))).collect();
                write!(f, "queue {}", values.join(", "))
            }
            OperatorRequest::RemoveQueued { trial } => write!(f, "remove trial {trial} from the queue"),
            // Not its number, which stays at its place: the moved point has another one afterwards.
            OperatorRequest::MoveQueued { earlier: true, .. } => f.write_str("move earlier"),
            OperatorRequest::MoveQueued { earlier: false, .. } => f.write_str("move later"),
            OperatorRequest::Continue(trials) => write!(f, "continue for {}", counted(*trials as usize, "trial")),
            OperatorRequest::VoidBecause { reason, rerun: false } => write!(f, "void because: {reason}"),
            OperatorRequest::VoidBecause { reason, rerun: true } => write!(f, "re-run because: {reason}"),
            OperatorRequest::ChangeVerdict { trial, verdict, reason } => {
                write!(f, "change the verdict of trial {trial} to {} ({reason})", verdict.name())
            }
            OperatorRequest::TakeControl => f.write_str("take control"),
        }
    }
}
