//! The state of the simulated robot.

use nalgebra::{UnitQuaternion, Vector3};

use crate::robot::{JOINTS, Joints, PerLeg};

/// Position and velocity of every part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SimState {
    /// Position of the trunk's origin, world, m.
    pub position_world: Vector3<f64>,
    /// Rotation from body axes to world axes.
    pub world_from_body: UnitQuaternion<f64>,
    /// Joint angles, rad.
    pub joint_position: Joints,
    /// Velocity of the trunk's origin in body axes, m/s.
    pub velocity_body: Vector3<f64>,
    /// Angular velocity of the trunk in body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Joint velocities, rad/s.
    pub joint_velocity: Joints,
}

impl SimState {
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let vectors = [self.position_world, self.velocity_body, self.angular_velocity_body];
        vectors.iter().flat_map(|v| v.iter()).all(|x| x.is_finite())
            && self.world_from_body.coords.iter().all(|x| x.is_finite())
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

impl Acceleration {
    pub(super) const ZERO: Acceleration = Acceleration {
        linear_body: Vector3::new(0.0, 0.0, 0.0),
        angular_body: Vector3::new(0.0, 0.0, 0.0),
        joint: [0.0; JOINTS],
    };

    /// Returns the difference to `other`.
    pub(super) fn minus(&self, other: &Acceleration) -> Acceleration {
        Acceleration {
            linear_body: self.linear_body - other.linear_body,
            angular_body: self.angular_body - other.angular_body,
            joint: std::array::from_fn(|i| self.joint[i] - other.joint[i]),
        }
    }
}

/// Contact with the ground during one control period.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PeriodContacts {
    /// Whether each foot had a contact force in the last step that had any constraint.
    pub foot: PerLeg<bool>,
    /// Impulse on each foot over the period, world, N s.
    pub foot_impulse_world: PerLeg<Vector3<f64>>,
    /// Normal component of `foot_impulse_world`, out of the ground, N s.
    pub foot_normal_impulse: PerLeg<f64>,
    /// Whether a part whose contact is a sign of a fall had a contact force.
    pub body: bool,
}
