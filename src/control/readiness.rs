//! Readiness for a jump, measured at the approval and again when the impulse is about to begin. On hardware only: a simulated robot
//! is placed for its trial, and its outcome on rough ground or with soft gains belongs to the trial.
//!
//! Source of the conditions: the paper's description of a trial (stand, settle, then jump; `docs/method.md`, "Timing of a trial").

use super::arming::ArmingHistory;
use super::link_quality::LinkQuality;
use super::settings::ControlSettings;
use crate::robot::{CONTROL_PERIOD_S, JOINTS, Joints, LEGS, RobotState, ticks_in};
use crate::telemetry::{Estimate, TrialInhibit};

/// Time for which all feet have been down and the trunk quiet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QuietTime {
    ticks: u32,
}

impl QuietTime {
    /// Records the estimate of one tick; to be called once per tick. A tick without a new state does not count.
    pub fn update(&mut self, estimate: &Estimate, state_age_ms: u32, settings: &ControlSettings) {
        if !settings.settle.is_quiet(estimate) {
            self.ticks = 0;
        } else if state_age_ms == 0 {
            self.ticks = self.ticks.saturating_add(1);
        }
    }

    /// The time, s.
    pub fn seconds(&self) -> f64 {
        f64::from(self.ticks) * CONTROL_PERIOD_S
    }
}

/// Data of one tick for the readiness.
#[derive(Debug, Clone, Copy)]
pub struct ReadinessInputs<'a> {
    /// Newest state of the robot.
    pub state: &'a RobotState,
    /// Estimate from that state.
    pub estimate: &'a Estimate,
    /// Time without motion.
    pub quiet: &'a QuietTime,
    /// Late ticks.
    pub history: &'a ArmingHistory,
    /// Age and losses of the states.
    pub link: &'a LinkQuality,
    /// Joint angles of standing, rad.
    pub pose_rad: &'a Joints,
}

/// Returns the first condition of a jump that does not hold:
///
/// 1. All four feet are down, and their forces add up to the weight within a factor.
/// 2. The trunk is level.
/// 3. Every joint is at the stance.
/// 4. Feet and trunk have been at rest for some time.
/// 5. Age and losses of the states and lateness of the ticks of the last second are within the limits of arming.
///
/// A value that is not a number does not hold.
pub fn unready(inputs: &ReadinessInputs, settings: &ControlSettings) -> Option<TrialInhibit> {
    if !settings.hardware {
        return None;
    }
    feet(inputs, settings)
        .or_else(|| level(inputs, settings))
        .or_else(|| stance(inputs, settings))
        .or_else(|| quiet(inputs, settings))
        .or_else(|| last_second(inputs, settings))
}

fn feet(inputs: &ReadinessInputs, settings: &ControlSettings) -> Option<TrialInhibit> {
    let limits = &settings.ready;
    let down = inputs.estimate.contact.iter().filter(|&&down| down).count();
    if down < LEGS {
        return Some(TrialInhibit::FeetUp { down: down as u8 });
    }
    let measured_n: f64 = inputs.state.foot_force_n.iter().sum();
    let [least_n, most_n] = [limits.force_share_min, limits.force_share_max].map(|share| share * settings.weight_n);
    let within = (least_n..=most_n).contains(&measured_n);
    (!within).then_some(TrialInhibit::FootForces { measured_n, least_n, most_n })
}

fn level(inputs: &ReadinessInputs, settings: &ControlSettings) -> Option<TrialInhibit> {
    let (measured_rad, allowed_rad) = (inputs.estimate.tilt_rad(), settings.ready.tilt_rad);
    let within = measured_rad <= allowed_rad;
    (!within).then_some(TrialInhibit::NotLevel { measured_rad, allowed_rad })
}

fn stance(inputs: &ReadinessInputs, settings: &ControlSettings) -> Option<TrialInhibit> {
    let allowed_rad = settings.ready.stance_rad;
    let error = |joint: usize| (inputs.state.joint_position_rad[joint] - inputs.pose_rad[joint]).abs();
    let joint = (0..JOINTS).find(|&joint| error(joint) > allowed_rad || error(joint).is_nan())?;
    Some(TrialInhibit::NotAtStance { joint: joint as u8, measured_rad: error(joint), allowed_rad })
}

fn quiet(inputs: &ReadinessInputs, settings: &ControlSettings) -> Option<TrialInhibit> {
    let (measured_s, needed_s) = (inputs.quiet.seconds(), settings.settle.quiet_s);
    (inputs.quiet.ticks < ticks_in(needed_s)).then_some(TrialInhibit::NotQuiet { measured_s, needed_s })
}

fn last_second(inputs: &ReadinessInputs, settings: &ControlSettings) -> Option<TrialInhibit> {
    let limits = &settings.arming;
    let (age_ms, loss) = (inputs.link.oldest_ms(), inputs.link.loss_share());
    let late = inputs.history.late_share_of_a_second();
    if age_ms > limits.state_age_ms {
        Some(TrialInhibit::StatesOld { age_ms, allowed_ms: limits.state_age_ms })
    } else if loss > limits.loss_share {
        Some(TrialInhibit::StatesLost { measured_share: loss, allowed_share: limits.loss_share })
    } else if late > limits.late_share {
        Some(TrialInhibit::TicksLate { measured_share: late, allowed_share: limits.late_share })
    } else {
        None
    }
}
