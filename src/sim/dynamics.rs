//! Equations of motion of a floating trunk with four legs: M(q) a + b(q, v) = [0; tau] (Featherstone 2008, eq. 9.20).
//!
//! The robot is a trunk with four chains of three joints, so M is an arrow matrix:
//!
//! ```text
//! M = | I_0   F_1  F_2  F_3  F_4 |    I_0: composite inertia of the whole robot (6x6)
//!     | F_1^T H_1                |    F_l: momentum in the trunk's frame per unit velocity of leg l's joints (6x3)
//!     | F_2^T      H_2           |    H_l: the leg's own mass matrix (3x3)
//!     | ...              ...     |
//! ```
//!
//! Factoring it leg by leg costs as much as the articulated-body algorithm here, and gives the factors that contacts
//! need: H_l = C_l C_l^T, G_l = H_l^-1 F_l^T and the Schur complement I_A = I_0 - sum F_l G_l = L L^T, which is the
//! articulated inertia of the trunk (Featherstone sections 6.5 and 7.1: sparse factorization and articulated inertia).
//!
//! Each leg is computed in the frame of its hip link, in which thigh and calf turn about the same fixed axis y.
//! Six-vectors have the linear part first, in body axes at the trunk's origin.

use fearless_simd::{Level, Simd};
use nalgebra::{Matrix3, Scalar, Vector3};

use super::lanes::{Lanes, Quad, with_lanes};
use super::leg::{LegFactors, LegLinks};
use super::model::{LegsModel, RobotModel};
use super::six::{Cholesky6, Six, split, stack};
use super::spatial::{AxisRotation, Real, SpatialForce, SpatialInertia, SpatialMotion, cross};
use super::state::{Acceleration, SimState};
use crate::robot::{GRAVITY, Joints, PerLeg, leg_of};

/// Kinematics of all legs and their coupling to the trunk. `T` is a number per leg.
#[derive(Debug, Clone)]
struct LegLanes<T: Scalar> {
    /// Rotation of thigh and calf about the hip link's y.
    thigh: AxisRotation<T>,
    calf: AxisRotation<T>,
    /// H: mass matrix of the leg's joints, kg m^2: 11, 12, 13, 22, 23, 33.
    mass: [T; 6],
    /// F: a column for each joint.
    coupling: [[T; 6]; 3],
    /// c: velocity and gravity terms, N m.
    bias: [T; 3],
    factors: LegFactors<T>,
}

/// Equations of motion at one state.
#[derive(Debug, Clone)]
pub(super) struct Dynamics {
    legs: LegLanes<Quad>,
    /// I_0 as mass, first and second moment.
    pub composite: SpatialInertia<f64>,
    /// b of the trunk's rows.
    pub bias: Six,
    /// L: factor of I_A.
    pub factor: Cholesky6,
    /// Instructions with which it is evaluated.
    instructions: Level,
}

/// Loads the joints of all legs.
#[inline(always)]
fn joint_lanes<S: Simd>(simd: S, x: &Joints) -> [Lanes<S>; 3] {
    let lanes = |i: usize| Lanes::new(simd, [x[i], x[3 + i], x[6 + i], x[9 + i]]);
    [lanes(0), lanes(1), lanes(2)]
}

/// Returns the joints of all legs from their numbers per leg.
#[inline(always)]
fn joints<S: Simd>([hip, thigh, calf]: [Lanes<S>; 3]) -> Joints {
    let lanes = [hip.store().0, thigh.store().0, calf.store().0];
    std::array::from_fn(|i| lanes[i % 3][i / 3])
}

impl<S: Simd> LegLanes<Lanes<S>> {
    /// Computes all legs; returns also their composite inertias and bias forces in the trunk's frame.
    #[inline(always)]
    fn new(
        simd: S,
        model: &LegsModel,
        q: [Lanes<S>; 3],
        dq: [Lanes<S>; 3],
        added: [Lanes<S>; 3],
        trunk_velocity: &SpatialMotion<Lanes<S>>,
        gravity_body: &Vector3<Lanes<S>>,
    ) -> (Self, SpatialInertia<Lanes<S>>, SpatialForce<Lanes<S>>) {
        let load = |x: Quad| Lanes::load(simd, x);
        let (hip, thigh, calf) = (AxisRotation::new(q[0]), AxisRotation::new(q[1]), AxisRotation::new(q[1] + q[2]));
        let [origin_hip, origin_thigh, origin_calf] = &model.joint_origin;
        let (origin_hip, origin_thigh) = (origin_hip.map(load), origin_thigh.map(load));
        let origin_calf = origin_thigh + thigh.rotate_y(&origin_calf.map(load));

        // Composite inertias about the hip's origin, hip axes (CRBA, Table 6.2: I^c).
        let [link_hip, link_thigh, link_calf] = &model.inertia;
        let (link_hip, link_thigh, link_calf) = (link_hip.map(load), link_thigh.map(load), link_calf.map(load));
        let link_calf = link_calf.rotated_y(calf).moved(&origin_calf);
        let link_thigh = link_thigh.rotated_y(thigh).moved(&origin_thigh);
        let composite_thigh = link_thigh.plus(&link_calf);
        let composite_hip = link_hip.plus(&composite_thigh);

        // F_j = I_j^c s_j,  H_ij = s_i . F_j  with the joint axes s_1 = [x; 0], s_j = [y; o_j x y].
        let f1 = composite_hip.times_x();
        let f2 = composite_thigh.times_y(&origin_thigh);
        let f3 = link_calf.times_y(&origin_calf);
        let (h11, h12, h13) = (f1.angular.x, f2.angular.x, f3.angular.x);
        let (h22, h23, h33) = (f2.about_y(&origin_thigh), f3.about_y(&origin_thigh), f3.about_y(&origin_calf));

        // Newton-Euler with zero accelerations (Table 5.1): v_i = v_p + s_i dq_i,  a_i = a_p + v_i x s_i dq_i,
        // f_i = I_i a_i + v_i x* I_i v_i;  gravity enters as an upward acceleration of the trunk.
        let v0 = SpatialMotion {
            linear: hip.unrotate_x(&(trunk_velocity.linear + cross(&trunk_velocity.angular, &origin_hip))),
            angular: hip.unrotate_x(&trunk_velocity.angular),
        };
        let (v1, mut a1) = v0.across_joint_x(dq[0]);
        let (v2, c2) = v1.across_joint_y(dq[1], &origin_thigh);
        let (v3, c3) = v2.across_joint_y(dq[2], &origin_calf);
        a1.linear -= hip.unrotate_x(gravity_body);
        let a2 = a1.plus(&c2);
        let a3 = a2.plus(&c3);
        let p3 = link_calf.force(&v3, &a3);
        let p2 = link_thigh.force(&v2, &a2).plus(&p3);
        let p1 = link_hip.force(&v1, &a1).plus(&p2);

        let coupling = [column(f1, hip, &origin_hip), column(f2, hip, &origin_hip), column(f3, hip, &origin_hip)];
        let mass = [h11, h12, h13, h22, h23, h33];
        let (factor_inverse, gain) = factor(&mass, &added, &coupling);
        let origin_body =
            [origin_hip, origin_hip + hip.rotate_x(&origin_thigh), origin_hip + hip.rotate_x(&origin_calf)];
        let legs = LegLanes {
            thigh,
            calf,
            mass,
            coupling,
            bias: [p1.angular.x, p2.about_y(&origin_thigh), p3.about_y(&origin_calf)],
            factors: LegFactors { hip, origin_body, factor_inverse, gain },
        };
        (legs, composite_hip.rotated_x(hip).moved(&origin_hip), p1.in_parent(hip, &origin_hip))
    }

    /// Stores all numbers.
    #[inline(always)]
    fn store(&self, to: &mut LegLanes<Quad>) {
        #[inline(always)]
        fn store<S: Simd>(lanes: &[Lanes<S>], to: &mut [Quad]) {
            for (to, lanes) in to.iter_mut().zip(lanes) {
                *to = lanes.store();
            }
        }
        (to.thigh, to.calf) = (self.thigh.map(Lanes::store), self.calf.map(Lanes::store));
        store(&self.mass, &mut to.mass);
        store(self.coupling.as_flattened(), to.coupling.as_flattened_mut());
        store(&self.bias, &mut to.bias);
        let (factors, to) = (&self.factors, &mut to.factors);
        to.hip = factors.hip.map(Lanes::store);
        for (to, origin) in to.origin_body.iter_mut().zip(&factors.origin_body) {
            *to = origin.map(Lanes::store);
        }
        store(&factors.factor_inverse, &mut to.factor_inverse);
        store(factors.gain.as_flattened(), to.gain.as_flattened_mut());
    }
}

impl LegLanes<Quad> {
    /// C^-1.
    #[inline(always)]
    fn factor_inverse<S: Simd>(&self, simd: S) -> [Lanes<S>; 6] {
        let load = |i: usize| Lanes::load(simd, self.factors.factor_inverse[i]);
        [load(0), load(1), load(2), load(3), load(4), load(5)]
    }

    /// Component `i` of sum F_l x_l over the legs.
    #[inline(always)]
    fn couple<S: Simd>(&self, simd: S, i: usize, x: &[Lanes<S>; 3]) -> f64 {
        let [f1, f2, f3] = &self.coupling;
        let load = |x: Quad| Lanes::load(simd, x);
        (load(f1[i]) * x[0] + load(f2[i]) * x[1] + load(f3[i]) * x[2]).sum()
    }

    /// Accelerations of the joints for an acceleration `trunk`: `free` - G a_0.
    #[inline(always)]
    fn follow<S: Simd>(&self, simd: S, free: &[Lanes<S>; 3], trunk: &Six) -> [Lanes<S>; 3] {
        let mut joint = *free;
        for (k, t) in trunk.iter().enumerate() {
            let t = Lanes::splat(simd, *t);
            for (joint, gain) in joint.iter_mut().zip(&self.factors.gain) {
                *joint -= Lanes::load(simd, gain[k]) * t;
            }
        }
        joint
    }
}

/// Returns the momentum `f` in hip axes as a column of F.
#[inline(always)]
fn column<S: Simd>(
    f: SpatialForce<Lanes<S>>,
    hip: AxisRotation<Lanes<S>>,
    origin_hip: &Vector3<Lanes<S>>,
) -> [Lanes<S>; 6] {
    let SpatialForce { linear, angular } = f.in_parent(hip, origin_hip);
    stack(&linear, &angular)
}

/// C^-1 u.
#[inline(always)]
fn lower<T: Real>([i11, i21, i22, i31, i32, i33]: &[T; 6], [u1, u2, u3]: [T; 3]) -> [T; 3] {
    [*i11 * u1, *i21 * u1 + *i22 * u2, *i31 * u1 + *i32 * u2 + *i33 * u3]
}

/// C^-T y.
#[inline(always)]
fn lower_transposed<T: Real>([i11, i21, i22, i31, i32, i33]: &[T; 6], [y1, y2, y3]: [T; 3]) -> [T; 3] {
    [*i11 * y1 + *i21 * y2 + *i31 * y3, *i22 * y2 + *i32 * y3, *i33 * y3]
}

/// Factors H + diag(`added`): C^-1 and G = H^-1 F^T.
#[inline(always)]
fn factor<S: Simd>(
    m: &[Lanes<S>; 6],
    added: &[Lanes<S>; 3],
    coupling: &[[Lanes<S>; 6]; 3],
) -> ([Lanes<S>; 6], [[Lanes<S>; 6]; 3]) {
    let [h11, h12, h13, h22, h23, h33] = *m;
    let one = h11.splat(1.0);
    // H = C C^T, then C^-1 row by row.
    let i11 = one / (h11 + added[0]).sqrt();
    let c21 = h12 * i11;
    let c31 = h13 * i11;
    let i22 = one / (h22 + added[1] - c21 * c21).sqrt();
    let c32 = (h23 - c31 * c21) * i22;
    let i33 = one / (h33 + added[2] - c31 * c31 - c32 * c32).sqrt();
    let i21 = -c21 * i11 * i22;
    let i32 = -c32 * i22 * i33;
    let i31 = -(c31 * i11 + c32 * i21) * i33;
    // G = C^-T (C^-1 F^T)
    let [f1, f2, f3] = coupling;
    let inverse = [i11, i21, i22, i31, i32, i33];
    let mut gain = *coupling;
    for k in 0..6 {
        let y = lower(&inverse, [f1[k], f2[k], f3[k]]);
        [gain[0][k], gain[1][k], gain[2][k]] = lower_transposed(&inverse, y);
    }
    (inverse, gain)
}

impl Dynamics {
    /// Memory for the equations of `model`; [`Dynamics::update`] computes them.
    pub fn of(model: &RobotModel) -> Dynamics {
        let rotation = AxisRotation { cos: Quad::ZERO, sin: Quad::ZERO };
        let legs = LegLanes {
            thigh: rotation,
            calf: rotation,
            mass: [Quad::ZERO; 6],
            coupling: [[Quad::ZERO; 6]; 3],
            bias: [Quad::ZERO; 3],
            factors: LegFactors {
                hip: rotation,
                origin_body: [Vector3::new(Quad::ZERO, Quad::ZERO, Quad::ZERO); 3],
                factor_inverse: [Quad::ZERO; 6],
                gain: [[Quad::ZERO; 6]; 3],
            },
        };
        let factor = Cholesky6::IDENTITY;
        Dynamics { legs, composite: model.trunk, bias: [0.0; 6], factor, instructions: model.instructions }
    }

    /// Returns the equations of `model` at `state`, as [`Dynamics::update`].
    pub fn new(model: &RobotModel, state: &SimState, added: &Joints) -> Dynamics {
        let mut dynamics = Dynamics::of(model);
        dynamics.update(model, state, added);
        dynamics
    }

    /// Computes the equations of `model` at `state`, with `added` on the diagonal of the joints' mass matrix (kg m^2):
    /// rotor inertia, and the terms that the time step treats implicitly.
    pub fn update(&mut self, model: &RobotModel, state: &SimState, added: &Joints) {
        with_lanes!(self.instructions, simd => self.evaluate(simd, model, state, added));
    }

    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, model: &RobotModel, state: &SimState, added: &Joints) {
        let velocity = SpatialMotion { linear: state.velocity_body, angular: state.angular_velocity_body };
        let gravity_body = state.world_from_body.inverse_transform_vector(&Vector3::new(0.0, 0.0, -GRAVITY));
        let splat = |v: &Vector3<f64>| v.map(|x| Lanes::splat(simd, x));
        let (legs, leg_inertia, leg_force) = LegLanes::new(
            simd,
            &model.legs,
            joint_lanes(simd, &state.joint_position),
            joint_lanes(simd, &state.joint_velocity),
            joint_lanes(simd, added),
            &SpatialMotion { linear: splat(&velocity.linear), angular: splat(&velocity.angular) },
            &splat(&gravity_body),
        );

        // f_0 = I_0 a_0 + v_0 x* I_0 v_0 of the trunk alone, plus the forces of the legs.
        let up = SpatialMotion { linear: -gravity_body, angular: Vector3::zeros() };
        let own = model.trunk.force(&velocity, &up);
        let sums = |v: &Vector3<Lanes<S>>| v.map(Lanes::sum);
        let bias = own.plus(&SpatialForce { linear: sums(&leg_force.linear), angular: sums(&leg_force.angular) });
        let composite = model.trunk.plus(&leg_inertia.map(Lanes::sum));

        // I_A = I_0 - sum F G; only the lower triangle is used.
        let mut articulated = columns(&composite);
        let ([f1, f2, f3], [g1, g2, g3]) = (&legs.coupling, &legs.factors.gain);
        for j in 0..6 {
            for i in j..6 {
                articulated[j][i] -= (f1[i] * g1[j] + f2[i] * g2[j] + f3[i] * g3[j]).sum();
            }
        }
        legs.store(&mut self.legs);
        self.composite = composite;
        self.bias = stack(&bias.linear, &bias.angular);
        self.factor = Cholesky6::new(articulated);
    }

    /// a = M^-1 ([0; tau] - b).
    pub fn acceleration(&self, torque: &Joints) -> Acceleration {
        with_lanes!(self.instructions, simd => self.accelerate(simd, torque))
    }

    #[inline(always)]
    fn accelerate<S: Simd>(&self, simd: S, torque: &Joints) -> Acceleration {
        // z_l = H_l^-1 (tau_l - c_l) with H_l^-1 = C^-T C^-1;  I_A a_0 = -b_0 - sum F_l z_l;  ddq_l = z_l - G_l a_0
        let [t1, t2, t3] = joint_lanes(simd, torque);
        let bias = |i: usize| Lanes::load(simd, self.legs.bias[i]);
        let inverse = self.legs.factor_inverse(simd);
        let free = lower_transposed(&inverse, lower(&inverse, [t1 - bias(0), t2 - bias(1), t3 - bias(2)]));
        let mut trunk = self.bias;
        for (i, trunk) in trunk.iter_mut().enumerate() {
            *trunk = -*trunk - self.legs.couple(simd, i, &free);
        }
        self.factor.solve_lower(&mut trunk);
        self.factor.solve_upper(&mut trunk);
        Acceleration {
            linear_body: Vector3::new(trunk[0], trunk[1], trunk[2]),
            angular_body: Vector3::new(trunk[3], trunk[4], trunk[5]),
            joint: joints(self.legs.follow(simd, &free, &trunk)),
        }
    }

    /// Centre of mass, body axes, m.
    pub fn com_body(&self) -> Vector3<f64> {
        self.composite.first / self.composite.mass
    }

    /// Momentum of the whole robot about the trunk's origin, body axes: the first six rows of M v.
    pub fn momentum(&self, trunk: &SpatialMotion<f64>, joint_velocity: &Joints) -> SpatialForce<f64> {
        self.composite.times(trunk).plus(&self.joint_momentum(joint_velocity))
    }

    /// Returns the velocity of the trunk at which the robot has `momentum`.
    pub fn trunk_velocity(&self, momentum: &SpatialForce<f64>, joint_velocity: &Joints) -> SpatialMotion<f64> {
        self.composite.velocity(&momentum.minus(&self.joint_momentum(joint_velocity)))
    }

    /// sum F_l dq_l: momentum due to the joints alone.
    fn joint_momentum(&self, joint_velocity: &Joints) -> SpatialForce<f64> {
        let mut momentum = [0.0; 6];
        with_lanes!(self.instructions, simd => {
            let dq = joint_lanes(simd, joint_velocity);
            for (i, momentum) in momentum.iter_mut().enumerate() {
                *momentum = self.legs.couple(simd, i, &dq);
            }
        });
        let (linear, angular) = split(&momentum);
        SpatialForce { linear, angular }
    }

    /// Change of the joint velocities by impulses: C_l^-T y_l - G_l dv_0, with y_l = sum U^T p.
    pub fn joint_change(&self, sums: &PerLeg<Vector3<f64>>, trunk: &Six) -> PerLeg<Vector3<f64>> {
        let change = with_lanes!(self.instructions, simd => {
            let y = |i: usize| Lanes::new(simd, [sums[0][i], sums[1][i], sums[2][i], sums[3][i]]);
            let own = lower_transposed(&self.legs.factor_inverse(simd), [y(0), y(1), y(2)]);
            joints(self.legs.follow(simd, &own, trunk))
        });
        std::array::from_fn(|l| leg_of(&change, l))
    }

    /// The legs one by one.
    pub fn legs(&self) -> PerLeg<LegLinks> {
        LegLinks::of(&self.legs.factors, self.link_rotations())
    }

    /// Factors of all legs.
    pub fn leg_factors(&self) -> &LegFactors<Quad> {
        &self.legs.factors
    }

    /// Rotations of thigh and calf of all legs about the hip link's y.
    pub fn link_rotations(&self) -> [AxisRotation<Quad>; 2] {
        [self.legs.thigh, self.legs.calf]
    }

    /// Instructions with which the equations are evaluated.
    pub fn instructions(&self) -> Level {
        self.instructions
    }

    /// F of one leg: a column for each joint.
    pub fn coupling(&self, leg: usize) -> [Six; 3] {
        self.legs.coupling.map(|column| column.map(|x| x.0[leg]))
    }

    /// H of one leg, without the terms added to its diagonal.
    pub fn leg_mass(&self, leg: usize) -> Matrix3<f64> {
        let [h11, h12, h13, h22, h23, h33] = self.legs.mass.map(|x| x.0[leg]);
        Matrix3::new(h11, h12, h13, h12, h22, h23, h13, h23, h33)
    }

    /// b of the joints' rows.
    pub fn joint_bias(&self) -> Joints {
        std::array::from_fn(|i| self.legs.bias[i % 3].0[i / 3])
    }
}

/// Returns a spatial inertia as the columns of a 6x6 matrix, linear part first: [[m 1, -hx], [hx, I]].
pub(super) fn columns(inertia: &SpatialInertia<f64>) -> [Six; 6] {
    let (m, h, i) = (inertia.mass, &inertia.first, &inertia.second);
    [
        [m, 0.0, 0.0, 0.0, h.z, -h.y],
        [0.0, m, 0.0, -h.z, 0.0, h.x],
        [0.0, 0.0, m, h.y, -h.x, 0.0],
        [0.0, -h.z, h.y, i.xx, i.xy, i.xz],
        [h.z, 0.0, -h.x, i.xy, i.yy, i.yz],
        [-h.y, h.x, 0.0, i.xz, i.yz, i.zz],
    ]
}
