//! Data of one tick for the consistency checks.

use nalgebra::Vector3;

use crate::robot::{JointCommand, LinkStatus, RobotState};
use crate::telemetry::{Estimate, Mode};

/// Longest time between two states over which the mean of both rates is compared as it is, s.
const SHORT_STEP_S: f64 = 0.0035;
/// Time between two states beyond which a landing may hide more than half the change of the rates, s.
const HIDING_STEP_S: f64 = 0.015;
/// Time between two states up to which that was measured, s: 20 lost states (`tests/control/gaps.rs`). A longer gap hides no more.
const MEASURED_STEP_S: f64 = 0.021;

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
    /// Specific force of the estimator, body axes, m/s^2: the last possible one.
    pub accel_body: Vector3<f64>,
    /// Estimate from the state.
    pub estimate: &'a Estimate,
    /// Time of this computer, ns; of a clock that is not slewed, where there is one.
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
    /// Whether changes are compared with the integral of their rates: not over a gap that trips the failsafe for missing states.
    pub is_compared: bool,
}

impl StateStep {
    /// `state_age_ms` is the limit of the failsafe. Twice of it: a state that arrives faster than the one before the gap is further from it
    /// in the robot's time.
    pub fn new(dt_s: f64, state_age_ms: u32) -> StateStep {
        StateStep { dt_s, is_compared: dt_s < 2e-3 * f64::from(state_age_ms) }
    }

    /// Returns the change that the mean of both rates may miss, rad, where the rate changed by `change_rad_s`: half of that over the whole
    /// gap, as of a rate that changed at its begin or at its end. In a longer gap a rate may also rise and fall again: `hidden_rad_s` for
    /// the time beyond, as far as that was measured.
    pub fn allowance_rad(&self, change_rad_s: f64, hidden_rad_s: f64) -> f64 {
        if self.dt_s < SHORT_STEP_S {
            return 0.0;
        }
        0.5 * change_rad_s * self.dt_s + hidden_rad_s * (self.dt_s.min(MEASURED_STEP_S) - HIDING_STEP_S).max(0.0)
    }
}
