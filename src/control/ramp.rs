//! Standing up and sitting down: a smooth ramp of joint targets from the measured pose.

use super::limits::ticks;
use super::settings::RampSettings;
use crate::robot::{JOINTS, JointCommand, Joints, MotorCommand, RobotState};

/// Progress of a ramp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RampProgress {
    /// Under way.
    Moving,
    /// The joints are within the tolerance.
    Reached,
    /// The joints are not within the tolerance after the time-out.
    Late {
        /// Largest joint error, rad.
        error_rad: f64,
    },
}

/// A ramp under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseRamp {
    from: Joints,
    to: Joints,
    settings: RampSettings,
    elapsed: u32,
}

impl PoseRamp {
    /// Starts at the measured angles.
    pub fn begin(state: &RobotState, to: &Joints, settings: &RampSettings) -> PoseRamp {
        PoseRamp { from: state.joint_position, to: *to, settings: *settings, elapsed: 0 }
    }

    /// Compares the measured angles with the pose.
    pub fn progress(&self, joint_position: &Joints) -> RampProgress {
        if self.elapsed < ticks(self.settings.duration_s) {
            return RampProgress::Moving;
        }
        let error_rad = joint_position.iter().zip(&self.to).map(|(q, to)| (q - to).abs()).fold(0.0, f64::max);
        if error_rad <= self.settings.tolerance_rad {
            RampProgress::Reached
        } else if self.elapsed >= ticks(self.settings.duration_s + self.settings.timeout_s) {
            RampProgress::Late { error_rad }
        } else {
            RampProgress::Moving
        }
    }

    /// Returns the targets of this tick and advances the ramp.
    pub fn command(&mut self) -> JointCommand {
        let duration = f64::from(ticks(self.settings.duration_s).max(1));
        let part = (f64::from(self.elapsed) / duration).min(1.0);
        // Smoothstep 3 s^2 - 2 s^3: starts and ends at rest.
        let smooth = part * part * (3.0 - 2.0 * part);
        self.elapsed += 1;
        let mut command = JointCommand::default();
        for joint in 0..JOINTS {
            command.motor[joint] = MotorCommand {
                position: self.from[joint] + smooth * (self.to[joint] - self.from[joint]),
                velocity: 0.0,
                kp: self.settings.kp,
                kd: self.settings.kd,
                torque: 0.0,
            };
        }
        command
    }
}
