//! Steps of free flight: one evaluation of the equations of motion each, with the momentum of the whole robot kept by construction.
//!
//! In flight gravity alone changes the momentum: its linear part falls at a known rate, its angular part about the centre of mass is
//! constant. A step therefore integrates the joints and the trunk's rotation, and solves for the rest at its end: the centre of mass is
//! on its parabola, and the trunk has the velocity at which the whole robot has the known momentum,
//!
//! ```text
//! I_0 v_0 = k - sum F_l dq_l    (first six rows of M v, body axes).
//! ```
//!
//! Joints and rotation are of third order: Adams-Bashforth of two steps predicts, Adams-Moulton of two steps corrects (Hairer, Norsett,
//! Wanner, "Solving Ordinary Differential Equations I", 2nd edition 1993, section III.1), in the mode PEC: the equations at the end of
//! a step are those at the start of the next one. The rotation is the exponential of the Magnus series (Iserles et al., "Lie-group
//! methods", Acta Numerica 9, 2000, section 4). A torque that changes from step to step is no error: the acceleration of the step
//! before is taken at the torque of this one.

use nalgebra::{UnitQuaternion, Vector3};

use super::dynamics::Dynamics;
use super::model::RobotModel;
use super::spatial::{SpatialForce, SpatialMotion};
use super::state::{Acceleration, SimState};
use crate::robot::rotation::from_scaled_axis;
use crate::robot::{GRAVITY, JOINTS, Joints};

/// Values that a flight step leaves for the next one.
#[derive(Debug, Clone)]
pub(super) struct FlightMemory {
    /// Accelerations at the start and at the end of the step under its torques.
    start: Acceleration,
    end: Acceleration,
    /// Length of the step, s.
    h: f64,
}

/// Advances `state` by `h` seconds of flight under constant torques. `dynamics` holds the equations at its start, and afterwards those at
/// its end with the predicted velocities; `start` is the acceleration at its start, `before` the memory of the flight step that ended
/// there.
pub(super) fn flight_step(
    model: &RobotModel,
    dynamics: &mut Dynamics,
    state: &mut SimState,
    start: &Acceleration,
    before: Option<&FlightMemory>,
    torque: &Joints,
    h: f64,
) -> FlightMemory {
    let before = before.filter(|before| before.h == h);
    // h da/dt: the change of the acceleration over the last step, under the torques of that step.
    let growth = before.map_or(Acceleration::ZERO, |before| before.end.minus(&before.start));
    // x + h v + h^2 a / 2 + h^2 (h da/dt) / 6,  v + h a + h (h da/dt) / 2
    let (square, sixth) = (0.5 * h * h, h * h / 6.0);
    let (angular, turn) = (&state.angular_velocity_body, &start.angular_body);
    // Magnus: h w + h^2 w' / 2 + h^3 w'' / 6 + h^3 (w x w') / 12
    let rotation = angular * h + turn * square + growth.angular_body * sixth + angular.cross(turn) * (h * square / 6.0);
    let world_from_body =
        UnitQuaternion::new_normalize(state.world_from_body.quaternion() * from_scaled_axis(rotation).quaternion());
    let predicted = SimState {
        position_world: state.position_world,
        world_from_body,
        joint_position: std::array::from_fn(|i| {
            state.joint_position[i] + h * state.joint_velocity[i] + square * start.joint[i] + sixth * growth.joint[i]
        }),
        velocity_body: state.velocity_body + start.linear_body * h + growth.linear_body * (0.5 * h),
        angular_velocity_body: angular + turn * h + growth.angular_body * (0.5 * h),
        joint_velocity: std::array::from_fn(|i| {
            state.joint_velocity[i] + h * start.joint[i] + 0.5 * h * growth.joint[i]
        }),
    };
    let velocity = SpatialMotion { linear: state.velocity_body, angular: state.angular_velocity_body };
    let momentum = dynamics.momentum(&velocity, &state.joint_velocity);
    let com_body = dynamics.com_body();
    dynamics.update(model, &predicted, &model.rotor_inertia);
    let end = dynamics.acceleration(torque);

    // v + h (5 a' + 8 a - a_before) / 12 with a_before = a - h da/dt; without a step before, v + h (a + a') / 2.
    let joint_velocity = match before {
        Some(_) => std::array::from_fn::<f64, JOINTS, _>(|i| {
            let (a, a_end) = (start.joint[i], end.joint[i]);
            state.joint_velocity[i] + h / 12.0 * (5.0 * a_end + 7.0 * a + growth.joint[i])
        }),
        None => std::array::from_fn(|i| state.joint_velocity[i] + 0.5 * h * (start.joint[i] + end.joint[i])),
    };

    // Momentum and centre of mass, world.
    let mass = model.mass();
    let next_com_body = dynamics.com_body();
    let linear_world = state.world_from_body * momentum.linear;
    let angular_world = state.world_from_body * (momentum.angular - com_body.cross(&momentum.linear));
    let fall = Vector3::new(0.0, 0.0, -GRAVITY * h);
    let com_world = state.position_world + state.world_from_body * com_body + (linear_world / mass + fall * 0.5) * h;
    let linear = world_from_body.inverse_transform_vector(&(linear_world + fall * mass));
    let angular = world_from_body.inverse_transform_vector(&angular_world) + next_com_body.cross(&linear);
    let velocity = dynamics.trunk_velocity(&SpatialForce { linear, angular }, &joint_velocity);

    *state = SimState {
        position_world: com_world - world_from_body * next_com_body,
        velocity_body: velocity.linear,
        angular_velocity_body: velocity.angular,
        joint_velocity,
        ..predicted
    };
    FlightMemory { start: *start, end, h }
}
