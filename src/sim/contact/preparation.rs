//! Constraint rows of up to four contacts at once, one per lane: the four feet of a robot that stands need one pass.

use fearless_simd::Simd;
use nalgebra::{Matrix3, Vector3};

use super::constraint::ContactConstraint;
use super::law::{LocalProblem, symmetric, symmetric_inverse};
use crate::robot::LEGS;
use crate::sim::config::ContactLaw;
use crate::sim::lanes::{Lanes, Quad, with_lanes};
use crate::sim::leg::{LegFactors, point_jacobian};
use crate::sim::motion::{GeneralizedVelocity, StepContext, TRUNK};
use crate::sim::six::{dot, stack};
use crate::sim::spatial::{AxisRotation, Real, cross, inner};
use crate::sim::terrain::TerrainContact;

/// Speed that impulses of the same step may add to a point, m/s.
pub(in crate::sim) const SPEED_MARGIN: f64 = 2.0;

/// Number of contacts that are prepared at once.
pub(super) const LANES: usize = LEGS;

/// A sphere of the robot that is near the ground.
#[derive(Debug, Clone, Copy)]
pub(in crate::sim) struct ContactCandidate {
    /// Leg of the sphere, or [`TRUNK`].
    pub leg: usize,
    /// Link of the leg: 0 hip, 1 thigh, 2 calf.
    pub link: usize,
    /// Index of its warm-start impulse.
    pub warm_start_slot: usize,
    /// Centre, body axes, m.
    pub center_body: Vector3<f64>,
    /// Radius, m.
    pub radius: f64,
    /// The ground under it.
    pub ground: TerrainContact,
}

/// Points whose rows are computed, and what of them is not in the step.
#[derive(Debug)]
pub(super) struct ContactInput<'a> {
    pub law: ContactLaw,
    pub candidates: [&'a ContactCandidate; LANES],
    /// Velocity of the ground, world, m/s.
    pub ground_velocity_world: [Vector3<f64>; LANES],
    /// Impulse of the last step, world, N s.
    pub warm_start_world: [Vector3<f64>; LANES],
    /// Part of the right-hand side that the gap adds, m/s.
    pub gap_velocity: [f64; LANES],
    /// Share of a slip velocity that the step keeps.
    pub kept_slip: f64,
}

impl ContactInput<'_> {
    /// Computes the rows of the points; the impulses are those of the last step. Returns the smallest gaps that the step can leave, m: a
    /// contact with a positive one cannot close.
    pub fn prepare(&self, step: &StepContext, contacts: &mut [ContactConstraint; LANES]) -> [f64; LANES] {
        with_lanes!(step.dynamics.instructions(), simd => self.evaluate(simd, step, contacts))
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        &self,
        simd: S,
        step: &StepContext,
        contacts: &mut [ContactConstraint; LANES],
    ) -> [f64; LANES] {
        let splat = |x: f64| Lanes::splat(simd, x);
        let candidates = &self.candidates;
        let number = |x: fn(&ContactCandidate) -> f64| Lanes::new(simd, [0, 1, 2, 3].map(|i| x(candidates[i])));
        // R^T v
        let rotation = step.world_from_body;
        let column = |j: usize| Vector3::new(splat(rotation[(0, j)]), splat(rotation[(1, j)]), splat(rotation[(2, j)]));
        let world_axes = [column(0), column(1), column(2)];

        let normal = components(&world_axes, &vectors(simd, candidates.map(|c| c.ground.normal_world)));
        let depth = number(|c| c.radius + c.ground.gap.min(0.0));
        let position = vectors(simd, candidates.map(|c| c.center_body)) - normal * depth;

        // A point of the trunk takes any leg, which does not move it.
        let legs: [usize; LANES] =
            std::array::from_fn(|i| if candidates[i].leg == TRUNK { i } else { candidates[i].leg });
        let picked;
        let factors = match legs == [0, 1, 2, 3] {
            true => step.dynamics.leg_factors(),
            false => {
                picked = step.dynamics.leg_factors().of_legs(legs);
                &picked
            }
        };
        let hip = AxisRotation::load(simd, factors.hip);
        let [o1, o2, o3] = &factors.origin_body;
        let origins = [Lanes::vector(simd, o1), Lanes::vector(simd, o2), Lanes::vector(simd, o3)];
        let [j1, j2, j3] = point_jacobian(hip, &origins, &position);
        let moves = |c: &ContactCandidate, joint: usize| if c.leg != TRUNK && c.link >= joint { 1.0 } else { 0.0 };
        let moved = [0, 1, 2].map(|joint| candidates.map(|c| moves(c, joint)));
        let jacobian =
            [j1 * Lanes::new(simd, moved[0]), j2 * Lanes::new(simd, moved[1]), j3 * Lanes::new(simd, moved[2])];

        let ground = components(&world_axes, &vectors(simd, self.ground_velocity_world));
        let free = velocity(simd, step.free_velocity, legs, &position, &jacobian) - ground;
        let approach = inner(&normal, &free) - splat(SPEED_MARGIN);
        let closest_gap = number(|c| c.ground.gap) + splat(step.h) * approach;

        let axes = axes_about(simd, &normal);
        let mut rhs = components(&axes, &free);
        rhs.x += Lanes::new(simd, self.gap_velocity);
        if self.kept_slip != 0.0 {
            let before = components(&axes, &(velocity(simd, step.velocity, legs, &position, &jacobian) - ground));
            rhs.y -= splat(self.kept_slip) * before.y;
            rhs.z -= splat(self.kept_slip) * before.z;
        }
        let row = |axis: usize| AxisRow::new(simd, step, factors, &axes[axis], &position, &jacobian);
        let rows = [row(0), row(1), row(2)];
        let [r1, r2, r3] = &rows;
        let delassus = [r1.times(r1), r1.times(r2), r1.times(r3), r2.times(r2), r2.times(r3), r3.times(r3)];
        let warm_start = components(&world_axes, &vectors(simd, self.warm_start_world));
        let impulse = components(&axes, &warm_start);
        self.write(axes, &rows, delassus, &rhs, &impulse, contacts);
        closest_gap.store().0
    }

    /// Distributes the results to the contacts.
    #[inline(always)]
    fn write<S: Simd>(
        &self,
        axes: [Vector3<Lanes<S>>; 3],
        rows: &[AxisRow<Lanes<S>>; 3],
        delassus: [Lanes<S>; 6],
        rhs: &Vector3<Lanes<S>>,
        impulse: &Vector3<Lanes<S>>,
        contacts: &mut [ContactConstraint; LANES],
    ) {
        let inverse = store(&symmetric_inverse(delassus));
        let delassus = store(&delassus);
        let (rhs, impulse) = (store_vector(rhs), store_vector(impulse));
        let axes = [store_vector(&axes[0]), store_vector(&axes[1]), store_vector(&axes[2])];
        let trunk_rows = [store(&rows[0].trunk), store(&rows[1].trunk), store(&rows[2].trunk)];
        let leg_rows = [store(&rows[0].leg), store(&rows[1].leg), store(&rows[2].leg)];
        for (lane, contact) in contacts.iter_mut().enumerate() {
            let at = |x: &Quad| x.0[lane];
            let vector = |v: &Vector3<Quad>| Vector3::new(at(&v.x), at(&v.y), at(&v.z));
            let matrix = |m: &[Quad; 6]| symmetric([at(&m[0]), at(&m[1]), at(&m[2]), at(&m[3]), at(&m[4]), at(&m[5])]);
            contact.axes_body = Matrix3::from_columns(&[vector(&axes[0]), vector(&axes[1]), vector(&axes[2])]);
            for (to, row) in contact.trunk_rows.iter_mut().zip(&trunk_rows) {
                for (to, x) in to.iter_mut().zip(row) {
                    *to = at(x);
                }
            }
            let [u1, u2, u3] = &leg_rows;
            let [u1, u2, u3] = [u1, u2, u3].map(|u| [at(&u[0]), at(&u[1]), at(&u[2])]);
            contact.leg_rows = Matrix3::from([u1, u2, u3]).transpose();
            contact.rhs = vector(&rhs);
            contact.impulse = vector(&impulse);
            let friction = self.candidates[lane].ground.friction;
            contact.local = LocalProblem::new(self.law, friction, matrix(&delassus), matrix(&inverse));
        }
    }
}

/// Constraint row along one axis of a contact.
struct AxisRow<T> {
    /// W = (J_0 - J_l G) L^-T.
    trunk: [T; 6],
    /// U = J_l C^-T.
    leg: [T; 3],
}

impl<S: Simd> AxisRow<Lanes<S>> {
    #[inline(always)]
    fn new(
        simd: S,
        step: &StepContext,
        factors: &LegFactors<Quad>,
        axis: &Vector3<Lanes<S>>,
        position: &Vector3<Lanes<S>>,
        jacobian: &[Vector3<Lanes<S>>; 3],
    ) -> Self {
        // Row of J_0: axis . (v + w x p) = axis . v + (p x axis) . w
        let mut trunk = stack(axis, &cross(position, axis));
        let along = [inner(axis, &jacobian[0]), inner(axis, &jacobian[1]), inner(axis, &jacobian[2])];
        for (gain, along) in factors.gain.iter().zip(along) {
            for (row, gain) in trunk.iter_mut().zip(gain) {
                *row -= Lanes::load(simd, *gain) * along;
            }
        }
        step.dynamics.factor.solve_lower(&mut trunk);
        let [i11, i21, i22, i31, i32, i33] = &factors.factor_inverse;
        let [i11, i21, i22] = [Lanes::load(simd, *i11), Lanes::load(simd, *i21), Lanes::load(simd, *i22)];
        let [i31, i32, i33] = [Lanes::load(simd, *i31), Lanes::load(simd, *i32), Lanes::load(simd, *i33)];
        let [a1, a2, a3] = along;
        AxisRow { trunk, leg: [a1 * i11, a1 * i21 + a2 * i22, a1 * i31 + a2 * i32 + a3 * i33] }
    }

    /// An element of the Delassus matrix: w . w' + u . u'.
    #[inline(always)]
    fn times(&self, other: &Self) -> Lanes<S> {
        let (u, v) = (&self.leg, &other.leg);
        dot(&self.trunk, &other.trunk) + (u[0] * v[0] + u[1] * v[1] + u[2] * v[2])
    }
}

/// Returns the velocities of points at `position` on `legs`, body axes: v + w x p + J_l dq.
#[inline(always)]
fn velocity<S: Simd>(
    simd: S,
    v: &GeneralizedVelocity,
    legs: [usize; LANES],
    position: &Vector3<Lanes<S>>,
    jacobian: &[Vector3<Lanes<S>>; 3],
) -> Vector3<Lanes<S>> {
    let trunk = |i: usize| Lanes::splat(simd, v.trunk[i]);
    let linear = Vector3::new(trunk(0), trunk(1), trunk(2));
    let angular = Vector3::new(trunk(3), trunk(4), trunk(5));
    let rates = vectors(simd, legs.map(|leg| v.legs[leg]));
    let leg = jacobian[0] * rates.x + jacobian[1] * rates.y + jacobian[2] * rates.z;
    linear + cross(&angular, position) + leg
}

/// Takes one vector per lane.
#[inline(always)]
fn vectors<S: Simd>(simd: S, v: [Vector3<f64>; LANES]) -> Vector3<Lanes<S>> {
    let component = |i: usize| Lanes::new(simd, [v[0][i], v[1][i], v[2][i], v[3][i]]);
    Vector3::new(component(0), component(1), component(2))
}

#[inline(always)]
fn store_vector<S: Simd>(v: &Vector3<Lanes<S>>) -> Vector3<Quad> {
    Vector3::new(v.x.store(), v.y.store(), v.z.store())
}

#[inline(always)]
fn store<S: Simd, const N: usize>(lanes: &[Lanes<S>; N]) -> [Quad; N] {
    let mut quads = [Quad::ZERO; N];
    for (quad, lanes) in quads.iter_mut().zip(lanes) {
        *quad = lanes.store();
    }
    quads
}

/// Components of `v` along three axes.
#[inline(always)]
fn components<T: Real>(axes: &[Vector3<T>; 3], v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(inner(&axes[0], v), inner(&axes[1], v), inner(&axes[2], v))
}

/// Returns the normal and two tangents (Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017).
#[inline(always)]
fn axes_about<S: Simd>(simd: S, n: &Vector3<Lanes<S>>) -> [Vector3<Lanes<S>>; 3] {
    let one = Lanes::splat(simd, 1.0);
    let sign = one.copysign(n.z);
    let a = -one / (sign + n.z);
    let b = n.x * n.y * a;
    [*n, Vector3::new(one + sign * n.x * n.x * a, sign * b, -sign * n.x), Vector3::new(b, sign + n.y * n.y * a, -n.y)]
}
