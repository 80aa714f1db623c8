//! Standing up and sitting down: a smooth ramp of joint targets from the measured pose.

use super::settings::{ControlSettings, RampSettings};
use crate::robot::{JOINTS, JointCommand, Joints, RobotState, ticks_in};
use crate::telemetry::Fault;

/// Progress of a ramp.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the doc of the variant describes its field")]
pub enum RampProgress {
    /// Under way.
    Moving,
    /// The joints are within the tolerance.
    Reached,
    /// The joints are not within the tolerance after the time-out; the error is the largest of a joint.
    TimedOut { error_rad: f64 },
}

/// A ramp under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseRamp {
    from: Joints,
    to: Joints,
    settings: RampSettings,
    elapsed: u32,
    /// Targets of the last tick, rad.
    target: Joints,
    /// Ticks in a row in which each joint was too far from its target, and in which it demanded too much torque.
    behind: [u32; JOINTS],
    strained: [u32; JOINTS],
}

impl PoseRamp {
    /// Starts at the measured angles.
    pub fn begin(state: &RobotState, to: &Joints, settings: &RampSettings) -> PoseRamp {
        let from = state.joint_position_rad;
        let counts = [0; JOINTS];
        PoseRamp { from, to: *to, settings: *settings, elapsed: 0, target: from, behind: counts, strained: counts }
    }

    /// Whether the targets still move.
    pub fn is_moving(&self) -> bool {
        self.elapsed < ticks_in(self.settings.duration_s)
    }

    /// Returns the fault of a joint that is blocked: too far from its target, or with too large a torque demanded, for some time. To be
    /// called once per tick, before `command`.
    pub fn blocked(&mut self, state: &RobotState, settings: &ControlSettings) -> Option<Fault> {
        let limits = &settings.failsafe;
        let most_ticks = ticks_in(limits.ramp_limit_s);
        let mut blocked = None;
        for joint in 0..JOINTS {
            let error_rad = self.target[joint] - state.joint_position_rad[joint];
            let torque_n_m = self.settings.kp * error_rad - self.settings.kd * state.joint_velocity_rad_s[joint];
            let allowed_n_m = limits.ramp_torque_share * settings.max_torque[joint];
            let count = |ticks: u32, exceeds: bool| if exceeds { ticks + 1 } else { 0 };
            self.behind[joint] = count(self.behind[joint], error_rad.abs() > limits.ramp_error_rad);
            self.strained[joint] = count(self.strained[joint], torque_n_m.abs() > allowed_n_m);
            let joint_number = joint as u8;
            let fault = if self.behind[joint] >= most_ticks {
                Fault::FollowingError {
                    joint: joint_number,
                    measured_rad: error_rad,
                    allowed_rad: limits.ramp_error_rad,
                }
            } else if self.strained[joint] >= most_ticks {
                Fault::RampTorque { joint: joint_number, measured_n_m: torque_n_m, allowed_n_m }
            } else {
                continue;
            };
            blocked = blocked.or(Some(fault));
        }
        blocked
    }

    /// Compares the measured angles with the pose.
    pub fn progress(&self, joint_position: &Joints) -> RampProgress {
        if self.is_moving() {
            return RampProgress::Moving;
        }
        let error_rad = joint_position.iter().zip(&self.to).map(|(q, to)| (q - to).abs()).fold(0.0, f64::max);
        if error_rad <= self.settings.tolerance_rad {
            RampProgress::Reached
        } else if self.elapsed >= ticks_in(self.settings.duration_s + self.settings.timeout_s) {
            RampProgress::TimedOut { error_rad }
        } else {
            RampProgress::Moving
        }
    }

    /// Returns the targets of this tick and advances the ramp.
    pub fn command(&mut self) -> JointCommand {
        let duration = f64::from(ticks_in(self.settings.duration_s).max(1));
        let part = (f64::from(self.elapsed) / duration).min(1.0);
        let smooth = smoothstep(part);
        self.elapsed += 1;
        self.target = std::array::from_fn(|joint| self.from[joint] + smooth * (self.to[joint] - self.from[joint]));
        JointCommand::hold(&self.target, self.settings.kp, self.settings.kd)
    }
}

/// 3 s^2 - 2 s^3 of a share s of the way, 0 to 1: starts and ends at rest.
pub(super) fn smoothstep(share: f64) -> f64 {
    share * share * (3.0 - 2.0 * share)
}
