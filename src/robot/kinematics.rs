//! Closed-form kinematics of one leg: hip about x, thigh and calf about y. Pure functions.
//!
//! Source: `docs/method.md`, "Frames and signs", with side s = +1 left, -1 right:
//! a = l2 cos q2 + l3 cos(q2 + q3);  x = -l2 sin q2 - l3 sin(q2 + q3);
//! y = s l1 cos q1 + a sin q1;  z = s l1 sin q1 - a cos q1.

use libm::{acos, atan2, sincos};
use nalgebra::{Matrix3, Vector3};

use super::{Joints, Leg};

/// Lengths of a leg, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegGeometry {
    /// From the hip joint sideways to the thigh joint, l1.
    pub abduction: f64,
    /// From the thigh joint to the calf joint, l2.
    pub thigh: f64,
    /// From the calf joint to the centre of the foot, l3.
    pub calf: f64,
}

/// Position of the centre of a foot and its derivative with respect to the joint angles, leg frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FootPosition {
    /// Position in the leg frame, m.
    pub position_leg: Vector3<f64>,
    /// Jacobian d position / d q, m/rad; rows x, y, z, columns hip, thigh, calf.
    pub jacobian_leg: Matrix3<f64>,
}

/// A point that the leg cannot reach.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the foot cannot be at ({:.3}, {:.3}, {:.3}) m in the leg frame: it is {reason}", position_leg.x, position_leg.y, position_leg.z)]
pub struct Unreachable {
    /// The requested point, m.
    pub position_leg: Vector3<f64>,
    /// The reason.
    pub reason: &'static str,
}

impl LegGeometry {
    /// Returns foot position and Jacobian at the joint angles `q` (hip, thigh, calf; rad) of a leg on `side` (+1 left,
    /// -1 right).
    pub fn foot(&self, q: &Vector3<f64>, side: f64) -> FootPosition {
        let (s1, c1) = sincos(q.x);
        let (s2, c2) = sincos(q.y);
        let (s23, c23) = sincos(q.y + q.z);
        let l1 = side * self.abduction;
        // In the plane of the leg the foot is a below and w behind the thigh joint.
        let a = self.thigh * c2 + self.calf * c23;
        let w = self.thigh * s2 + self.calf * s23;
        let (calf_c, calf_s) = (self.calf * c23, self.calf * s23);
        FootPosition {
            position_leg: Vector3::new(-w, l1 * c1 + a * s1, l1 * s1 - a * c1),
            #[rustfmt::skip]
            jacobian_leg: Matrix3::new(
                0.0,               -a,      -calf_c,
                -l1 * s1 + a * c1, -s1 * w, -s1 * calf_s,
                l1 * c1 + a * s1,  c1 * w,  c1 * calf_s,
            ),
        }
    }

    /// Returns the joint angles for the foot at `position_leg` (m), with the knee backwards (calf angle negative) and
    /// the foot below the hip axis.
    ///
    /// # Errors
    /// The point is farther than the stretched leg, or nearer than the abduction link or the folded leg allows.
    pub fn inverse(&self, position_leg: &Vector3<f64>, side: f64) -> Result<Vector3<f64>, Unreachable> {
        let unreachable = |reason| Unreachable { position_leg: *position_leg, reason };
        let [x, y, z] = (*position_leg).into();
        // In the plane across the hip axis the foot is at distance sqrt(l1^2 + a^2).
        let a_squared = y * y + z * z - self.abduction * self.abduction;
        if a_squared < 0.0 {
            return Err(unreachable("nearer to the hip axis than the abduction link is long"));
        }
        let a = a_squared.sqrt();
        let l1 = side * self.abduction;
        // (y, z) is (l1, -a) turned by q1 about x.
        let hip = atan2(z, y) - atan2(-a, l1);
        let hip = (hip + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        // Cosine rule at the knee.
        let (l2, l3) = (self.thigh, self.calf);
        let reach_squared = x * x + a_squared;
        let cos_calf = (reach_squared - l2 * l2 - l3 * l3) / (2.0 * l2 * l3);
        if cos_calf > 1.0 {
            return Err(unreachable("farther than the stretched leg"));
        }
        if cos_calf < -1.0 {
            return Err(unreachable("nearer than the folded leg"));
        }
        let calf = -acos(cos_calf);
        // (-x, a) = (l2 sin q2 + l3 sin(q2+q3), l2 cos q2 + l3 cos(q2+q3)).
        let (calf_sin, calf_cos) = sincos(calf);
        let thigh = atan2(-x, a) - atan2(l3 * calf_sin, l2 + l3 * calf_cos);
        Ok(Vector3::new(hip, thigh, calf))
    }

    /// Returns the joint angles for all feet at `foot_leg` (m) in their leg frames, y mirrored for right legs. A leg
    /// that cannot reach the point keeps its angles of `otherwise`.
    pub fn stance(&self, foot_leg: &Vector3<f64>, otherwise: &Joints) -> Joints {
        let mut joints = *otherwise;
        for leg in Leg::ALL {
            if let Ok(q) = self.inverse(&leg.mirrored(foot_leg), leg.left_sign()) {
                joints[3 * leg as usize..][..3].copy_from_slice(q.as_slice());
            }
        }
        joints
    }
}
