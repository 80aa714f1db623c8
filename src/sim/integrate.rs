//! Time integration: Runge-Kutta 4 for smooth motion, semi-implicit Euler for steps with impulses.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::dynamics::Dynamics;
use super::model::RobotModel;
use super::motion::GeneralizedVelocity;
use super::quantities::{split, stack};
use super::state::{Acceleration, SimState};
use crate::robot::{JOINTS, Joints};

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
    let turn = UnitQuaternion::from_scaled_axis(angular * h);
    state.position_world += state.orientation_world * (linear * h);
    state.orientation_world = normalized(state.orientation_world.quaternion() * turn.quaternion());
    state.velocity_body = turn.inverse_transform_vector(&linear);
    state.angular_velocity_body = angular;
    for i in 0..JOINTS {
        state.joint_velocity[i] = velocity.legs[i / 3][i % 3];
        state.joint_position[i] += h * state.joint_velocity[i];
    }
}

/// Time derivative of a [`SimState`].
struct StateDerivative {
    position_world: Vector3<f64>,
    orientation_world: Quaternion<f64>,
    joint_position: Joints,
    acceleration: Acceleration,
}

impl StateDerivative {
    fn new(state: &SimState, acceleration: Acceleration) -> StateDerivative {
        let rotation = state.orientation_world.quaternion();
        StateDerivative {
            // dp/dt = R v,  dr/dt = r (0, w) / 2
            position_world: state.orientation_world * state.velocity_body,
            orientation_world: rotation * Quaternion::from_imag(state.angular_velocity_body) * 0.5,
            joint_position: state.joint_velocity,
            acceleration,
        }
    }

    /// Returns `state` advanced by `h` seconds of this derivative.
    fn advance(&self, state: &SimState, h: f64) -> SimState {
        let a = &self.acceleration;
        SimState {
            position_world: state.position_world + self.position_world * h,
            orientation_world: normalized(state.orientation_world.quaternion() + self.orientation_world * h),
            joint_position: std::array::from_fn(|i| state.joint_position[i] + h * self.joint_position[i]),
            velocity_body: state.velocity_body + a.linear_body * h,
            angular_velocity_body: state.angular_velocity_body + a.angular_body * h,
            joint_velocity: std::array::from_fn(|i| state.joint_velocity[i] + h * a.joint[i]),
        }
    }
}

/// Runge-Kutta 4 over `h` seconds of constant joint torques without contact; `first` is the acceleration at the start.
pub(super) fn runge_kutta_4(
    model: &RobotModel,
    state: &SimState,
    first: Acceleration,
    torque: &Joints,
    h: f64,
) -> SimState {
    let rate =
        |s: &SimState| StateDerivative::new(s, Dynamics::new(model, s, &model.rotor_inertia).acceleration(torque));
    let k1 = StateDerivative::new(state, first);
    let k2 = rate(&k1.advance(state, 0.5 * h));
    let k3 = rate(&k2.advance(state, 0.5 * h));
    let k4 = rate(&k3.advance(state, h));
    // x' = x + h (k1 + 2 k2 + 2 k3 + k4) / 6
    let joints = |f: fn(&StateDerivative) -> &Joints| -> Joints {
        std::array::from_fn(|i| (f(&k1)[i] + 2.0 * (f(&k2)[i] + f(&k3)[i]) + f(&k4)[i]) / 6.0)
    };
    let vectors = |f: fn(&StateDerivative) -> Vector3<f64>| (f(&k1) + (f(&k2) + f(&k3)) * 2.0 + f(&k4)) / 6.0;
    let turning = k1.orientation_world + (k2.orientation_world + k3.orientation_world) * 2.0 + k4.orientation_world;
    let mean = StateDerivative {
        position_world: vectors(|k| k.position_world),
        orientation_world: turning / 6.0,
        joint_position: joints(|k| &k.joint_position),
        acceleration: Acceleration {
            linear_body: vectors(|k| k.acceleration.linear_body),
            angular_body: vectors(|k| k.acceleration.angular_body),
            joint: joints(|k| &k.acceleration.joint),
        },
    };
    mean.advance(state, h)
}

/// Returns the unit quaternion nearest to `q`.
fn normalized(q: Quaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(q)
}
