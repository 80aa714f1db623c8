//! What an operator may wish of the session. Every intent is answered by a `CommandRecord`: carried out, or refused and
//! why. STOP is not among them: it has its own latch (`engine::Handle::stop`).

use crate::telemetry::ArmingCheck;
use crate::trial::Verdict;

/// What only an operator can know: an item of the pre-arm list that takes their word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OperatorCheck {
    /// The robot is in low-level mode, and was damped with the remote before.
    LowLevel,
    /// The configuration that is shown is the one that is meant.
    Configuration,
    /// Nobody is near the robot, and the remote is in hand. Holds for one arming.
    AreaClear,
}

impl OperatorCheck {
    /// All of them.
    pub const ALL: [OperatorCheck; 3] =
        [OperatorCheck::LowLevel, OperatorCheck::Configuration, OperatorCheck::AreaClear];

    /// The item of the list.
    pub const fn check(self) -> ArmingCheck {
        match self {
            OperatorCheck::LowLevel => ArmingCheck::LowLevel,
            OperatorCheck::Configuration => ArmingCheck::Configuration,
            OperatorCheck::AreaClear => ArmingCheck::AreaClear,
        }
    }
}

/// An intent with what makes it good: what energises is not carried out if STOP came after it, or too late.
#[derive(Debug, Clone, PartialEq)]
pub struct StampedRequest {
    /// What is wished.
    pub intent: OperatorRequest,
    /// How often STOP had been pressed when it was wished.
    pub stops: u64,
    /// When it was wished, ns since the engine started.
    pub time_ns: u64,
}

/// What may be wished.
#[derive(Debug, Clone, PartialEq)]
pub enum OperatorRequest {
    /// Energise the robot: it stands up.
    Arm,
    /// The operator's word on an item of the pre-arm list.
    Confirm(OperatorCheck),
    /// Sit down and disarm.
    SitDown,
    /// The damped or faulted robot has been looked at.
    Acknowledge,
    /// Run the proposal as it was seen: `trial` and `revision` are those of the card.
    Approve {
        /// Number of the proposed trial.
        trial: u32,
        /// Revision of the card.
        revision: u32,
    },
    /// Cancel the countdown.
    Cancel,
    /// Refuse the proposal; the sampler proposes another.
    Skip,
    /// Set one parameter of the proposal.
    Override {
        /// Parameter name.
        parameter: String,
        /// New value, in the parameter's unit.
        value: f64,
    },
    /// Set one of the controller's gains for the proposed trial.
    OverrideGain {
        /// `kp`, `kd`, `kd_joint` or `k_att`.
        gain: String,
        /// New value, in the gain's unit.
        value: f64,
    },
    /// Back to what was proposed, gains too.
    ClearOverrides,
    /// Fix a parameter for the next trials; the others are still proposed.
    Fix {
        /// Parameter name.
        parameter: String,
        /// Its value, in the parameter's unit.
        value: f64,
        /// For how many trials.
        trials: u32,
    },
    /// Let a fixed parameter be searched again.
    Unfix {
        /// Parameter name.
        parameter: String,
    },
    /// Search a parameter within these bounds from now on; the configured ones undo it.
    NarrowBounds {
        /// Parameter name.
        parameter: String,
        /// Lower bound, in the parameter's unit.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// Repeat the best points until one leads with enough confidence, at most so often in all; 0 ends that.
    ConfirmBest {
        /// Most repeats.
        repeats: u32,
    },
    /// Judge the trial under review.
    Judge(Verdict),
    /// Void the trial under review (or repeat an earlier one) and queue its parameters again.
    Rerun {
        /// The trial to repeat; none for the one under review.
        trial: Option<u32>,
    },
    /// Take the last verdict back.
    Undo,
    /// Use a value measured by hand for the trial under review; none removes it.
    HandValue(Option<f64>),
    /// A note on a trial.
    Note {
        /// The trial.
        trial: u32,
        /// The text.
        text: String,
    },
    /// Queue a point, in table order of the parameters.
    Enqueue(Vec<(String, f64)>),
    /// Raise the budget by this many trials.
    Continue(u32),
}
