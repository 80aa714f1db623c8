//! Data of one tick for the consistency checks.

use crate::robot::{JointCommand, LinkStatus, RobotState};
use crate::telemetry::{Estimate, Mode};

/// Longest time between two states over which rates are integrated, s; a longer gap hides too much.
const LONGEST_STEP_S: f64 = 0.0035;

/// Data of one tick.
#[derive(Debug, Clone, Copy)]
pub struct ConsistencyInputs<'a> {
    /// Mode before the failsafes.
    pub mode: Mode,
    /// Newest state of the robot.
    pub state: &'a RobotState,
    /// Whether the state arrived in this tick.
    pub is_new: bool,
    /// The robot's clock went backwards since the last tick.
    pub restarted: bool,
    /// Estimate from the state.
    pub estimate: &'a Estimate,
    /// Time of this computer, ns.
    pub now_ns: u64,
    /// The link; none for a machine without one.
    pub link: Option<LinkStatus>,
    /// The last command that was sent.
    pub sent: &'a JointCommand,
}

/// Time between two new states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StateStep {
    pub dt_s: f64,
    /// Whether rates may be integrated over it.
    pub is_short: bool,
}

impl StateStep {
    pub fn new(dt_s: f64) -> StateStep {
        StateStep { dt_s, is_short: dt_s < LONGEST_STEP_S }
    }
}
