//! Time integration of steps with impulses: semi-implicit Euler.

use nalgebra::{UnitQuaternion, Vector3};

use super::motion::GeneralizedVelocity;
use super::six::{split, stack};
use super::state::{Acceleration, SimState};
use crate::robot::JOINTS;
use crate::robot::rotation::from_scaled_axis;

/// Returns the velocity without contact at the end of a step of `h` seconds, in the axes of the body at its start.
pub(super) fn free_velocity(state: &SimState, acceleration: &Acceleration, h: f64) -> GeneralizedVelocity {
    // The trunk's acceleration in fixed axes: dv/dt + w x v.
    let linear = acceleration.linear_body + state.angular_velocity_body.cross(&state.velocity_body);
    let joint = |i: usize| state.joint_velocity[i] + h * acceleration.joint[i];
    GeneralizedVelocity {
        trunk: stack(
            &(state.velocity_body + linear * h),
            &(state.angular_velocity_body + acceleration.angular_body * h),
        ),
        legs: std::array::from_fn(|l| Vector3::new(joint(3 * l), joint(3 * l + 1), joint(3 * l + 2))),
    }
}

/// Semi-implicit Euler: sets `velocity` (axes of the body at the start of the step) and moves the positions with it.
pub(super) fn semi_implicit_euler(state: &mut SimState, velocity: &GeneralizedVelocity, h: f64) {
    let (linear, angular) = split(&velocity.trunk);
    // p' = p + h R v,  R' = R exp(h w),  v' = exp(h w)^T v
    let turn = from_scaled_axis(angular * h);
    state.position_world += state.world_from_body * (linear * h);
    state.world_from_body = UnitQuaternion::new_normalize(state.world_from_body.quaternion() * turn.quaternion());
    state.velocity_body = turn.inverse_transform_vector(&linear);
    state.angular_velocity_body = angular;
    for i in 0..JOINTS {
        state.joint_velocity[i] = velocity.legs[i / 3][i % 3];
        state.joint_position[i] += h * state.joint_velocity[i];
    }
}
