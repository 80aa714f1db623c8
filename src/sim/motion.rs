//! Velocities of the whole robot, and the data of one time step that collision detection and constraints share.

use nalgebra::{Matrix3, Vector3};

use super::dynamics::Dynamics;
use super::six::{Six, stack};
use super::state::SimState;
use super::terrain::Terrain;
use crate::robot::{LEGS, PerLeg, leg_of};

/// Leg index that stands for the trunk.
pub(super) const TRUNK: usize = LEGS;

/// Velocities of trunk (linear, angular; axes of the body at the start of the step) and joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GeneralizedVelocity {
    pub trunk: Six,
    pub legs: PerLeg<Vector3<f64>>,
}

impl GeneralizedVelocity {
    /// Velocity of `state`.
    pub fn of(state: &SimState) -> GeneralizedVelocity {
        GeneralizedVelocity {
            trunk: stack(&state.velocity_body, &state.angular_velocity_body),
            legs: std::array::from_fn(|leg| leg_of(&state.joint_velocity, leg)),
        }
    }
}

/// One time step before its constraint impulses are known.
pub(super) struct StepContext<'a> {
    pub dynamics: &'a Dynamics,
    pub state: &'a SimState,
    pub terrain: &'a Terrain,
    pub world_from_body: &'a Matrix3<f64>,
    /// Velocity at the start of the step.
    pub velocity: &'a GeneralizedVelocity,
    /// Velocity at the end of the step without constraint impulses.
    pub free_velocity: &'a GeneralizedVelocity,
    /// Length of the step, s.
    pub h: f64,
}
