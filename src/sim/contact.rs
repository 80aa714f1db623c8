//! Rigid unilateral contacts with Coulomb's cone, joint stops and dry joint friction, all solved together.
//!
//! Unknown are the impulses of one step. For every contact: 0 <= impulse_n, 0 <= gap after the step, one of them zero
//! (Signorini, at the level of the position reached); and |impulse_t| <= mu impulse_n, opposed to the sliding velocity
//! where there is any (Coulomb). A Gauss-Seidel sweep goes from contact to contact and solves each one exactly with the
//! others held: Hwangbo, Lee, Hutter, "Per-contact iteration method for solving contact dynamics", IEEE RA-L 3(2),
//! 2018. Where that paper bisects for the impulse of most dissipation, the local problem here is Coulomb's law itself,
//! reduced to one scalar equation as in Bonnefon and Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA
//! RT-0400, 2011. The cone is never cut into a pyramid.
//!
//! With the factors of [`super::dynamics`] the Delassus matrix is J M^-1 J^T = W W^T + (within a leg) U U^T with
//! W = (J_0 - J_l G_l) L^-T and U = J_l C_l^-T. The sweep keeps the sums y_0 = sum W^T p and y_l = sum U^T p, so one visit costs the
//! same however many contacts there are.

use nalgebra::{Matrix3, Vector2, Vector3, Vector6};

use super::config::SolverConfig;
use super::dynamics::{Dynamics, Matrix3x6};
use super::quantities::stack;
use crate::robot::{JOINTS, Joints, LEGS, PerLeg};

/// Most contacts at a time; a robot lying on blocks has about twenty. Beyond that the latest found are left out until the
/// next step.
pub(super) const MAX_CONTACTS: usize = 40;
/// A stop and a friction row per joint.
const MAX_ROWS: usize = 2 * JOINTS;
/// Stands for the trunk where a leg's index is asked for.
pub(super) const TRUNK: usize = LEGS;

/// Velocities of trunk (linear, angular; axes of the body at the start of the step) and joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Velocity {
    pub trunk: Vector6<f64>,
    pub legs: PerLeg<Vector3<f64>>,
}

/// A point that touches or is about to.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactPoint {
    /// Which leg it is on; [`TRUNK`] for none.
    pub leg: usize,
    /// Which link of the leg: 0 hip, 1 thigh, 2 calf.
    pub link: usize,
    /// Where it remembers its impulse.
    pub memory: usize,
    /// The point, body axes, m.
    pub position_body: Vector3<f64>,
    /// Out of the ground, body axes.
    pub normal_body: Vector3<f64>,
    /// Distance to the ground at the start of the step, m; negative where it is inside.
    pub gap: f64,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Velocity of the ground there, body axes, m/s: not zero for a sliding block.
    pub ground_velocity_body: Vector3<f64>,
    /// Which loose block it is, for those who move it.
    pub block: Option<usize>,
}

/// One contact in the coordinates normal, tangent, tangent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    pub point: ContactPoint,
    /// Columns normal, two tangents, body axes.
    axes_body: Matrix3<f64>,
    /// W.
    trunk_rows: Matrix3x6,
    /// U; zero for the trunk.
    leg_rows: Matrix3<f64>,
    /// A = W W^T + U U^T and its inverse.
    local: Matrix3<f64>,
    local_inverse: Matrix3<f64>,
    /// Velocity without any impulse, less what may be left of it after the step.
    free: Vector3<f64>,
    /// Of Coulomb's equation; where the last search ended.
    slip: f64,
    impulse: Vector3<f64>,
}

/// One joint's stop or dry friction: an impulse between two bounds.
#[derive(Debug, Clone, Copy)]
struct Row {
    leg: usize,
    trunk_row: Vector6<f64>,
    leg_row: Vector3<f64>,
    local: f64,
    free: f64,
    lowest: f64,
    highest: f64,
    impulse: f64,
}

/// The contacts of one step, and the impulses of the last one to start from.
#[derive(Debug, Clone)]
pub(super) struct ContactSolver {
    config: SolverConfig,
    contacts: Vec<Contact>,
    rows: Vec<Row>,
    /// Impulses of the last step in world axes, by [`ContactPoint::memory`].
    memory: Vec<Vector3<f64>>,
}

impl ContactSolver {
    pub fn new(config: SolverConfig, memories: usize) -> ContactSolver {
        ContactSolver {
            config,
            contacts: Vec::with_capacity(MAX_CONTACTS),
            rows: Vec::with_capacity(MAX_ROWS),
            memory: vec![Vector3::zeros(); memories],
        }
    }

    /// Forgets the last step's impulses.
    pub fn reset(&mut self) {
        self.clear();
        self.memory.fill(Vector3::zeros());
    }

    /// Starts a step.
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.rows.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.contacts.is_empty() && self.rows.is_empty()
    }

    /// The contacts of this step, with their impulses once solved.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Adds a point; `world_from_body` turns its remembered impulse into place.
    pub fn add_point(
        &mut self,
        dynamics: &Dynamics,
        point: ContactPoint,
        free_velocity_body: &Vector3<f64>,
        world_from_body: &Matrix3<f64>,
        h: f64,
    ) {
        if self.contacts.len() == MAX_CONTACTS {
            return;
        }
        let axes_body = axes_about(&point.normal_body);
        // Rows of J: n . (v + w x p) = n . v + (p x n) . w, and the leg's part.
        let mut leg_jacobian = Matrix3::zeros();
        if point.leg != TRUNK {
            let leg = &dynamics.legs[point.leg];
            leg_jacobian = axes_body.tr_mul(&leg.point_jacobian(point.link, &point.position_body));
        }
        let mut trunk_rows = Matrix3x6::zeros();
        let mut leg_rows = Matrix3::zeros();
        for i in 0..3 {
            let axis: Vector3<f64> = axes_body.column(i).into();
            let mut row = stack(&axis, &point.position_body.cross(&axis));
            if point.leg != TRUNK {
                let leg = &dynamics.legs[point.leg];
                let u: Vector3<f64> = leg_jacobian.row(i).transpose();
                row -= leg.gain.tr_mul(&u);
                leg_rows.set_row(i, &(leg.factor_inverse * u).transpose());
            }
            trunk_rows.set_row(i, &dynamics.solve_lower(&row).transpose());
        }
        let local = trunk_rows * trunk_rows.transpose() + leg_rows * leg_rows.transpose();
        let mut free = axes_body.tr_mul(&(free_velocity_body - point.ground_velocity_body));
        // gap + h v_n >= 0; inside the ground a share of the way back per step.
        let share = if point.gap > 0.0 { 1.0 } else { self.config.penetration_recovery };
        free.x += share * point.gap / h;

        let remembered = axes_body.tr_mul(&world_from_body.tr_mul(&self.memory[point.memory]));
        let impulse = into_cone(&remembered, point.friction);
        self.contacts.push(Contact {
            point,
            axes_body,
            trunk_rows,
            leg_rows,
            local,
            local_inverse: local.try_inverse().unwrap_or_else(Matrix3::zeros),
            free,
            slip: 0.0,
            impulse,
        });
    }

    /// Adds a joint's stop or friction: the impulse that takes `free` to zero or above, between `lowest` and `highest`; `sign` is
    /// the direction in which it acts on the joint.
    pub fn add_joint(&mut self, dynamics: &Dynamics, joint: usize, sign: f64, free: f64, lowest: f64, highest: f64) {
        let (leg, part) = (joint / 3, joint % 3);
        let mut u = Vector3::zeros();
        u[part] = sign;
        let l = &dynamics.legs[leg];
        let trunk_row = dynamics.solve_lower(&-l.gain.tr_mul(&u));
        let leg_row = l.factor_inverse * u;
        let local = trunk_row.norm_squared() + leg_row.norm_squared();
        self.rows.push(Row { leg, trunk_row, leg_row, local, free, lowest, highest, impulse: 0.0 });
    }

    /// Solves for all impulses; returns the change of velocity that they make.
    pub fn solve(&mut self, dynamics: &Dynamics, world_from_body: &Matrix3<f64>) -> Velocity {
        let mut trunk = Vector6::zeros();
        let mut legs = [Vector3::zeros(); LEGS + 1];
        for contact in &self.contacts {
            trunk += contact.trunk_rows.tr_mul(&contact.impulse);
            legs[contact.point.leg] += contact.leg_rows.tr_mul(&contact.impulse);
        }
        for _ in 0..self.config.max_sweeps {
            let mut change: f64 = 0.0;
            for contact in &mut self.contacts {
                let leg = &mut legs[contact.point.leg];
                let velocity = contact.free + contact.trunk_rows * trunk + contact.leg_rows * *leg;
                // What the others alone would leave.
                let others = velocity - contact.local * contact.impulse;
                let impulse = contact.solve(&others);
                let step = impulse - contact.impulse;
                contact.impulse = impulse;
                trunk += contact.trunk_rows.tr_mul(&step);
                *leg += contact.leg_rows.tr_mul(&step);
                change = change.max((contact.local * step).amax());
            }
            for row in &mut self.rows {
                let leg = &mut legs[row.leg];
                let velocity = row.free + row.trunk_row.dot(&trunk) + row.leg_row.dot(leg);
                let impulse = (row.impulse - velocity / row.local).clamp(row.lowest, row.highest);
                let step = impulse - row.impulse;
                row.impulse = impulse;
                trunk += row.trunk_row * step;
                *leg += row.leg_row * step;
                change = change.max((row.local * step).abs());
            }
            if change < self.config.tolerance_m_s {
                break;
            }
        }
        self.memory.fill(Vector3::zeros());
        for contact in &self.contacts {
            self.memory[contact.point.memory] = world_from_body * contact.impulse_body();
        }
        // dv_0 = L^-T y_0,  ddq_l = C^-T y_l - G dv_0
        let trunk = dynamics.solve_upper(&trunk);
        let legs = std::array::from_fn(|l| {
            let leg = &dynamics.legs[l];
            leg.factor_inverse.tr_mul(&legs[l]) - leg.gain * trunk
        });
        Velocity { trunk, legs }
    }
}

impl Contact {
    /// The ground's impulse on the robot, body axes at the start of the step, N s.
    pub fn impulse_body(&self) -> Vector3<f64> {
        self.axes_body * self.impulse
    }

    /// Its part out of the ground, N s.
    pub fn normal_impulse(&self) -> f64 {
        self.impulse.x
    }

    /// The impulse that satisfies Signorini's and Coulomb's laws when the velocity without it is `c`.
    fn solve(&mut self, c: &Vector3<f64>) -> Vector3<f64> {
        if c.x >= 0.0 {
            return Vector3::zeros();
        }
        let friction = self.point.friction;
        // Sticking: v = A p + c = 0.
        let stick = -(self.local_inverse * c);
        if stick.x >= 0.0 && stick.y * stick.y + stick.z * stick.z <= (friction * stick.x).powi(2) {
            self.slip = 0.0;
            return stick;
        }
        let a_nn = self.local.m11;
        if friction < 1e-9 {
            return Vector3::new(-c.x / a_nn, 0.0, 0.0);
        }
        // Sliding: v_n = 0, v_t = -s p_t with s > 0 and |p_t| = mu p_n. With p_n eliminated
        //   (B + s 1) p_t = -d,  B = A_tt - a a^T / a_nn,  d = c_t - a c_n / a_nn,  p_n = -(c_n + a . p_t) / a_nn.
        let a = Vector2::new(self.local.m12, self.local.m13);
        let d = Vector2::new(c.y, c.z) - a * (c.x / a_nn);
        let b11 = self.local.m22 - a.x * a.x / a_nn;
        let b12 = self.local.m23 - a.x * a.y / a_nn;
        let b22 = self.local.m33 - a.y * a.y / a_nn;
        let tangential = |s: f64| {
            let (m11, m22) = (b11 + s, b22 + s);
            let inverse = 1.0 / (m11 * m22 - b12 * b12);
            let p = Vector2::new(b12 * d.y - m22 * d.x, b12 * d.x - m11 * d.y) * inverse;
            // dp/ds = -(B + s 1)^-1 p
            let dp = Vector2::new(b12 * p.y - m22 * p.x, b12 * p.x - m11 * p.y) * inverse;
            (p, dp)
        };
        let normal = |p: &Vector2<f64>| -(c.x + a.dot(p)) / a_nn;
        // f(s) = |p_t| - mu p_n has a root in (0, highest]: at 0 the force is outside the cone, at `highest` inside.
        let (mut low, mut high) = (0.0, d.norm() * (a_nn + friction * a.norm()) / (friction * -c.x));
        let mut s = if self.slip > low && self.slip < high { self.slip } else { 0.0 };
        for _ in 0..60 {
            let (p, dp) = tangential(s);
            let size = p.norm();
            let f = size - friction * normal(&p);
            if f.abs() <= 1e-14 * size {
                break;
            }
            if f > 0.0 {
                low = s
            } else {
                high = s
            }
            let slope = p.dot(&dp) / size + friction * a.dot(&dp) / a_nn;
            let newton = s - f / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if next == s {
                break;
            }
            s = next;
        }
        self.slip = s;
        let (p, _) = tangential(s);
        into_cone(&Vector3::new(normal(&p), p.x, p.y), friction)
    }
}

/// The impulse with its tangential part shortened to Coulomb's limit; none where it pulls.
fn into_cone(impulse: &Vector3<f64>, friction: f64) -> Vector3<f64> {
    if impulse.x <= 0.0 {
        return Vector3::zeros();
    }
    let size = impulse.y.hypot(impulse.z);
    let limit = friction * impulse.x;
    if size <= limit {
        return *impulse;
    }
    Vector3::new(impulse.x, impulse.y * limit / size, impulse.z * limit / size)
}

/// The normal and two tangents as columns (Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017).
fn axes_about(n: &Vector3<f64>) -> Matrix3<f64> {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    #[rustfmt::skip]
    let axes = Matrix3::new(
        n.x, 1.0 + sign * n.x * n.x * a, b,
        n.y, sign * b,                   sign + n.y * n.y * a,
        n.z, -sign * n.x,                -n.y,
    );
    axes
}

/// The joint angles' stops and dry friction as the solver's rows.
pub(super) fn add_joints(
    solver: &mut ContactSolver,
    dynamics: &Dynamics,
    velocity: &Velocity,
    position: &Joints,
    limits: (&Joints, &Joints),
    dry_friction: &Joints,
    h: f64,
) {
    for joint in 0..JOINTS {
        let free = velocity.legs[joint / 3][joint % 3];
        for (sign, gap) in [(1.0, position[joint] - limits.0[joint]), (-1.0, limits.1[joint] - position[joint])] {
            // A stop within reach of this step: gap + h v >= 0. What rounding left of a step beyond it is taken back slowly.
            let share = if gap > 0.0 { 1.0 } else { solver.config.penetration_recovery };
            let approach = sign * free + share * gap / h;
            if gap + h * sign * free < 2e-3 {
                solver.add_joint(dynamics, joint, sign, approach, 0.0, f64::INFINITY);
            }
        }
        if dry_friction[joint] > 0.0 {
            let most = dry_friction[joint] * h;
            solver.add_joint(dynamics, joint, 1.0, free, -most, most);
        }
    }
}
