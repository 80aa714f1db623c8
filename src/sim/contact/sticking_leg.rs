//! The rows of a leg that sticks, solved at once.

use nalgebra::Vector3;

use super::constraint::{ContactConstraint, ImpulseSums, JointConstraint};
use crate::sim::six::{Cholesky6, Six, dot};

/// A leg with a contact and dry friction in its joints. While the contact and at least one joint stick, their rows are solved at once:
/// a leg is light beside the trunk, and one row after the other such rows take dozens of sweeps to agree.
#[derive(Debug, Clone)]
pub(super) struct StickingLeg {
    /// Index of its contact.
    contact: usize,
    /// Indices of the friction rows of its joints.
    rows: [usize; 3],
    /// Which of these rows stick: their impulses are within the bounds.
    sticks: [bool; 3],
    /// Factor of the Delassus matrix of the contact and the rows that stick; 1 on the diagonal for the others.
    factor: Cholesky6,
}

impl StickingLeg {
    /// The leg with these indices of its contact and of the friction rows of its joints.
    pub fn new(contact: usize, rows: [usize; 3]) -> StickingLeg {
        StickingLeg { contact, rows, sticks: [false; 3], factor: Cholesky6::IDENTITY }
    }

    /// Takes the velocities of the rows that stick to zero. Changes nothing if that takes an impulse out of its bounds: the sweep
    /// finds out what slides.
    pub fn solve(
        &mut self,
        contacts: &mut [ContactConstraint],
        joint_rows: &mut [JointConstraint],
        sums: &mut ImpulseSums,
    ) {
        let contact = &mut contacts[self.contact];
        let rows = self.rows.map(|row| joint_rows[row]);
        let sticks = rows.each_ref().map(|row| row.lowest < row.impulse && row.impulse < row.highest);
        if sticks == [false; 3] || contact.impulse.x <= 0.0 || !contact.local.holds(&contact.impulse) {
            return;
        }
        if sticks != self.sticks {
            self.sticks = sticks;
            self.factor = Cholesky6::new(sticking_delassus(contact, &rows, &sticks));
        }
        let v = contact.velocity(sums);
        let row_velocity = |i: usize| if sticks[i] { -rows[i].velocity(sums) } else { 0.0 };
        let mut step = [-v.x, -v.y, -v.z, row_velocity(0), row_velocity(1), row_velocity(2)];
        self.factor.solve_lower(&mut step);
        self.factor.solve_upper(&mut step);
        let contact_step = Vector3::new(step[0], step[1], step[2]);
        let within = |(row, step): (&JointConstraint, &f64)| (row.lowest..=row.highest).contains(&(row.impulse + step));
        if !contact.local.holds(&(contact.impulse + contact_step)) || !rows.iter().zip(&step[3..]).all(within) {
            return;
        }
        contact.impulse += contact_step;
        contact.add(sums, &contact_step);
        for (row, step) in self.rows.iter().zip(&step[3..]) {
            joint_rows[*row].impulse += step;
            joint_rows[*row].add(sums, *step);
        }
    }
}

/// Delassus matrix of a contact and the friction rows of its leg that stick, lower triangle by columns; 1 on the diagonal of the others.
fn sticking_delassus(contact: &ContactConstraint, rows: &[JointConstraint; 3], sticks: &[bool; 3]) -> [Six; 6] {
    let ([w1, w2, w3], u) = (contact.trunk_rows, contact.leg_rows.transpose());
    let trunk_rows = [w1, w2, w3, rows[0].trunk_row, rows[1].trunk_row, rows[2].trunk_row];
    let leg_rows: [Vector3<f64>; 6] =
        [u.column(0).into(), u.column(1).into(), u.column(2).into(), rows[0].leg_row, rows[1].leg_row, rows[2].leg_row];
    let is_in = |row: usize| row < 3 || sticks[row - 3];
    let element = |i: usize, j: usize| match i >= j && is_in(i) && is_in(j) {
        true => dot(&trunk_rows[i], &trunk_rows[j]) + leg_rows[i].dot(&leg_rows[j]),
        false => f64::from(i == j),
    };
    std::array::from_fn(|j| std::array::from_fn(|i| element(i, j)))
}
