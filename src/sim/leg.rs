//! Kinematics of the legs, one by one and in lanes, and their factors.

use nalgebra::{Matrix3, Scalar, Vector3};

use super::lanes::Quad;
use super::six::Six;
use super::spatial::{AxisRotation, Real};
use crate::robot::{LEGS, PerLeg};

/// Quantities of a leg from which its constraint rows are computed. `T` is a number per leg.
#[derive(Debug, Clone)]
pub(super) struct LegFactors<T: Scalar> {
    /// Rotation of the hip link about x.
    pub hip: AxisRotation<T>,
    /// Joint origins in the trunk's frame, m.
    pub origin_body: [Vector3<T>; 3],
    /// C^-1: inverse of the lower Cholesky factor of H: 11, 21, 22, 31, 32, 33.
    pub factor_inverse: [T; 6],
    /// G = H^-1 F^T: a row for each joint.
    pub gain: [[T; 6]; 3],
}

/// Positions of the links of one leg.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegLinks {
    hip: AxisRotation<f64>,
    thigh: AxisRotation<f64>,
    calf: AxisRotation<f64>,
    /// Joint origins in the trunk's frame, m.
    pub origin_body: [Vector3<f64>; 3],
}

/// Velocity of a point at `p_body` on the calf per joint velocity, body axes: a column for each joint. Of a point on another
/// link the caller takes the columns of the joints behind it as zero.
#[inline(always)]
pub(super) fn point_jacobian<T: Real>(
    hip: AxisRotation<T>,
    origin_body: &[Vector3<T>; 3],
    p_body: &Vector3<T>,
) -> [Vector3<T>; 3] {
    // Column j: e_j x (p - o_j);  e_1 = x, e_2 = e_3 = (0, cos q1, sin q1).
    let (c, s) = (hip.cos, hip.sin);
    let from = |o: &Vector3<T>| Vector3::new(p_body.x - o.x, p_body.y - o.y, p_body.z - o.z);
    let about_y = |r: Vector3<T>| Vector3::new(c * r.z - s * r.y, s * r.x, -c * r.x);
    let r1 = from(&origin_body[0]);
    let about_x = Vector3::new(c.splat(0.0), -r1.z, r1.y);
    [about_x, about_y(from(&origin_body[1])), about_y(from(&origin_body[2]))]
}

impl LegFactors<Quad> {
    /// Takes the legs `legs`, one for each lane.
    pub fn of_legs(&self, legs: [usize; LEGS]) -> LegFactors<Quad> {
        let pick = |x: Quad| Quad(legs.map(|leg| x.0[leg]));
        LegFactors {
            hip: self.hip.map(pick),
            origin_body: self.origin_body.map(|origin| origin.map(pick)),
            factor_inverse: self.factor_inverse.map(pick),
            gain: self.gain.map(|row| row.map(pick)),
        }
    }

    /// Row `joint` of G of one leg.
    pub fn gain_of(&self, leg: usize, joint: usize) -> Six {
        self.gain[joint].map(|x| x.0[leg])
    }

    /// Column `joint` of C^-1 of one leg.
    pub fn factor_column(&self, leg: usize, joint: usize) -> Vector3<f64> {
        let [i11, i21, i22, i31, i32, i33] = self.factor_inverse.map(|x| x.0[leg]);
        match joint {
            0 => Vector3::new(i11, i21, i31),
            1 => Vector3::new(0.0, i22, i32),
            _ => Vector3::new(0.0, 0.0, i33),
        }
    }
}

impl LegLinks {
    /// The legs one by one; `links` are the rotations of thigh and calf about the hip link's y.
    pub fn of(factors: &LegFactors<Quad>, links: [AxisRotation<Quad>; 2]) -> PerLeg<LegLinks> {
        let [thigh, calf] = links;
        std::array::from_fn(|leg| {
            let of_leg = |x: Quad| x.0[leg];
            LegLinks {
                hip: factors.hip.map(of_leg),
                thigh: thigh.map(of_leg),
                calf: calf.map(of_leg),
                origin_body: factors.origin_body.map(|origin| origin.map(of_leg)),
            }
        })
    }

    /// Velocity of a point at `p_body` on the calf per joint velocity, body axes.
    pub fn calf_jacobian(&self, p_body: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::from_columns(&point_jacobian(self.hip, &self.origin_body, p_body))
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
