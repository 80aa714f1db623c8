//! Standing up and sitting down: a smooth ramp of joint targets from the measured pose.

use super::settings::RampSettings;
use crate::robot::ticks_in;
use crate::robot::{JointCommand, Joints, RobotState};

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
}

impl PoseRamp {
    /// Starts at the measured angles.
    pub fn begin(state: &RobotState, to: &Joints, settings: &RampSettings) -> PoseRamp {
        PoseRamp { from: state.joint_position_rad, to: *to, settings: *settings, elapsed: 0 }
    }

    /// Compares the measured angles with the pose.
    pub fn progress(&self, joint_position: &Joints) -> RampProgress {
        if self.elapsed < ticks_in(self.settings.duration_s) {
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
        // Smoothstep 3 s^2 - 2 s^3: starts and ends at rest.
        let smooth = part * part * (3.0 - 2.0 * part);
        self.elapsed += 1;
        let position = std::array::from_fn(|joint| self.from[joint] + smooth * (self.to[joint] - self.from[joint]));
        JointCommand::hold(&position, self.settings.kp, self.settings.kd)
    }
}
