//! From velocities to positions: Runge-Kutta 4 where motion is smooth, semi-implicit Euler where impulses act.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::contact::Velocity;
use super::dynamics::Dynamics;
use super::model::Model;
use super::state::{Acceleration, State};
use crate::robot::{JOINTS, Joints};

/// Velocities without contact at the end of a step of `h` seconds, in the axes of the body at its start.
pub(super) fn free_velocity(state: &State, acceleration: &Acceleration, h: f64) -> Velocity {
    // The trunk's acceleration in fixed axes: dv/dt + w x v.
    let linear = acceleration.linear_body + state.angular_velocity_body.cross(&state.velocity_body);
    let joint = |i: usize| state.joint_velocity[i] + h * acceleration.joint[i];
    Velocity {
        trunk: super::quantities::stack(
            &(state.velocity_body + linear * h),
            &(state.angular_velocity_body + acceleration.angular_body * h),
        ),
        legs: std::array::from_fn(|l| Vector3::new(joint(3 * l), joint(3 * l + 1), joint(3 * l + 2))),
    }
}

/// Semi-implicit Euler: `velocity` (axes of the body at the start) holds from now on and carries the positions through the step.
pub(super) fn semi_implicit_euler(state: &mut State, velocity: &Velocity, h: f64) {
    let linear: Vector3<f64> = velocity.trunk.fixed_rows::<3>(0).into();
    let angular: Vector3<f64> = velocity.trunk.fixed_rows::<3>(3).into();
    // p' = p + h R v,  R' = R exp(h w);  the new body axes see the same velocity turned back.
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

/// Rates of change of a whole state.
struct Rate {
    position_world: Vector3<f64>,
    orientation_world: Quaternion<f64>,
    joint_position: Joints,
    acceleration: Acceleration,
}

impl Rate {
    fn new(state: &State, acceleration: Acceleration) -> Rate {
        let rotation = state.orientation_world.quaternion();
        Rate {
            // dp/dt = R v,  dr/dt = r (0, w) / 2
            position_world: state.orientation_world * state.velocity_body,
            orientation_world: rotation * Quaternion::from_imag(state.angular_velocity_body) * 0.5,
            joint_position: state.joint_velocity,
            acceleration,
        }
    }

    /// `state` moved along this rate for `h` seconds.
    fn advance(&self, state: &State, h: f64) -> State {
        let a = &self.acceleration;
        State {
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
pub(super) fn runge_kutta_4(model: &Model, state: &State, first: Acceleration, torque: &Joints, h: f64) -> State {
    let rate = |s: &State| Rate::new(s, Dynamics::new(model, s, &model.rotor_inertia).acceleration(torque));
    let k1 = Rate::new(state, first);
    let k2 = rate(&k1.advance(state, 0.5 * h));
    let k3 = rate(&k2.advance(state, 0.5 * h));
    let k4 = rate(&k3.advance(state, h));
    // x' = x + h (k1 + 2 k2 + 2 k3 + k4) / 6
    let joints = |f: fn(&Rate) -> &Joints| -> Joints {
        std::array::from_fn(|i| (f(&k1)[i] + 2.0 * (f(&k2)[i] + f(&k3)[i]) + f(&k4)[i]) / 6.0)
    };
    let vectors = |f: fn(&Rate) -> Vector3<f64>| (f(&k1) + (f(&k2) + f(&k3)) * 2.0 + f(&k4)) / 6.0;
    let turning = k1.orientation_world + (k2.orientation_world + k3.orientation_world) * 2.0 + k4.orientation_world;
    let mean = Rate {
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

/// A quaternion that rounding or a step has taken off the unit sphere, back on it.
fn normalized(q: Quaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(q)
}
