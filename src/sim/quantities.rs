//! Quantities of a model at a state: accelerations, mass matrix, momentum, energy, feet. For tests and benches; the
//! time step uses [`super::dynamics`] directly.
//!
//! Velocity vectors of 18 are ordered: linear velocity of the trunk's origin (body axes), angular velocity (body axes),
//! joints.

use nalgebra::{SMatrix, SVector, Vector3};

use super::dynamics::{Dynamics, columns};
use super::model::RobotModel;
use super::spatial::{SpatialForce, SpatialMotion};
use super::state::{Acceleration, SimState};
use crate::robot::{GRAVITY, JOINTS, Joints, LEGS, PerLeg, leg_of};

/// Degrees of freedom: six of the trunk and twelve joints.
pub const DOF: usize = 6 + JOINTS;

/// Momentum of the whole robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Momentum {
    /// Position of the centre of mass, world, m.
    pub com_world: Vector3<f64>,
    /// Velocity of the centre of mass, world, m/s.
    pub com_velocity_world: Vector3<f64>,
    /// Angular momentum about the centre of mass, world axes, kg m^2/s.
    pub angular_world: Vector3<f64>,
}

/// Energy of the whole robot, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Kinetic energy, with that of the rotors.
    pub kinetic: f64,
    /// Potential energy; zero with the centre of mass at z = 0.
    pub potential: f64,
}

impl Energy {
    /// Sum of kinetic and potential energy, J.
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential
    }
}

/// Position, velocity and Jacobian of the centre of a foot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootKinematics {
    /// Position, world, m.
    pub position_world: Vector3<f64>,
    /// Velocity, world, m/s.
    pub velocity_world: Vector3<f64>,
    /// Jacobian with respect to the 18 velocities, world.
    pub jacobian_world: SMatrix<f64, 3, DOF>,
}

impl RobotModel {
    fn dynamics(&self, state: &SimState) -> Dynamics {
        Dynamics::new(self, state, &self.rotor_inertia)
    }

    /// Returns the accelerations under the joint torques `torque` (N m) and gravity, without contact, friction or joint
    /// stops.
    pub fn forward_dynamics(&self, state: &SimState, torque: &Joints) -> Acceleration {
        self.dynamics(state).acceleration(torque)
    }

    /// M(q): kg, kg m, kg m^2.
    pub fn mass_matrix(&self, state: &SimState) -> SMatrix<f64, DOF, DOF> {
        let dynamics = self.dynamics(state);
        let mut matrix = SMatrix::<f64, DOF, DOF>::zeros();
        let composite = SMatrix::<f64, 6, 6>::from(columns(&dynamics.composite));
        matrix.fixed_view_mut::<6, 6>(0, 0).copy_from(&composite);
        for l in 0..LEGS {
            let j = 6 + 3 * l;
            let coupling = SMatrix::<f64, 6, 3>::from(dynamics.coupling(l));
            matrix.fixed_view_mut::<6, 3>(0, j).copy_from(&coupling);
            matrix.fixed_view_mut::<3, 6>(j, 0).copy_from(&coupling.transpose());
            matrix.fixed_view_mut::<3, 3>(j, j).copy_from(&dynamics.leg_mass(l));
        }
        for (i, rotor) in self.rotor_inertia.iter().enumerate() {
            matrix[(6 + i, 6 + i)] += rotor;
        }
        matrix
    }

    /// b(q, v): velocity and gravity terms of M a + b = [0; tau]. N, N m.
    pub fn bias(&self, state: &SimState) -> SVector<f64, DOF> {
        let dynamics = self.dynamics(state);
        let mut bias = SVector::<f64, DOF>::zeros();
        bias.fixed_rows_mut::<6>(0).copy_from_slice(&dynamics.bias);
        bias.fixed_rows_mut::<JOINTS>(6).copy_from_slice(&dynamics.joint_bias());
        bias
    }

    /// Centre of mass, its velocity, and the angular momentum about it.
    pub fn momentum(&self, state: &SimState) -> Momentum {
        let dynamics = self.dynamics(state);
        let velocity = SpatialMotion { linear: state.velocity_body, angular: state.angular_velocity_body };
        let SpatialForce { linear, angular } = dynamics.momentum(&velocity, &state.joint_velocity);
        let mass = dynamics.composite.mass;
        let com_body = dynamics.com_body();
        let to_world = &state.world_from_body;
        Momentum {
            com_world: state.position_world + to_world * com_body,
            com_velocity_world: to_world * (linear / mass),
            // k_G = k_O - c x p
            angular_world: to_world * (angular - com_body.cross(&linear)),
        }
    }

    /// Kinetic and potential energy.
    pub fn energy(&self, state: &SimState) -> Energy {
        let mut v = SVector::<f64, DOF>::zeros();
        v.fixed_rows_mut::<3>(0).copy_from(&state.velocity_body);
        v.fixed_rows_mut::<3>(3).copy_from(&state.angular_velocity_body);
        v.fixed_rows_mut::<JOINTS>(6).copy_from_slice(&state.joint_velocity);
        Energy {
            // T = v^T M v / 2,  V = m g z
            kinetic: 0.5 * v.dot(&(self.mass_matrix(state) * v)),
            potential: self.mass() * GRAVITY * self.momentum(state).com_world.z,
        }
    }

    /// Motion of the centres of the feet.
    pub fn feet(&self, state: &SimState) -> PerLeg<FootKinematics> {
        let dynamics = self.dynamics(state);
        let legs = dynamics.legs();
        let to_world = state.world_from_body.to_rotation_matrix().into_inner();
        std::array::from_fn::<_, LEGS, _>(|l| {
            let leg = &legs[l];
            let foot_body = leg.in_body(2, &self.foot_origin[l]);
            let joints = leg.calf_jacobian(&foot_body);
            // Velocity of a point p of the trunk: v + w x p.
            let mut jacobian_world = SMatrix::<f64, 3, DOF>::zeros();
            jacobian_world.fixed_view_mut::<3, 3>(0, 0).copy_from(&to_world);
            jacobian_world.fixed_view_mut::<3, 3>(0, 3).copy_from(&(to_world * -foot_body.cross_matrix()));
            jacobian_world.fixed_view_mut::<3, 3>(0, 6 + 3 * l).copy_from(&(to_world * joints));
            let velocity_body = state.velocity_body
                + state.angular_velocity_body.cross(&foot_body)
                + joints * leg_of(&state.joint_velocity, l);
            FootKinematics {
                position_world: state.position_world + to_world * foot_body,
                velocity_world: to_world * velocity_body,
                jacobian_world,
            }
        })
    }
}
