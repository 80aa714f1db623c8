//! Cartesian impedance with joint damping, and the map from foot forces to joint torques (paper, equations 3 and 4).

use nalgebra::Vector3;

use crate::robot::kinematics::FootPosition;
use crate::trial::Gains;

/// Force of the virtual spring and damper at the foot, leg frame, N: Kp (p_d - p) - Kd v.
pub fn force_leg(
    gains: &Gains,
    desired_leg: &Vector3<f64>,
    foot: &FootPosition,
    joint_velocity: &Vector3<f64>,
) -> Vector3<f64> {
    // v = J dq
    let velocity_leg = foot.jacobian_leg * joint_velocity;
    (desired_leg - foot.position_leg) * gains.kp - velocity_leg * gains.kd
}

/// Joint torques of one leg, N m: tau = J^T F - Kd,joint dq.
pub fn torque(
    gains: &Gains,
    foot: &FootPosition,
    force_leg: &Vector3<f64>,
    joint_velocity: &Vector3<f64>,
) -> Vector3<f64> {
    foot.jacobian_leg.tr_mul(force_leg) - joint_velocity * gains.kd_joint
}
