//! Constraint rows of a step: three of a contact, one of a joint's stop or dry friction.

use nalgebra::{Matrix3, Vector3};

use super::law::LocalProblem;
use crate::robot::LEGS;
use crate::sim::config::ContactLaw;
use crate::sim::six::{Six, add_scaled, dot};
use crate::sim::terrain::LooseBlock;

/// Three constraint rows of one contact: normal, tangent, tangent.
#[derive(Debug, Clone, Copy)]
pub(in crate::sim) struct ContactConstraint {
    /// Leg of the point, or [`crate::sim::motion::TRUNK`].
    pub leg: usize,
    /// Index of its warm-start impulse.
    pub warm_start_slot: usize,
    /// Index of its block in the solver's list, if that is loose.
    pub on_block: Option<usize>,
    /// Columns normal, two tangents, body axes.
    pub axes_body: Matrix3<f64>,
    /// W.
    pub trunk_rows: [Six; 3],
    /// U; zero for the trunk.
    pub leg_rows: Matrix3<f64>,
    /// Right-hand side: velocity without impulses, less the velocity that may remain after the step.
    pub rhs: Vector3<f64>,
    pub(super) local: LocalProblem,
    /// Normal, tangent, tangent, N s.
    pub impulse: Vector3<f64>,
    /// Impulse of the ground on the robot, world, N s; known after the solver has run.
    pub impulse_world: Vector3<f64>,
}

/// A contact whose ground is a loose block.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactOnBlock {
    /// Index in the solver's list.
    pub block: usize,
    /// Columns normal, two tangents, world.
    pub axes_world: Matrix3<f64>,
    /// The contact while the block slides; [`ContactConstraint::local`] is the contact with a block at rest.
    pub sliding: LocalProblem,
}

/// The constraint row of a joint's stop or dry friction: an impulse between two bounds.
#[derive(Debug, Clone, Copy)]
pub(super) struct JointConstraint {
    pub leg: usize,
    /// Joint of a friction row, whose impulse is kept for the next step; none for a stop.
    pub friction_of: Option<usize>,
    pub trunk_row: Six,
    pub leg_row: Vector3<f64>,
    /// Diagonal element of the Delassus matrix.
    pub delassus: f64,
    /// Right-hand side, as for a contact.
    pub rhs: f64,
    pub lowest: f64,
    pub highest: f64,
    pub impulse: f64,
}

/// y_0 = sum W^T p and y_l = sum U^T p; the last leg stands for the trunk and stays zero.
pub(super) struct ImpulseSums {
    pub trunk: Six,
    pub legs: [Vector3<f64>; LEGS + 1],
}

impl JointConstraint {
    /// Velocity less the velocity that may remain.
    #[inline]
    pub fn velocity(&self, sums: &ImpulseSums) -> f64 {
        self.rhs + dot(&self.trunk_row, &sums.trunk) + self.leg_row.dot(&sums.legs[self.leg])
    }

    /// Adds the impulse `p` to the sums.
    #[inline]
    pub fn add(&self, sums: &mut ImpulseSums, p: f64) {
        add_scaled(&mut sums.trunk, &self.trunk_row, p);
        sums.legs[self.leg] += self.leg_row * p;
    }
}

impl ContactConstraint {
    /// Memory for a contact under `law`.
    pub(super) fn new(law: ContactLaw) -> ContactConstraint {
        ContactConstraint {
            leg: 0,
            warm_start_slot: 0,
            on_block: None,
            axes_body: Matrix3::identity(),
            trunk_rows: [[0.0; 6]; 3],
            leg_rows: Matrix3::zeros(),
            rhs: Vector3::zeros(),
            local: LocalProblem::new(law, 0.0, Matrix3::identity(), Matrix3::identity()),
            impulse: Vector3::zeros(),
            impulse_world: Vector3::zeros(),
        }
    }

    /// Velocity less the velocity that may remain: W y_0 + U y_l + rhs.
    #[inline]
    pub(super) fn velocity(&self, sums: &ImpulseSums) -> Vector3<f64> {
        let [w1, w2, w3] = &self.trunk_rows;
        let trunk = Vector3::new(dot(w1, &sums.trunk), dot(w2, &sums.trunk), dot(w3, &sums.trunk));
        self.rhs + trunk + self.leg_rows * sums.legs[self.leg]
    }

    /// Solves for the impulse with all others fixed; returns the change of the velocity that it makes, m/s.
    #[inline]
    pub(super) fn solve(
        &mut self,
        sums: &mut ImpulseSums,
        on_block: Option<&mut ContactOnBlock>,
        loose_blocks: &mut [LooseBlock],
    ) -> f64 {
        let velocity = self.velocity(sums);
        let Some(ContactOnBlock { block, axes_world, sliding }) = on_block else {
            let (impulse, change) = self.local.solve(&velocity, &self.impulse);
            self.set_impulse(sums, &impulse);
            return change;
        };
        let block = &mut loose_blocks[*block];
        let push = |impulse: &Vector3<f64>| *axes_world * (self.impulse - impulse);
        // The impulse on a block at rest, if the block rests under it; otherwise that on a block with the floor's present friction.
        let (mut impulse, mut change) =
            self.local.solve(&(velocity - axes_world.tr_mul(&block.stop_world())), &self.impulse);
        if !block.rests_with(&push(&impulse)) {
            let velocity = velocity - axes_world.tr_mul(&block.velocity_change_world());
            (impulse, change) = sliding.solve(&velocity, &self.impulse);
        }
        block.push(&push(&impulse));
        self.set_impulse(sums, &impulse);
        change
    }

    #[inline]
    fn set_impulse(&mut self, sums: &mut ImpulseSums, impulse: &Vector3<f64>) {
        self.add(sums, &(impulse - self.impulse));
        self.impulse = *impulse;
    }

    /// Adds the impulse `p` to the sums.
    #[inline]
    pub(super) fn add(&self, sums: &mut ImpulseSums, p: &Vector3<f64>) {
        for (row, p) in self.trunk_rows.iter().zip(p.iter()) {
            add_scaled(&mut sums.trunk, row, *p);
        }
        sums.legs[self.leg] += self.leg_rows.tr_mul(p);
    }

    /// Normal component of the impulse, out of the ground, N s.
    pub fn normal_impulse(&self) -> f64 {
        self.impulse.x
    }
}
