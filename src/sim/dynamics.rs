//! Equations of motion of a floating trunk with four legs: M(q) a + b(q, v) = [0; tau] (Featherstone 2008, eq. 9.20).
//!
//! The machine is a trunk with four chains of three, so M is an arrow:
//!
//! ```text
//! M = | I_0   F_1  F_2  F_3  F_4 |    I_0: composite inertia of the whole machine (6x6)
//!     | F_1^T H_1                |    F_l: momentum of the trunk's frame per unit velocity of leg l's joints (6x3)
//!     | F_2^T      H_2           |    H_l: the leg's own mass matrix (3x3)
//!     | ...              ...     |
//! ```
//!
//! Factoring it leg by leg is exactly as cheap as the articulated-body algorithm here, and leaves what contacts
//! need: H_l = C_l C_l^T, G_l = H_l^-1 F_l^T and the Schur complement I_A = I_0 - sum F_l G_l = L L^T, which is the
//! articulated inertia of the trunk (Featherstone sections 6.5 and 7.1: sparse factorization and articulated inertia).
//!
//! Each leg is worked out in the frame of its hip link, in which thigh and calf turn about the same fixed axis y.
//! Six-vectors have the linear part first, in body axes at the trunk's origin.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

use super::model::{GRAVITY, LegModel, Model};
use super::spatial::{Force, Inertia, Motion, Turn};
use super::state::{Acceleration, State};
use crate::robot::{Joints, LEGS, PerLeg};

/// 3x6: leg rows, trunk columns.
pub(super) type Matrix3x6 = SMatrix<f64, 3, 6>;
/// 6x3: trunk rows, leg columns.
pub(super) type Matrix6x3 = SMatrix<f64, 6, 3>;

/// Where a leg's parts are and how they couple to the trunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegDynamics {
    /// Rotation of the hip link about x.
    pub hip: Turn,
    /// Rotation of thigh and calf about the hip link's y.
    pub thigh: Turn,
    pub calf: Turn,
    /// Joint origins in the trunk's frame, m.
    pub origin_body: [Vector3<f64>; 3],
    /// H: mass matrix of the leg's joints, kg m^2.
    pub mass: Matrix3<f64>,
    /// F: six rows of the trunk's frame by three joints.
    pub coupling: Matrix6x3,
    /// c: torques that velocity and gravity ask for, N m.
    pub bias: Vector3<f64>,
    /// C^-1: inverse of the lower Cholesky factor of H.
    pub factor_inverse: Matrix3<f64>,
    /// G = H^-1 F^T.
    pub gain: Matrix3x6,
}

/// The equations at one state.
#[derive(Debug, Clone)]
pub(super) struct Dynamics {
    pub legs: PerLeg<LegDynamics>,
    /// I_0 as mass, first and second moment.
    pub composite: Inertia,
    /// b of the trunk's rows.
    pub bias: Vector6<f64>,
    /// L: lower Cholesky factor of I_A, with the reciprocals of its diagonal kept apart.
    pub factor: Matrix6<f64>,
    pub factor_diagonal_inverse: Vector6<f64>,
}

impl LegDynamics {
    /// Fills pose, H, F and c of one leg; returns its composite inertia and bias force in the trunk's frame.
    #[inline]
    fn new(
        leg: &LegModel,
        q: [f64; 3],
        dq: [f64; 3],
        trunk_velocity: &Motion,
        gravity_body: &Vector3<f64>,
    ) -> (LegDynamics, Inertia, Force) {
        let (hip, thigh, calf) = (Turn::by(q[0]), Turn::by(q[1]), Turn::by(q[1] + q[2]));
        let origin_hip = leg.joint_origin[0];
        let origin_thigh = leg.joint_origin[1];
        let origin_calf = origin_thigh + thigh.y(&leg.joint_origin[2]);

        // Inertias about the hip's origin, hip axes, each with all that hangs on it (CRBA, Table 6.2: I^c).
        let link_calf = leg.inertia[2].turned_y(calf).moved(&origin_calf);
        let link_thigh = leg.inertia[1].turned_y(thigh).moved(&origin_thigh);
        let link_hip = leg.inertia[0];
        let composite_thigh = link_thigh.plus(&link_calf);
        let composite_hip = link_hip.plus(&composite_thigh);

        // Joint axes as spatial motions: s_1 = [x; 0], s_j = [y; o_j x y].
        let about_y = |o: &Vector3<f64>| Motion { linear: Vector3::new(-o.z, 0.0, o.x), angular: Vector3::y() };
        let s1 = Motion { linear: Vector3::zeros(), angular: Vector3::x() };
        let s2 = about_y(&origin_thigh);
        let s3 = about_y(&origin_calf);

        // F_j = I_j^c s_j,  H_ij = s_i . F_j
        let f1 = composite_hip.times(&s1);
        let f2 = composite_thigh.times(&s2);
        let f3 = link_calf.times(&s3);
        let (h11, h12, h13) = (f1.angular.x, f2.angular.x, f3.angular.x);
        let (h22, h23, h33) = (s2.dot(&f2), s2.dot(&f3), s3.dot(&f3));

        // Newton-Euler with zero accelerations (Table 5.1): v_i = v_p + s_i dq_i,  a_i = a_p + v_i x s_i dq_i,
        // f_i = I_i a_i + v_i x* I_i v_i;  gravity enters as an upward acceleration of the trunk.
        let v0 = Motion {
            linear: hip.x_back(&(trunk_velocity.linear + trunk_velocity.angular.cross(&origin_hip))),
            angular: hip.x_back(&trunk_velocity.angular),
        };
        let a0 = Motion { linear: -hip.x_back(gravity_body), angular: Vector3::zeros() };
        let force = |link: &Inertia, v: &Motion, a: &Motion| link.times(a).plus(&v.cross_force(&link.times(v)));
        let (w1, w2, w3) = (s1.scaled(dq[0]), s2.scaled(dq[1]), s3.scaled(dq[2]));
        let v1 = v0.plus(&w1);
        let v2 = v1.plus(&w2);
        let v3 = v2.plus(&w3);
        let a1 = a0.plus(&v1.cross(&w1));
        let a2 = a1.plus(&v2.cross(&w2));
        let a3 = a2.plus(&v3.cross(&w3));
        let p3 = force(&link_calf, &v3, &a3);
        let p2 = force(&link_thigh, &v2, &a2).plus(&p3);
        let p1 = force(&link_hip, &v1, &a1).plus(&p2);

        let mut coupling = Matrix6x3::zeros();
        for (j, f) in [f1, f2, f3].iter().enumerate() {
            let f = f.out_of(hip, &origin_hip);
            coupling.fixed_view_mut::<3, 1>(0, j).copy_from(&f.linear);
            coupling.fixed_view_mut::<3, 1>(3, j).copy_from(&f.angular);
        }
        let dynamics = LegDynamics {
            hip,
            thigh,
            calf,
            origin_body: [origin_hip, origin_hip + hip.x(&origin_thigh), origin_hip + hip.x(&origin_calf)],
            mass: Matrix3::new(h11, h12, h13, h12, h22, h23, h13, h23, h33),
            coupling,
            bias: Vector3::new(p1.angular.x, s2.dot(&p2), s3.dot(&p3)),
            factor_inverse: Matrix3::zeros(),
            gain: Matrix3x6::zeros(),
        };
        (dynamics, composite_hip.turned_x(hip).moved(&origin_hip), p1.out_of(hip, &origin_hip))
    }

    /// Factors H + diag(`added`) and fills C^-1 and G.
    #[inline]
    fn factor(&mut self, added: [f64; 3]) {
        let m = &self.mass;
        // H = C C^T, then C^-1 row by row.
        let i11 = 1.0 / (m.m11 + added[0]).sqrt();
        let c21 = m.m21 * i11;
        let c31 = m.m31 * i11;
        let i22 = 1.0 / (m.m22 + added[1] - c21 * c21).sqrt();
        let c32 = (m.m32 - c31 * c21) * i22;
        let i33 = 1.0 / (m.m33 + added[2] - c31 * c31 - c32 * c32).sqrt();
        let i21 = -c21 * i11 * i22;
        let i32 = -c32 * i22 * i33;
        let i31 = -(c31 * i11 + c32 * i21) * i33;
        self.factor_inverse = Matrix3::new(i11, 0.0, 0.0, i21, i22, 0.0, i31, i32, i33);
        // G = C^-T (C^-1 F^T)
        let f = &self.coupling;
        for k in 0..6 {
            let y1 = i11 * f[(k, 0)];
            let y2 = i21 * f[(k, 0)] + i22 * f[(k, 1)];
            let y3 = i31 * f[(k, 0)] + i32 * f[(k, 1)] + i33 * f[(k, 2)];
            self.gain[(0, k)] = i11 * y1 + i21 * y2 + i31 * y3;
            self.gain[(1, k)] = i22 * y2 + i32 * y3;
            self.gain[(2, k)] = i33 * y3;
        }
    }

    /// H^-1 u = C^-T C^-1 u.
    #[inline]
    pub fn solve(&self, u: &Vector3<f64>) -> Vector3<f64> {
        let c = &self.factor_inverse;
        let y1 = c.m11 * u.x;
        let y2 = c.m21 * u.x + c.m22 * u.y;
        let y3 = c.m31 * u.x + c.m32 * u.y + c.m33 * u.z;
        Vector3::new(c.m11 * y1 + c.m21 * y2 + c.m31 * y3, c.m22 * y2 + c.m32 * y3, c.m33 * y3)
    }

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

    /// A point of link `link` (0 hip, 1 thigh, 2 calf) from its frame to the trunk's.
    #[inline]
    pub fn in_body(&self, link: usize, p: &Vector3<f64>) -> Vector3<f64> {
        let turned = match link {
            0 => *p,
            1 => self.thigh.y(p),
            _ => self.calf.y(p),
        };
        self.origin_body[link] + self.hip.x(&turned)
    }

    /// A vector in the trunk's axes seen in the axes of link `link`.
    #[inline]
    pub fn into_link(&self, link: usize, v_body: &Vector3<f64>) -> Vector3<f64> {
        let v = self.hip.x_back(v_body);
        match link {
            0 => v,
            1 => self.thigh.y_back(&v),
            _ => self.calf.y_back(&v),
        }
    }
}

impl Dynamics {
    /// The equations of `model` at `state`, with `added` on the diagonal of the joints' mass matrix (kg m^2): rotor inertia
    /// and whatever the time step treats implicitly.
    pub fn new(model: &Model, state: &State, added: &Joints) -> Dynamics {
        let velocity = Motion { linear: state.velocity_body, angular: state.angular_velocity_body };
        let gravity_body = state.orientation_world.inverse_transform_vector(&Vector3::new(0.0, 0.0, -GRAVITY));

        // The trunk's own share: f_0 = I_0 a_0 + v_0 x* I_0 v_0
        let up = Motion { linear: -gravity_body, angular: Vector3::zeros() };
        let mut composite = model.trunk;
        let mut bias = model.trunk.times(&up).plus(&velocity.cross_force(&model.trunk.times(&velocity)));

        let legs = std::array::from_fn::<_, LEGS, _>(|l| {
            let joints = 3 * l..3 * l + 3;
            let three = |x: &Joints| -> [f64; 3] { [x[3 * l], x[3 * l + 1], x[3 * l + 2]] };
            let (mut leg, inertia, force) = LegDynamics::new(
                &model.legs[l],
                three(&state.joint_position),
                three(&state.joint_velocity),
                &velocity,
                &gravity_body,
            );
            debug_assert_eq!(joints.len(), 3);
            leg.factor(three(added));
            composite = composite.plus(&inertia);
            bias = bias.plus(&force);
            leg
        });

        // I_A = I_0 - sum F G, only the lower triangle.
        let mut articulated = lower_triangle(&composite);
        for leg in &legs {
            for j in 0..6 {
                for i in j..6 {
                    articulated[(i, j)] -= leg.coupling[(i, 0)] * leg.gain[(0, j)]
                        + leg.coupling[(i, 1)] * leg.gain[(1, j)]
                        + leg.coupling[(i, 2)] * leg.gain[(2, j)];
                }
            }
        }
        let factor_diagonal_inverse = cholesky(&mut articulated);
        Dynamics {
            legs,
            composite,
            bias: Vector6::new(
                bias.linear.x,
                bias.linear.y,
                bias.linear.z,
                bias.angular.x,
                bias.angular.y,
                bias.angular.z,
            ),
            factor: articulated,
            factor_diagonal_inverse,
        }
    }

    /// a = M^-1 ([0; tau] - b).
    pub fn acceleration(&self, torque: &Joints) -> Acceleration {
        // z_l = H_l^-1 (tau_l - c_l);  I_A a_0 = -b_0 - sum F_l z_l;  ddq_l = z_l - G_l a_0
        let mut free = [Vector3::zeros(); LEGS];
        let mut right = -self.bias;
        for (l, leg) in self.legs.iter().enumerate() {
            let u = Vector3::new(torque[3 * l], torque[3 * l + 1], torque[3 * l + 2]) - leg.bias;
            free[l] = leg.solve(&u);
            right -= leg.coupling * free[l];
        }
        let trunk = self.solve_trunk(&right);
        let mut joint = Joints::default();
        for (l, leg) in self.legs.iter().enumerate() {
            let ddq = free[l] - leg.gain * trunk;
            joint[3 * l..3 * l + 3].copy_from_slice(ddq.as_slice());
        }
        Acceleration {
            linear_body: trunk.fixed_rows::<3>(0).into(),
            angular_body: trunk.fixed_rows::<3>(3).into(),
            joint,
        }
    }

    /// I_A^-1 x = L^-T L^-1 x.
    #[inline]
    pub fn solve_trunk(&self, x: &Vector6<f64>) -> Vector6<f64> {
        self.solve_upper(&self.solve_lower(x))
    }

    /// L^-1 x.
    #[inline]
    pub fn solve_lower(&self, x: &Vector6<f64>) -> Vector6<f64> {
        let mut y = *x;
        for j in 0..6 {
            y[j] *= self.factor_diagonal_inverse[j];
            for i in j + 1..6 {
                y[i] -= self.factor[(i, j)] * y[j];
            }
        }
        y
    }

    /// L^-1 X, three columns at once.
    #[inline]
    pub fn solve_lower_columns(&self, mut x: Matrix6x3) -> Matrix6x3 {
        for k in 0..3 {
            for j in 0..6 {
                x[(j, k)] *= self.factor_diagonal_inverse[j];
                for i in j + 1..6 {
                    x[(i, k)] -= self.factor[(i, j)] * x[(j, k)];
                }
            }
        }
        x
    }

    /// L^-T x.
    #[inline]
    pub fn solve_upper(&self, x: &Vector6<f64>) -> Vector6<f64> {
        let mut y = *x;
        for j in (0..6).rev() {
            for i in j + 1..6 {
                y[j] -= self.factor[(i, j)] * y[i];
            }
            y[j] *= self.factor_diagonal_inverse[j];
        }
        y
    }
}

/// The lower triangle of a spatial inertia as a 6x6 matrix, linear part first: [[m 1, -hx], [hx, I]].
fn lower_triangle(inertia: &Inertia) -> Matrix6<f64> {
    let (m, h, i) = (inertia.mass, &inertia.first, &inertia.second);
    #[rustfmt::skip]
    let matrix = Matrix6::new(
        m,    0.0,  0.0,  0.0,  0.0,  0.0,
        0.0,  m,    0.0,  0.0,  0.0,  0.0,
        0.0,  0.0,  m,    0.0,  0.0,  0.0,
        0.0,  -h.z, h.y,  i.xx, 0.0,  0.0,
        h.z,  0.0,  -h.x, i.xy, i.yy, 0.0,
        -h.y, h.x,  0.0,  i.xz, i.yz, i.zz,
    );
    matrix
}

/// A = L L^T in place (lower triangle); returns the reciprocals of the diagonal of L.
#[inline]
fn cholesky(a: &mut Matrix6<f64>) -> Vector6<f64> {
    let mut inverse = Vector6::zeros();
    for j in 0..6 {
        let d = 1.0 / a[(j, j)].sqrt();
        inverse[j] = d;
        for i in j..6 {
            a[(i, j)] *= d;
        }
        for k in j + 1..6 {
            for i in k..6 {
                a[(i, k)] -= a[(i, j)] * a[(k, j)];
            }
        }
    }
    inverse
}
