//! Projected Gauss-Seidel over all constraint rows, started from the impulses of the last step (warm start).

use nalgebra::{Matrix3, Vector3};

use super::constraint::{ContactConstraint, ContactOnBlock, ImpulseSums, JointConstraint};
use super::law::{LocalProblem, into_cone, symmetric, symmetric_inverse};
use super::preparation::{ContactCandidate, ContactInput, LANES};
use super::sticking_leg::StickingLeg;
use crate::robot::{JOINTS, Joints, LEGS};
use crate::sim::config::{ContactConfig, ContactLaw, SolverConfig};
use crate::sim::dynamics::Dynamics;
use crate::sim::motion::{GeneralizedVelocity, StepContext};
use crate::sim::six::dot;
use crate::sim::terrain::LooseBlock;

/// Most contacts at a time; a robot that lies on blocks has about twenty. Contacts found beyond that are left out.
const MAX_CONTACTS: usize = 40;
/// Largest velocity with which a robot leaves ground that it is in: a state that is set there does not throw it.
const FASTEST_RECOVERY_M_S: f64 = 1.0;
/// The same where steps or fixed blocks have walls. A leg can be in two walls that face each other: no velocity leaves both, the impulses
/// grow with each sweep, and their friction makes energy. Of 200 tumbles without commands among blocks one had 44 times its energy with
/// 1 m/s; with 0.1 m/s, as without any recovery, none had more than 1.05 times. On other ground no contacts face each other.
const FASTEST_RECOVERY_AT_WALLS_M_S: f64 = 0.1;
/// A stop and a friction row per joint.
const MAX_JOINT_ROWS: usize = 2 * JOINTS;

/// Sweeps in which the limit of the floor's friction under a loose block follows the impulses on the block. With a fixed limit the
/// sweeps reduce one energy, and converge.
const FLOOR_SWEEPS: u32 = 10;

/// The constraints of one step, and the impulses of the last one.
#[derive(Debug, Clone)]
pub(in crate::sim) struct ContactSolver {
    config: SolverConfig,
    law: ContactLaw,
    slip_time_s: f64,
    /// Points near the ground that are no contacts yet, fewer than lanes.
    candidates: Vec<ContactCandidate>,
    /// Memory for the contacts; the first `contact_count` are those of this step.
    contacts: Vec<ContactConstraint>,
    contact_count: usize,
    joint_rows: Vec<JointConstraint>,
    sticking_legs: Vec<StickingLeg>,
    on_blocks: Vec<ContactOnBlock>,
    /// Loose blocks under the contacts.
    loose_blocks: Vec<LooseBlock>,
    /// Impulses of the last step in world axes, by [`ContactCandidate::warm_start_slot`].
    warm_start: Vec<Option<Vector3<f64>>>,
    /// Slots of `warm_start` that hold an impulse.
    warm_slots: Vec<usize>,
    /// Impulses of the joints' dry friction in the last step, N m s.
    friction_warm_start: Joints,
    /// Share of a slip velocity that the convex law keeps over this step.
    kept_slip: f64,
}

impl ContactSolver {
    pub fn new(config: SolverConfig, contact: &ContactConfig, warm_start_slots: usize) -> ContactSolver {
        ContactSolver {
            config,
            candidates: Vec::with_capacity(LANES),
            contacts: vec![ContactConstraint::new(contact.law); MAX_CONTACTS + LANES],
            contact_count: 0,
            joint_rows: Vec::with_capacity(MAX_JOINT_ROWS),
            sticking_legs: Vec::with_capacity(LEGS),
            on_blocks: Vec::with_capacity(MAX_CONTACTS),
            loose_blocks: Vec::with_capacity(MAX_CONTACTS),
            warm_start: vec![None; warm_start_slots],
            warm_slots: Vec::with_capacity(MAX_CONTACTS),
            friction_warm_start: [0.0; JOINTS],
            law: contact.law,
            slip_time_s: contact.slip_time_s,
            kept_slip: 0.0,
        }
    }

    /// Removes all constraints and warm-start impulses.
    pub fn reset(&mut self) {
        self.clear();
        self.warm_start.fill(None);
        self.warm_slots.clear();
        self.friction_warm_start = [0.0; JOINTS];
    }

    /// Starts a step of `h` seconds.
    pub fn start(&mut self, h: f64) {
        self.clear();
        self.kept_slip = if self.slip_time_s > 0.0 { libm::exp(-h / self.slip_time_s) } else { 0.0 };
    }

    fn clear(&mut self) {
        self.contact_count = 0;
        self.joint_rows.clear();
        self.on_blocks.clear();
        self.loose_blocks.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.contact_count == 0 && self.joint_rows.is_empty()
    }

    /// The contacts of this step; their impulses are those of the last step until [`ContactSolver::solve`].
    pub fn contacts(&self) -> &[ContactConstraint] {
        &self.contacts[..self.contact_count]
    }

    /// The loose blocks under these contacts; they have the velocity of the end of the step after [`ContactSolver::solve`].
    pub fn loose_blocks(&self) -> &[LooseBlock] {
        &self.loose_blocks
    }

    /// Part of the right-hand side that a gap adds, from gap + h v >= 0, m/s or rad/s. Of a penetration only a share is
    /// recovered per step, with at most `fastest`.
    #[inline]
    pub fn gap_velocity(&self, gap: f64, fastest: f64, h: f64) -> f64 {
        let share = if gap > 0.0 { 1.0 } else { self.config.penetration_recovery };
        (share * gap / h).max(-fastest)
    }

    /// Adds a point near the ground; [`ContactSolver::add_contacts`] takes the last ones.
    pub fn add_candidate(&mut self, step: &StepContext, candidate: ContactCandidate) {
        self.candidates.push(candidate);
        if self.candidates.len() == LANES {
            self.add_contacts(step);
        }
    }

    /// Adds the contacts of the candidates whose gap can close within the step.
    pub fn add_contacts(&mut self, step: &StepContext) {
        if self.candidates.is_empty() {
            return;
        }
        // Lanes without a candidate repeat the first one.
        let candidates: [&ContactCandidate; LANES] =
            std::array::from_fn(|i| self.candidates.get(i).unwrap_or(&self.candidates[0]));
        let ground_velocity = |block| step.terrain.block_velocity(block);
        let fastest = if step.terrain.has_fixed_walls() { FASTEST_RECOVERY_AT_WALLS_M_S } else { FASTEST_RECOVERY_M_S };
        let input = ContactInput {
            law: self.law,
            ground_velocity_world: candidates.map(|c| c.ground.block.map_or(Vector3::zeros(), ground_velocity)),
            warm_start_world: candidates.map(|c| self.warm_start[c.warm_start_slot].unwrap_or_default()),
            gap_velocity: candidates.map(|c| self.gap_velocity(c.ground.gap, fastest, step.h)),
            kept_slip: match self.law {
                ContactLaw::Coulomb => 0.0,
                ContactLaw::Convex => self.kept_slip,
            },
            candidates,
        };
        // There is room for them behind the last contact.
        let first = self.contact_count;
        let Some(rows) = self.contacts[first..].first_chunk_mut::<LANES>() else { return self.candidates.clear() };
        let closest_gap = input.prepare(step, rows);
        for (lane, gap) in closest_gap.into_iter().enumerate().take(self.candidates.len()) {
            if gap <= 0.0 && self.contact_count < MAX_CONTACTS {
                self.keep_contact(step, lane, first + lane);
            }
        }
        self.candidates.clear();
    }

    /// Takes the prepared contact `prepared` of the candidate `lane` as the next one.
    fn keep_contact(&mut self, step: &StepContext, lane: usize, prepared: usize) {
        let ContactCandidate { leg, warm_start_slot, ground, .. } = self.candidates[lane];
        let next = self.contact_count;
        if next != prepared {
            self.contacts[next] = self.contacts[prepared];
        }
        let contact = &mut self.contacts[next];
        contact.leg = leg;
        contact.warm_start_slot = warm_start_slot;
        contact.impulse = into_cone(&contact.impulse, ground.friction);
        let (axes_body, delassus) = (contact.axes_body, contact.local.delassus);
        let on_block = ground.block.map(|block| self.add_on_block(step, block, axes_body, delassus, ground.friction));
        self.contacts[next].on_block = on_block;
        self.contact_count += 1;
    }

    /// Adds the part of a contact that concerns its loose block `index`; returns its index.
    fn add_on_block(
        &mut self,
        step: &StepContext,
        index: usize,
        axes_body: Matrix3<f64>,
        delassus: Matrix3<f64>,
        friction: f64,
    ) -> usize {
        let block = self.loose_blocks.iter().position(|block| block.index == index).unwrap_or_else(|| {
            self.loose_blocks.push(step.terrain.loose_block(index, step.h));
            self.loose_blocks.len() - 1
        });
        let axes_world = step.world_from_body * axes_body;
        // A block moves in the world's horizontal plane.
        let horizontal = axes_world.fixed_rows::<2>(0);
        let with_block = delassus + horizontal.tr_mul(&horizontal) * self.loose_blocks[block].mobility();
        let m = &with_block;
        let inverse = symmetric(symmetric_inverse([m.m11, m.m12, m.m13, m.m22, m.m23, m.m33]));
        let sliding = LocalProblem::new(self.law, friction, with_block, inverse);
        self.on_blocks.push(ContactOnBlock { block, axes_world, sliding });
        self.on_blocks.len() - 1
    }

    /// Adds the row of the stop of joint `joint` that pushes in the direction `sign`. `rhs` is the velocity in that direction, to
    /// be taken to zero or above.
    pub fn add_joint_stop(&mut self, step: &StepContext, joint: usize, sign: f64, rhs: f64) {
        self.add_joint(step, joint, sign, rhs, [0.0, f64::INFINITY]);
    }

    /// Adds the row of the dry friction of joint `joint`: it takes the velocity `rhs` to zero with an impulse of at most `most`,
    /// N m s.
    pub fn add_joint_friction(&mut self, step: &StepContext, joint: usize, rhs: f64, most: f64) {
        self.add_joint(step, joint, 1.0, rhs, [-most, most]);
        if let Some(row) = self.joint_rows.last_mut() {
            row.friction_of = Some(joint);
            row.impulse = self.friction_warm_start[joint].clamp(-most, most);
        }
    }

    fn add_joint(&mut self, step: &StepContext, joint: usize, sign: f64, rhs: f64, bounds: [f64; 2]) {
        let (leg, part) = (joint / 3, joint % 3);
        let factors = step.dynamics.leg_factors();
        let mut trunk_row = factors.gain_of(leg, part).map(|g| -sign * g);
        step.dynamics.factor.solve_lower(&mut trunk_row);
        let leg_row = factors.factor_column(leg, part) * sign;
        let delassus = dot(&trunk_row, &trunk_row) + leg_row.norm_squared();
        let [lowest, highest] = bounds;
        let (friction_of, impulse) = (None, 0.0);
        self.joint_rows.push(JointConstraint {
            leg,
            friction_of,
            trunk_row,
            leg_row,
            delassus,
            rhs,
            lowest,
            highest,
            impulse,
        });
    }

    /// Finds the legs that have dry friction, each with its first contact on ground that does not move.
    fn find_sticking_legs(&mut self) {
        self.sticking_legs.clear();
        for leg in 0..LEGS {
            let is_own = |contact: &ContactConstraint| contact.leg == leg && contact.on_block.is_none();
            let row = |part| self.joint_rows.iter().position(|row| row.friction_of == Some(3 * leg + part));
            if let (Some(a), Some(b), Some(c)) = (row(0), row(1), row(2))
                && let Some(contact) = self.contacts().iter().position(is_own)
            {
                self.sticking_legs.push(StickingLeg::new(contact, [a, b, c]));
            }
        }
    }

    /// Solves for all impulses; returns the change of velocity that they make.
    pub fn solve(&mut self, dynamics: &Dynamics, world_from_body: &Matrix3<f64>) -> GeneralizedVelocity {
        let mut sums = ImpulseSums { trunk: [0.0; 6], legs: [Vector3::zeros(); LEGS + 1] };
        self.find_sticking_legs();
        let contacts = &mut self.contacts[..self.contact_count];
        for contact in contacts.iter() {
            contact.add(&mut sums, &contact.impulse);
            if let Some(on_block) = contact.on_block.map(|i| &self.on_blocks[i]) {
                self.loose_blocks[on_block.block].push(&-(on_block.axes_world * contact.impulse));
            }
        }
        for row in &self.joint_rows {
            row.add(&mut sums, row.impulse);
        }
        for sweep in 0..self.config.max_sweeps {
            if sweep < FLOOR_SWEEPS {
                self.loose_blocks.iter_mut().for_each(LooseBlock::limit_floor_friction);
            }
            let mut change: f64 = 0.0;
            for leg in &mut self.sticking_legs {
                leg.solve(contacts, &mut self.joint_rows, &mut sums);
            }
            for contact in contacts.iter_mut() {
                let on_block = contact.on_block.map(|i| &mut self.on_blocks[i]);
                change = change.max(contact.solve(&mut sums, on_block, &mut self.loose_blocks));
            }
            for row in &mut self.joint_rows {
                let impulse = (row.impulse - row.velocity(&sums) / row.delassus).clamp(row.lowest, row.highest);
                let step = impulse - row.impulse;
                row.impulse = impulse;
                row.add(&mut sums, step);
                change = change.max((row.delassus * step).abs());
            }
            if change < self.config.tolerance_m_s {
                break;
            }
        }
        for slot in self.warm_slots.drain(..) {
            self.warm_start[slot] = None;
        }
        for contact in contacts.iter_mut() {
            contact.impulse_world = world_from_body * (contact.axes_body * contact.impulse);
            self.warm_start[contact.warm_start_slot] = Some(contact.impulse_world);
            self.warm_slots.push(contact.warm_start_slot);
        }
        for row in &self.joint_rows {
            if let Some(joint) = row.friction_of {
                self.friction_warm_start[joint] = row.impulse;
            }
        }
        // dv_0 = L^-T y_0,  ddq_l = C^-T y_l - G dv_0
        let mut trunk = sums.trunk;
        dynamics.factor.solve_upper(&mut trunk);
        let [fr, fl, rr, rl, _] = sums.legs;
        let legs = dynamics.joint_change(&[fr, fl, rr, rl], &trunk);
        GeneralizedVelocity { trunk, legs }
    }
}
