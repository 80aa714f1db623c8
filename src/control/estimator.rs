//! What the controller believes about the base and the feet.
//!
//! In simulation the base is the simulator's own truth. Elsewhere the orientation is the inertial unit's, and velocity
//! and position come from leg odometry: a foot on the ground does not move, so the trunk moves against it; in flight the
//! trunk falls freely.

use nalgebra::Vector3;

use super::settings::{PERIOD_S, Settings};
use crate::realtime::telemetry::Estimate;
use crate::robot::kinematics::Foot;
use crate::robot::{PerLeg, RobotState, leg_of};

/// Acceleration of free fall, m/s^2.
pub const GRAVITY: f64 = 9.81;

/// Keeps what an estimate needs from one tick to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimator {
    estimate: Estimate,
    started: bool,
}

impl Estimator {
    /// Forgets everything: the robot was put somewhere else.
    pub fn reset(&mut self) {
        *self = Estimator::default();
    }

    /// The estimate after one more state; `feet` belong to its joint angles.
    pub fn update(&mut self, state: &RobotState, feet: &PerLeg<Foot>, settings: &Settings) -> &Estimate {
        let previous_yaw = self.estimate.roll_pitch_yaw.z;
        let estimate = &mut self.estimate;
        estimate.foot_position_leg = feet.map(|foot| foot.position_leg);
        estimate.contact = state.foot_force.map(|force| force >= settings.contact_force_n);
        match &state.truth {
            Some(truth) => {
                estimate.position_world = truth.position_world;
                estimate.velocity_world = truth.velocity_world;
                estimate.orientation_world = truth.orientation_world;
                estimate.angular_velocity_body = truth.angular_velocity_body;
            }
            None => {
                estimate.orientation_world = state.imu.orientation_world;
                estimate.angular_velocity_body = state.imu.gyro_body;
                odometry(estimate, state, feet, settings);
            }
        }
        let (roll, pitch, yaw) = estimate.orientation_world.euler_angles();
        // Unwrap: the yaw nearest to the previous one, so that a turn of more than pi counts in full.
        let turn = yaw - previous_yaw;
        let unwrapped = if self.started {
            previous_yaw + turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round()
        } else {
            yaw
        };
        if !unwrapped.is_finite() {
            // The watchdog stops the robot; one bad number must not spoil every later yaw.
            estimate.roll_pitch_yaw = Vector3::new(roll, pitch, previous_yaw);
            return &self.estimate;
        }
        self.started = true;
        estimate.roll_pitch_yaw = Vector3::new(roll, pitch, unwrapped);
        &self.estimate
    }
}

/// Velocity and position of the trunk from the legs that stand: v = -R (omega x p + J dq), averaged over them.
fn odometry(estimate: &mut Estimate, state: &RobotState, feet: &PerLeg<Foot>, settings: &Settings) {
    let mut sum_body = Vector3::zeros();
    let mut standing = 0.0;
    for (leg, foot) in feet.iter().enumerate() {
        if estimate.contact[leg] {
            let position_body = settings.hip_origin_body[leg] + foot.position_leg;
            let velocity_leg = foot.jacobian_leg * leg_of(&state.joint_velocity, leg);
            sum_body -= estimate.angular_velocity_body.cross(&position_body) + velocity_leg;
            standing += 1.0;
        }
    }
    if standing > 0.0 {
        estimate.velocity_world = estimate.orientation_world * (sum_body / standing);
    } else {
        estimate.velocity_world.z -= GRAVITY * PERIOD_S;
    }
    estimate.position_world += estimate.velocity_world * PERIOD_S;
}
