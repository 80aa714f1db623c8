//! Joint velocities against differentiated joint angles, and motors that repeat their measurements.

use super::inputs::StateStep;
use super::leaky::kept;
use crate::robot::{JOINTS, Joints, RobotState};

/// Time constant of the sum of the angle's change less that of the velocity, s.
const SUM_S: f64 = 0.1;
/// Joint velocity that a long gap may hide, rad/s. Largest rest of 60 simulated jumps: 0.124 rad after 15 ms, 0.202 rad after 20 ms.
const HIDDEN_RAD_S: f64 = 20.0;

/// History of the joints.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct JointRates {
    /// Change of the angle less the integral of the velocity, rad.
    error_rad: Joints,
    /// States in a row with the same angle, velocity and torque.
    repeated: [u32; JOINTS],
}

impl JointRates {
    pub fn update(&mut self, last: &RobotState, now: &RobotState, step: &StateStep) {
        for joint in 0..JOINTS {
            let moved = now.joint_position_rad[joint] - last.joint_position_rad[joint];
            let [before, after] = [last, now].map(|state| state.joint_velocity_rad_s[joint]);
            let residual = moved - 0.5 * (before + after) * step.dt_s;
            let added = if step.is_compared {
                beyond(residual, step.allowance_rad((after - before).abs(), HIDDEN_RAD_S))
            } else {
                0.0
            };
            self.error_rad[joint] = self.error_rad[joint] * kept(step.dt_s, SUM_S) + added;
            let same = moved == 0.0
                && now.joint_velocity_rad_s[joint] == last.joint_velocity_rad_s[joint]
                && now.joint_torque_n_m[joint] == last.joint_torque_n_m[joint];
            self.repeated[joint] = if same { self.repeated[joint].saturating_add(1) } else { 0 };
        }
    }

    pub fn repeated_states(&self) -> u32 {
        self.repeated.into_iter().max().unwrap_or(0)
    }

    /// Index and error of the joint with the largest error, rad.
    pub fn worst(&self) -> (u8, f64) {
        let errors = self.error_rad.iter().map(|error| error.abs()).enumerate();
        errors.fold((0, 0.0), |worst, (joint, error)| if error > worst.1 { (joint as u8, error) } else { worst })
    }
}

/// Returns the part of `value` whose magnitude is beyond `allowed`.
fn beyond(value: f64, allowed: f64) -> f64 {
    value - value.clamp(-allowed, allowed)
}
