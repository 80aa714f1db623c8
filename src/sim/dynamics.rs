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

use nalgebra::{Matrix3, Vector3};
use simba::simd::{SimdComplexField, SimdValue};

use super::model::{Lanes, LegsModel, RobotModel};
use super::six::{Cholesky6, Six};
use super::spatial::{AxisRotation, SpatialForce, SpatialInertia, SpatialMotion};
use super::state::{Acceleration, SimState};
use crate::robot::{GRAVITY, JOINTS, Joints, LEGS, PerLeg};

/// Kinematics of all legs and their coupling to the trunk; one lane per leg.
#[derive(Debug, Clone)]
pub(super) struct LegLanes {
    /// Rotation of the hip link about x.
    hip: AxisRotation<Lanes>,
    /// Rotation of thigh and calf about the hip link's y.
    thigh: AxisRotation<Lanes>,
    calf: AxisRotation<Lanes>,
    /// Joint origins in the trunk's frame, m.
    origin_body: [Vector3<Lanes>; 3],
    /// H: mass matrix of the leg's joints, kg m^2: 11, 12, 13, 22, 23, 33.
    mass: [Lanes; 6],
    /// F: a column for each joint.
    coupling: [[Lanes; 6]; 3],
    /// c: velocity and gravity terms, N m.
    bias: [Lanes; 3],
    /// C^-1: inverse of the lower Cholesky factor of H: 11, 21, 22, 31, 32, 33.
    factor_inverse: [Lanes; 6],
    /// G = H^-1 F^T: a row for each joint.
    gain: [[Lanes; 6]; 3],
}

/// Kinematics and factors of one leg.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegDynamics {
    hip: AxisRotation<f64>,
    thigh: AxisRotation<f64>,
    calf: AxisRotation<f64>,
    /// Joint origins in the trunk's frame, m.
    pub origin_body: [Vector3<f64>; 3],
    /// C^-1.
    pub factor_inverse: Matrix3<f64>,
    /// G: a row for each joint.
    pub gain: [Six; 3],
}

/// Equations of motion at one state.
#[derive(Debug, Clone)]
pub(super) struct Dynamics {
    legs: LegLanes,
    /// I_0 as mass, first and second moment.
    pub composite: SpatialInertia<f64>,
    /// b of the trunk's rows.
    pub bias: Six,
    /// L: factor of I_A.
    pub factor: Cholesky6,
}

/// Returns the joints of all legs as lanes.
#[inline]
fn joint_lanes(x: &Joints) -> [Lanes; 3] {
    let lanes = |i: usize| Lanes::from([x[i], x[3 + i], x[6 + i], x[9 + i]]);
    [lanes(0), lanes(1), lanes(2)]
}

impl LegLanes {
    /// Computes all legs; returns also their composite inertias and bias forces in the trunk's frame.
    #[inline]
    fn new(
        model: &LegsModel,
        q: [Lanes; 3],
        dq: [Lanes; 3],
        added: [Lanes; 3],
        trunk_velocity: &SpatialMotion<Lanes>,
        gravity_body: &Vector3<Lanes>,
    ) -> (LegLanes, SpatialInertia<Lanes>, SpatialForce<Lanes>) {
        let (hip, thigh, calf) = (AxisRotation::new(q[0]), AxisRotation::new(q[1]), AxisRotation::new(q[1] + q[2]));
        let origin_hip = model.joint_origin[0];
        let origin_thigh = model.joint_origin[1];
        let origin_calf = origin_thigh + thigh.rotate_y(&model.joint_origin[2]);

        // Composite inertias about the hip's origin, hip axes (CRBA, Table 6.2: I^c).
        let link_calf = model.inertia[2].rotated_y(calf).moved(&origin_calf);
        let link_thigh = model.inertia[1].rotated_y(thigh).moved(&origin_thigh);
        let link_hip = model.inertia[0];
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
            linear: hip.unrotate_x(&(trunk_velocity.linear + trunk_velocity.angular.cross(&origin_hip))),
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

        let column = |f: &SpatialForce<Lanes>| {
            let f = f.in_parent(hip, &origin_hip);
            [f.linear.x, f.linear.y, f.linear.z, f.angular.x, f.angular.y, f.angular.z]
        };
        let coupling = [column(&f1), column(&f2), column(&f3)];
        let mass = [h11, h12, h13, h22, h23, h33];
        let (factor_inverse, gain) = factor(&mass, &added, &coupling);
        let legs = LegLanes {
            hip,
            thigh,
            calf,
            origin_body: [
                origin_hip,
                origin_hip + hip.rotate_x(&origin_thigh),
                origin_hip + hip.rotate_x(&origin_calf),
            ],
            mass,
            coupling,
            bias: [p1.angular.x, p2.about_y(&origin_thigh), p3.about_y(&origin_calf)],
            factor_inverse,
            gain,
        };
        (legs, composite_hip.rotated_x(hip).moved(&origin_hip), p1.in_parent(hip, &origin_hip))
    }

    /// H^-1 u = C^-T C^-1 u.
    #[inline]
    fn solve(&self, u: &[Lanes; 3]) -> [Lanes; 3] {
        let [i11, i21, i22, i31, i32, i33] = self.factor_inverse;
        let y1 = i11 * u[0];
        let y2 = i21 * u[0] + i22 * u[1];
        let y3 = i31 * u[0] + i32 * u[1] + i33 * u[2];
        [i11 * y1 + i21 * y2 + i31 * y3, i22 * y2 + i32 * y3, i33 * y3]
    }

    /// Accelerations of the joints for an acceleration `trunk`: `free` - G a_0.
    #[inline]
    fn follow(&self, free: &[Lanes; 3], trunk: &Six) -> [Lanes; 3] {
        let mut joint = *free;
        for (k, t) in trunk.iter().enumerate() {
            let t = Lanes::splat(*t);
            for (joint, gain) in joint.iter_mut().zip(&self.gain) {
                *joint -= gain[k] * t;
            }
        }
        joint
    }
}

/// Factors H + diag(`added`): C^-1 and G = H^-1 F^T.
#[inline]
fn factor(m: &[Lanes; 6], added: &[Lanes; 3], coupling: &[[Lanes; 6]; 3]) -> ([Lanes; 6], [[Lanes; 6]; 3]) {
    let [h11, h12, h13, h22, h23, h33] = *m;
    let one = Lanes::splat(1.0);
    // H = C C^T, then C^-1 row by row.
    let i11 = one / (h11 + added[0]).simd_sqrt();
    let c21 = h12 * i11;
    let c31 = h13 * i11;
    let i22 = one / (h22 + added[1] - c21 * c21).simd_sqrt();
    let c32 = (h23 - c31 * c21) * i22;
    let i33 = one / (h33 + added[2] - c31 * c31 - c32 * c32).simd_sqrt();
    let i21 = -c21 * i11 * i22;
    let i32 = -c32 * i22 * i33;
    let i31 = -(c31 * i11 + c32 * i21) * i33;
    // G = C^-T (C^-1 F^T)
    let [f1, f2, f3] = coupling;
    let mut gain = [[Lanes::splat(0.0); 6]; 3];
    for k in 0..6 {
        let y1 = i11 * f1[k];
        let y2 = i21 * f1[k] + i22 * f2[k];
        let y3 = i31 * f1[k] + i32 * f2[k] + i33 * f3[k];
        gain[0][k] = i11 * y1 + i21 * y2 + i31 * y3;
        gain[1][k] = i22 * y2 + i32 * y3;
        gain[2][k] = i33 * y3;
    }
    ([i11, i21, i22, i31, i32, i33], gain)
}

impl LegDynamics {
    /// Velocity of a point at `p_body` on the link `link` (0 hip, 1 thigh, 2 calf) per joint velocity, body axes.
    #[inline]
    pub fn point_jacobian(&self, link: usize, p_body: &Vector3<f64>) -> Matrix3<f64> {
        // Column j: e_j x (p - o_j);  e_1 = x, e_2 = e_3 = (0, cos q1, sin q1).
        let (c, s) = (self.hip.cos, self.hip.sin);
        let about_y = |r: Vector3<f64>| Vector3::new(c * r.z - s * r.y, s * r.x, -c * r.x);
        let r1 = p_body - self.origin_body[0];
        let column1 = Vector3::new(0.0, -r1.z, r1.y);
        let column2 = if link >= 1 { about_y(p_body - self.origin_body[1]) } else { Vector3::zeros() };
        let column3 = if link >= 2 { about_y(p_body - self.origin_body[2]) } else { Vector3::zeros() };
        Matrix3::from_columns(&[column1, column2, column3])
    }

    /// Transforms a point of link `link` (0 hip, 1 thigh, 2 calf) to the trunk's frame.
    #[inline]
    pub fn in_body(&self, link: usize, p: &Vector3<f64>) -> Vector3<f64> {
        let turned = match link {
            0 => *p,
            1 => self.thigh.rotate_y(p),
            _ => self.calf.rotate_y(p),
        };
        self.origin_body[link] + self.hip.rotate_x(&turned)
    }

    /// Rotates a vector from the trunk's axes to the axes of each link.
    #[inline]
    pub fn in_links(&self, v_body: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let v = self.hip.unrotate_x(v_body);
        [v, self.thigh.unrotate_y(&v), self.calf.unrotate_y(&v)]
    }
}

impl Dynamics {
    /// Computes the equations of `model` at `state`, with `added` on the diagonal of the joints' mass matrix (kg m^2):
    /// rotor inertia, and the terms that the time step treats implicitly.
    pub fn new(model: &RobotModel, state: &SimState, added: &Joints) -> Dynamics {
        let velocity = SpatialMotion { linear: state.velocity_body, angular: state.angular_velocity_body };
        let gravity_body = state.world_from_body.inverse_transform_vector(&Vector3::new(0.0, 0.0, -GRAVITY));
        let (legs, leg_inertia, leg_force) = LegLanes::new(
            &model.legs,
            joint_lanes(&state.joint_position),
            joint_lanes(&state.joint_velocity),
            joint_lanes(added),
            &SpatialMotion { linear: velocity.linear.map(Lanes::splat), angular: velocity.angular.map(Lanes::splat) },
            &gravity_body.map(Lanes::splat),
        );

        // f_0 = I_0 a_0 + v_0 x* I_0 v_0 of the trunk alone, plus the forces of the legs.
        let up = SpatialMotion { linear: -gravity_body, angular: Vector3::zeros() };
        let own = model.trunk.force(&velocity, &up);
        let bias = own.plus(&SpatialForce { linear: sums(&leg_force.linear), angular: sums(&leg_force.angular) });
        let composite = model.trunk.plus(&SpatialInertia {
            mass: sum(leg_inertia.mass),
            first: sums(&leg_inertia.first),
            second: leg_inertia.second.map(sum),
        });

        // I_A = I_0 - sum F G; only the lower triangle is used.
        let mut articulated = columns(&composite);
        let ([f1, f2, f3], [g1, g2, g3]) = (&legs.coupling, &legs.gain);
        for j in 0..6 {
            for i in j..6 {
                articulated[j][i] -= sum(f1[i] * g1[j] + f2[i] * g2[j] + f3[i] * g3[j]);
            }
        }
        let factor = Cholesky6::new(articulated);
        let (f, n) = (&bias.linear, &bias.angular);
        Dynamics { legs, composite, bias: [f.x, f.y, f.z, n.x, n.y, n.z], factor }
    }

    /// a = M^-1 ([0; tau] - b).
    pub fn acceleration(&self, torque: &Joints) -> Acceleration {
        // z_l = H_l^-1 (tau_l - c_l);  I_A a_0 = -b_0 - sum F_l z_l;  ddq_l = z_l - G_l a_0
        let ([t1, t2, t3], [c1, c2, c3]) = (joint_lanes(torque), self.legs.bias);
        let free = self.legs.solve(&[t1 - c1, t2 - c2, t3 - c3]);
        let [f1, f2, f3] = &self.legs.coupling;
        let mut trunk = self.bias;
        for (i, trunk) in trunk.iter_mut().enumerate() {
            *trunk = -*trunk - sum(f1[i] * free[0] + f2[i] * free[1] + f3[i] * free[2]);
        }
        self.factor.solve_lower(&mut trunk);
        self.factor.solve_upper(&mut trunk);
        let [hip, thigh, calf] = self.legs.follow(&free, &trunk);
        let joint: [[f64; LEGS]; 3] = [hip.into(), thigh.into(), calf.into()];
        Acceleration {
            linear_body: Vector3::new(trunk[0], trunk[1], trunk[2]),
            angular_body: Vector3::new(trunk[3], trunk[4], trunk[5]),
            joint: std::array::from_fn(|i| joint[i % 3][i / 3]),
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
        let dq = joint_lanes(joint_velocity);
        let [f1, f2, f3] = &self.legs.coupling;
        let row = |i: usize| sum(f1[i] * dq[0] + f2[i] * dq[1] + f3[i] * dq[2]);
        SpatialForce { linear: Vector3::new(row(0), row(1), row(2)), angular: Vector3::new(row(3), row(4), row(5)) }
    }

    /// Change of the joint velocities by impulses: C_l^-T y_l - G_l dv_0, with y_l = sum U^T p.
    pub fn joint_change(&self, sums: &PerLeg<Vector3<f64>>, trunk: &Six) -> PerLeg<Vector3<f64>> {
        let lanes = |i: usize| Lanes::from([sums[0][i], sums[1][i], sums[2][i], sums[3][i]]);
        let y = [lanes(0), lanes(1), lanes(2)];
        let [i11, i21, i22, i31, i32, i33] = self.legs.factor_inverse;
        let own = [i11 * y[0] + i21 * y[1] + i31 * y[2], i22 * y[1] + i32 * y[2], i33 * y[2]];
        let [hip, thigh, calf] = self.legs.follow(&own, trunk);
        let [hip, thigh, calf]: [[f64; LEGS]; 3] = [hip.into(), thigh.into(), calf.into()];
        std::array::from_fn(|l| Vector3::new(hip[l], thigh[l], calf[l]))
    }

    /// The legs one by one.
    pub fn legs(&self) -> PerLeg<LegDynamics> {
        let identity = AxisRotation { cos: 1.0, sin: 0.0 };
        let mut out = [LegDynamics {
            hip: identity,
            thigh: identity,
            calf: identity,
            origin_body: [Vector3::zeros(); 3],
            factor_inverse: Matrix3::zeros(),
            gain: [[0.0; 6]; 3],
        }; LEGS];
        // Each quantity is distributed from its lanes to the four legs.
        let mut scatter = |x: Lanes, element: fn(&mut LegDynamics, usize, usize) -> &mut f64, i: usize, j: usize| {
            let x: [f64; LEGS] = x.into();
            for (leg, x) in out.iter_mut().zip(x) {
                *element(leg, i, j) = x;
            }
        };
        let legs = &self.legs;
        scatter(legs.hip.cos, |leg, _, _| &mut leg.hip.cos, 0, 0);
        scatter(legs.hip.sin, |leg, _, _| &mut leg.hip.sin, 0, 0);
        scatter(legs.thigh.cos, |leg, _, _| &mut leg.thigh.cos, 0, 0);
        scatter(legs.thigh.sin, |leg, _, _| &mut leg.thigh.sin, 0, 0);
        scatter(legs.calf.cos, |leg, _, _| &mut leg.calf.cos, 0, 0);
        scatter(legs.calf.sin, |leg, _, _| &mut leg.calf.sin, 0, 0);
        for j in 0..3 {
            for k in 0..3 {
                scatter(legs.origin_body[j][k], |leg, j, k| &mut leg.origin_body[j][k], j, k);
            }
            for k in 0..6 {
                scatter(legs.gain[j][k], |leg, j, k| &mut leg.gain[j][k], j, k);
            }
        }
        for (n, (i, j)) in [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)].into_iter().enumerate() {
            scatter(legs.factor_inverse[n], |leg, i, j| &mut leg.factor_inverse[(i, j)], i, j);
        }
        out
    }

    /// F of one leg: a column for each joint.
    pub fn coupling(&self, leg: usize) -> [Six; 3] {
        self.legs.coupling.map(|column| column.map(|x| x.extract(leg)))
    }

    /// H of one leg, without the terms added to its diagonal.
    pub fn leg_mass(&self, leg: usize) -> Matrix3<f64> {
        let [h11, h12, h13, h22, h23, h33] = self.legs.mass.map(|x| x.extract(leg));
        Matrix3::new(h11, h12, h13, h12, h22, h23, h13, h23, h33)
    }

    /// b of the joints' rows.
    pub fn joint_bias(&self) -> Joints {
        let bias: [Lanes; 3] = self.legs.bias;
        std::array::from_fn::<f64, JOINTS, _>(|i| bias[i % 3].extract(i / 3))
    }
}

/// Sum over the legs.
#[inline]
fn sum(x: Lanes) -> f64 {
    let [a, b, c, d]: [f64; LEGS] = x.into();
    (a + b) + (c + d)
}

/// Sum over the legs of each component.
#[inline]
fn sums(v: &Vector3<Lanes>) -> Vector3<f64> {
    Vector3::new(sum(v.x), sum(v.y), sum(v.z))
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
