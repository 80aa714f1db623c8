//! The state of the simulated robot.

use nalgebra::{UnitQuaternion, Vector3};

use crate::robot::{JOINTS, Joints};

/// Position and velocity of every part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimState {
    /// Position of the trunk's origin, world, m.
    pub position_world: Vector3<f64>,
    /// Rotation from body axes to world axes.
    pub orientation_world: UnitQuaternion<f64>,
    /// Joint angles, rad.
    pub joint_position: Joints,
    /// Velocity of the trunk's origin in body axes, m/s.
    pub velocity_body: Vector3<f64>,
    /// Angular velocity of the trunk in body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Joint velocities, rad/s.
    pub joint_velocity: Joints,
}

impl Default for SimState {
    fn default() -> Self {
        SimState {
            position_world: Vector3::zeros(),
            orientation_world: UnitQuaternion::identity(),
            joint_position: [0.0; JOINTS],
            velocity_body: Vector3::zeros(),
            angular_velocity_body: Vector3::zeros(),
            joint_velocity: [0.0; JOINTS],
        }
    }
}

impl SimState {
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let vectors = [self.position_world, self.velocity_body, self.angular_velocity_body];
        vectors.iter().flat_map(|v| v.iter()).all(|x| x.is_finite())
            && self.orientation_world.coords.iter().all(|x| x.is_finite())
            && self.joint_position.iter().chain(&self.joint_velocity).all(|x| x.is_finite())
    }
}

/// Rates of change of the velocities: of the trunk's body-frame components (Featherstone's spatial acceleration) and of
/// the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acceleration {
    /// d/dt of `velocity_body`'s components, m/s^2.
    pub linear_body: Vector3<f64>,
    /// d/dt of `angular_velocity_body`, rad/s^2.
    pub angular_body: Vector3<f64>,
    /// Joint accelerations, rad/s^2.
    pub joint: Joints,
}
