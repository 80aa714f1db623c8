//! Rigid unilateral contacts with Coulomb's cone, joint stops and dry joint friction, all solved together.
//!
//! Unknown are the impulses p of one step, each in its cone K: |p_t| <= mu p_n. The cone is never cut into a pyramid. Two
//! laws say which impulse of the cone it is (`contact.law`):
//!
//! - **Coulomb**: gap after the step >= 0, p_n >= 0, one of them zero (Signorini); a point that slides keeps sliding against p_t
//!   at mu p_n and stays on the ground.
//! - **Convex**, MuJoCo's: v' - k v in the dual cone K* and orthogonal to p, which makes all contacts one convex problem
//!   (Anitescu, "Optimization-based simulation of nonsmooth rigid multibody dynamics", Math. Program. 105, 2006; Todorov,
//!   "Convex and analytically-invertible dynamics with contacts and constraints", ICRA 2014). k v is what a slip keeps over a step:
//!   k = exp(-h / slip_time). The price is dilatancy: a point that slides also rises, so fast sliding feet hop along.
//!   Normal contact is rigid here, where MuJoCo's gives way.
//!
//! A Gauss-Seidel sweep goes from contact to contact and solves each one exactly with the others held: Hwangbo, Lee, Hutter,
//! "Per-contact iteration method for solving contact dynamics", IEEE RA-L 3(2), 2018. Where that paper bisects for the
//! impulse of most dissipation, the local problem here is the law itself, reduced to one scalar equation as in Bonnefon
//! and Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA RT-0400, 2011.
//!
//! With the factors of [`super::dynamics`] the Delassus matrix is J M^-1 J^T = W W^T + (within a leg) U U^T with
//! W = (J_0 - J_l G_l) L^-T and U = J_l C_l^-T. The sweep keeps the sums y_0 = sum W^T p and y_l = sum U^T p, so one visit costs the
//! same however many contacts there are.

use nalgebra::{Matrix3, Vector2, Vector3, Vector6};

use super::config::{ContactConfig, ContactLaw, SolverConfig};
use super::dynamics::{Dynamics, Matrix6x3};
use super::quantities::stack;
use super::state::State;
use crate::robot::{JOINTS, Joints, LEGS, PerLeg, leg_of};

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

impl Velocity {
    /// That of `state`.
    pub fn of(state: &State) -> Velocity {
        Velocity {
            trunk: stack(&state.velocity_body, &state.angular_velocity_body),
            legs: std::array::from_fn(|leg| leg_of(&state.joint_velocity, leg)),
        }
    }
}

/// A point that touches or is about to.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactPoint {
    /// Which leg it is on; [`TRUNK`] for none.
    pub leg: usize,
    /// Where it remembers its impulse.
    pub memory: usize,
    /// The point, body axes, m.
    pub position_body: Vector3<f64>,
    /// Out of the ground, body axes.
    pub normal_body: Vector3<f64>,
    /// J_l: its velocity per joint velocity of its leg, body axes; zero for the trunk.
    pub leg_jacobian: Matrix3<f64>,
    /// Distance to the ground at the start of the step, m; negative where it is inside.
    pub gap: f64,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Its velocity against the ground at the start of the step, body axes, m/s.
    pub slip_body: Vector3<f64>,
    /// The same at the end of the step if nothing touched.
    pub free_slip_body: Vector3<f64>,
    /// Which loose block it is, for those who move it.
    pub block: Option<usize>,
}

/// One contact in the coordinates normal, tangent, tangent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    pub point: ContactPoint,
    /// Columns normal, two tangents, body axes.
    axes_body: Matrix3<f64>,
    /// W^T.
    trunk_rows: Matrix6x3,
    /// U; zero for the trunk.
    leg_rows: Matrix3<f64>,
    /// A = W W^T + U U^T and its inverse.
    local: Matrix3<f64>,
    local_inverse: Matrix3<f64>,
    /// Velocity without any impulse, less what may be left of it after the step.
    free: Vector3<f64>,
    /// Of Coulomb's equation; where the last search ended.
    slip: f64,
    law: ContactLaw,
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
    law: ContactLaw,
    slip_time_s: f64,
    contacts: Vec<Contact>,
    rows: Vec<Row>,
    /// Impulses of the last step in world axes, by [`ContactPoint::memory`].
    memory: Vec<Option<Vector3<f64>>>,
    /// Which of them there are.
    remembered: Vec<usize>,
    /// Share of a slip that the convex law leaves after this step.
    kept_slip: f64,
}

impl ContactSolver {
    pub fn new(config: SolverConfig, contact: &ContactConfig, memories: usize) -> ContactSolver {
        ContactSolver {
            config,
            contacts: Vec::with_capacity(MAX_CONTACTS),
            rows: Vec::with_capacity(MAX_ROWS),
            memory: vec![None; memories],
            remembered: Vec::with_capacity(MAX_CONTACTS),
            law: contact.law,
            slip_time_s: contact.slip_time_s,
            kept_slip: 0.0,
        }
    }

    /// Forgets the last step's impulses.
    pub fn reset(&mut self) {
        self.contacts.clear();
        self.rows.clear();
        self.memory.fill(None);
        self.remembered.clear();
    }

    /// Starts a step of `h` seconds.
    pub fn start(&mut self, h: f64) {
        self.contacts.clear();
        self.rows.clear();
        self.kept_slip = if self.slip_time_s > 0.0 { (-h / self.slip_time_s).exp() } else { 0.0 };
    }

    pub fn is_empty(&self) -> bool {
        self.contacts.is_empty() && self.rows.is_empty()
    }

    /// The contacts of this step, with their impulses once solved.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Adds a point; `world_from_body` turns its remembered impulse into place.
    pub fn add_point(&mut self, dynamics: &Dynamics, point: ContactPoint, world_from_body: &Matrix3<f64>, h: f64) {
        if self.contacts.len() == MAX_CONTACTS {
            return;
        }
        let axes_body = axes_about(&point.normal_body);
        let [n, t1, t2] = [axes_body.column(0).into(), axes_body.column(1).into(), axes_body.column(2).into()];
        let p: &Vector3<f64> = &point.position_body;
        // Columns of J_0^T: axis . (v + w x p) = axis . v + (p x axis) . w
        let mut columns =
            Matrix6x3::from_columns(&[stack(&n, &p.cross(&n)), stack(&t1, &p.cross(&t1)), stack(&t2, &p.cross(&t2))]);
        let mut leg_rows = Matrix3::zeros();
        if point.leg != TRUNK {
            // J_0^T - G^T J_l^T and U = J_l C^-T
            let leg = &dynamics.legs[point.leg];
            let jacobian = axes_body.tr_mul(&point.leg_jacobian);
            columns -= leg.gain.tr_mul(&jacobian.transpose());
            leg_rows = jacobian * leg.factor_inverse.transpose();
        }
        // W = (L^-1 (J_0 - J_l G)^T)^T
        let trunk_rows = dynamics.solve_lower_columns(columns);
        let local = trunk_rows.tr_mul(&trunk_rows) + leg_rows * leg_rows.transpose();
        let mut free = axes_body.tr_mul(&point.free_slip_body);
        // gap + h v_n >= 0; inside the ground a share of the way back per step.
        let share = if point.gap > 0.0 { 1.0 } else { self.config.penetration_recovery };
        free.x += share * point.gap / h;
        if let ContactLaw::Convex = self.law {
            let before = axes_body.tr_mul(&point.slip_body);
            free.y -= self.kept_slip * before.y;
            free.z -= self.kept_slip * before.z;
        }

        let remembered = match self.memory[point.memory] {
            Some(impulse_world) => axes_body.tr_mul(&world_from_body.tr_mul(&impulse_world)),
            None => Vector3::zeros(),
        };
        let impulse = into_cone(&remembered, point.friction);
        self.contacts.push(Contact {
            point,
            axes_body,
            trunk_rows,
            leg_rows,
            local,
            local_inverse: symmetric_inverse(&local),
            free,
            slip: 0.0,
            law: self.law,
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
            trunk += contact.trunk_rows * contact.impulse;
            legs[contact.point.leg] += contact.leg_rows.tr_mul(&contact.impulse);
        }
        for _ in 0..self.config.max_sweeps {
            let mut change: f64 = 0.0;
            for contact in &mut self.contacts {
                let leg = &mut legs[contact.point.leg];
                let velocity = contact.free + contact.trunk_rows.tr_mul(&trunk) + contact.leg_rows * *leg;
                // What the others alone would leave.
                let others = velocity - contact.local * contact.impulse;
                let impulse = contact.solve(&others);
                let step = impulse - contact.impulse;
                contact.impulse = impulse;
                trunk += contact.trunk_rows * step;
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
        for memory in self.remembered.drain(..) {
            self.memory[memory] = None;
        }
        for contact in &self.contacts {
            self.memory[contact.point.memory] = Some(world_from_body * contact.impulse_body());
            self.remembered.push(contact.point.memory);
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
        // Sliding: v_t = -s p_t with s > 0 and |p_t| = mu p_n; v_n = 0 (Coulomb) or mu |v_t| = mu^2 s p_n (convex):
        //   (A + s D) p = -c,  D = diag(0 or -mu^2, 1, 1).
        let weight = match self.law {
            ContactLaw::Coulomb => 0.0,
            ContactLaw::Convex => -friction * friction,
        };
        let m = &self.local;
        // p(s), and dp/ds = -(A + s D)^-1 D p; none where A + s D is no longer positive: s is too large.
        let at = |s: f64| {
            let (m11, m22, m33) = (m.m11 + s * weight, m.m22 + s, m.m33 + s);
            let (i11, i12, i13) = (m22 * m33 - m.m23 * m.m23, m.m13 * m.m23 - m.m12 * m33, m.m12 * m.m23 - m.m13 * m22);
            let determinant = m11 * i11 + m.m12 * i12 + m.m13 * i13;
            if m11 <= 0.0 || determinant <= 0.0 {
                return None;
            }
            let (i22, i23, i33) = (m11 * m33 - m.m13 * m.m13, m.m12 * m.m13 - m11 * m.m23, m11 * m22 - m.m12 * m.m12);
            let solve = |v: Vector3<f64>| {
                let product = Vector3::new(
                    i11 * v.x + i12 * v.y + i13 * v.z,
                    i12 * v.x + i22 * v.y + i23 * v.z,
                    i13 * v.x + i23 * v.y + i33 * v.z,
                );
                product / -determinant
            };
            let p = solve(*c);
            Some((p, solve(Vector3::new(weight * p.x, p.y, p.z))))
        };
        // f(s) = |p_t| - mu p_n has a root in (0, highest]: at 0 the force is outside the cone, at `highest` inside.
        let a = Vector2::new(m.m12, m.m13);
        let d = Vector2::new(c.y, c.z) - a * (c.x / a_nn);
        let (mut low, mut high) = (0.0, d.norm() * (a_nn + friction * a.norm()) / (friction * -c.x));
        let mut s = if self.slip > low && self.slip < high { self.slip } else { 0.0 };
        let mut best = stick;
        for _ in 0..60 {
            let Some((p, dp)) = at(s) else {
                high = s;
                s = 0.5 * (low + high);
                continue;
            };
            best = p;
            let size = p.y.hypot(p.z);
            let f = size - friction * p.x;
            if f.abs() <= 1e-14 * size {
                break;
            }
            if f > 0.0 {
                low = s
            } else {
                high = s
            }
            let slope = (p.y * dp.y + p.z * dp.z) / size - friction * dp.x;
            let newton = s - f / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if next == s {
                break;
            }
            s = next;
        }
        self.slip = s;
        into_cone(&best, friction)
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

/// The inverse of a symmetric positive matrix by cofactors.
fn symmetric_inverse(m: &Matrix3<f64>) -> Matrix3<f64> {
    let i11 = m.m22 * m.m33 - m.m23 * m.m23;
    let i12 = m.m13 * m.m23 - m.m12 * m.m33;
    let i13 = m.m12 * m.m23 - m.m13 * m.m22;
    let i22 = m.m11 * m.m33 - m.m13 * m.m13;
    let i23 = m.m12 * m.m13 - m.m11 * m.m23;
    let i33 = m.m11 * m.m22 - m.m12 * m.m12;
    let determinant = m.m11 * i11 + m.m12 * i12 + m.m13 * i13;
    Matrix3::new(i11, i12, i13, i12, i22, i23, i13, i23, i33) / determinant
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
