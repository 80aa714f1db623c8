//! The contact law at one contact: the exact impulse while all other impulses are fixed.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::sim::config::ContactLaw;
use crate::sim::spatial::{Real, SymmetricMatrix};

/// One contact in the coordinates normal, tangent, tangent.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalProblem {
    law: ContactLaw,
    friction: f64,
    /// A = W W^T + U U^T: the contact's block of the Delassus matrix, and its inverse.
    pub delassus: Matrix3<f64>,
    delassus_inverse: Matrix3<f64>,
    /// Slip per tangential impulse, s in [`LocalProblem::solve`], at the end of the last search.
    slip_ratio: f64,
}

impl LocalProblem {
    pub fn new(law: ContactLaw, friction: f64, delassus: Matrix3<f64>, delassus_inverse: Matrix3<f64>) -> LocalProblem {
        LocalProblem { law, friction, delassus, delassus_inverse, slip_ratio: 0.0 }
    }

    /// Returns the impulse that satisfies the law while all other impulses stay, with the exceptions that the module
    /// `contact` names, and the largest component of the change of the velocity that it makes. `v` is the velocity with the
    /// impulse `p` of the last sweep.
    #[inline]
    pub fn solve(&mut self, v: &Vector3<f64>, p: &Vector3<f64>) -> (Vector3<f64>, f64) {
        // c = v - A p: velocity without the impulse.
        let m = &self.delassus;
        let c_normal = v.x - (m.m11 * p.x + m.m12 * p.y + m.m13 * p.z);
        if c_normal < 0.0 {
            // Sticking: v + A step = 0.
            let i = &self.delassus_inverse;
            let stick = Vector3::new(
                p.x - (i.m11 * v.x + i.m12 * v.y + i.m13 * v.z),
                p.y - (i.m12 * v.x + i.m22 * v.y + i.m23 * v.z),
                p.z - (i.m13 * v.x + i.m23 * v.y + i.m33 * v.z),
            );
            if self.holds(&stick) {
                self.slip_ratio = 0.0;
                return (stick, largest(v));
            }
        }
        let impulse = if c_normal < 0.0 { self.slide(&(v - self.delassus * p)) } else { Vector3::zeros() };
        (impulse, largest(&(self.delassus * (impulse - p))))
    }

    /// Returns whether the impulse is in the friction cone.
    #[inline]
    pub fn holds(&self, impulse: &Vector3<f64>) -> bool {
        let limit = self.friction * impulse.x;
        impulse.x >= 0.0 && impulse.y * impulse.y + impulse.z * impulse.z <= limit * limit
    }

    /// Returns the impulse of a sliding point when the velocity without it is `c`, with a normal component below zero.
    fn slide(&mut self, c: &Vector3<f64>) -> Vector3<f64> {
        let friction = self.friction;
        let a_nn = self.delassus.m11;
        if friction < 1e-9 {
            return Vector3::new(-c.x / a_nn, 0.0, 0.0);
        }
        // Sliding: v_t = -s p_t with s > 0 and |p_t| = mu p_n; v_n = 0 (Coulomb) or mu |v_t| = mu^2 s p_n (convex):
        //   (A + s D) p = -c,  D = diag(0 or -mu^2, 1, 1).
        let weight = match self.law {
            ContactLaw::Coulomb => 0.0,
            ContactLaw::Convex => -friction * friction,
        };
        let m = &self.delassus;
        // p(s), and dp/ds = -(A + s D)^-1 D p; none where A + s D is not positive definite: s is too large.
        let at = |s: f64| {
            let (xx, yy, zz) = (m.m11 + s * weight, m.m22 + s, m.m33 + s);
            let (cofactors, determinant) = SymmetricMatrix { xx, xy: m.m12, xz: m.m13, yy, yz: m.m23, zz }.cofactors();
            if xx <= 0.0 || determinant <= 0.0 {
                return None;
            }
            let scale = -1.0 / determinant;
            let p = cofactors.times(c) * scale;
            Some((p, cofactors.times(&Vector3::new(weight * p.x, p.y, p.z)) * scale))
        };
        // f(s) = |p_t| - mu p_n has a root in (0, high]: at 0 the impulse is outside the cone, at `high` inside.
        let a = Vector2::new(m.m12, m.m13);
        let d = Vector2::new(c.y, c.z) - a * (c.x / a_nn);
        let (mut low, mut high) = (0.0, d.norm() * (a_nn + friction * a.norm()) / (friction * -c.x));
        let mut s = if self.slip_ratio > low && self.slip_ratio < high { self.slip_ratio } else { 0.0 };
        let mut best = -(self.delassus_inverse * c);
        for _ in 0..60 {
            let Some((p, dp)) = at(s) else {
                high = s;
                s = 0.5 * (low + high);
                continue;
            };
            best = p;
            let size = (p.y * p.y + p.z * p.z).sqrt();
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
        self.slip_ratio = s;
        into_cone(&best, friction)
    }
}

/// Returns the largest component without sign.
#[inline]
fn largest(v: &Vector3<f64>) -> f64 {
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    larger(larger(v.x.abs(), v.y.abs()), v.z.abs())
}

/// Shortens the tangential part of the impulse to Coulomb's limit; returns zero for an impulse that pulls.
pub(super) fn into_cone(impulse: &Vector3<f64>, friction: f64) -> Vector3<f64> {
    if impulse.x <= 0.0 {
        return Vector3::zeros();
    }
    let size = (impulse.y * impulse.y + impulse.z * impulse.z).sqrt();
    let limit = friction * impulse.x;
    if size <= limit {
        return *impulse;
    }
    Vector3::new(impulse.x, impulse.y * limit / size, impulse.z * limit / size)
}

/// Returns the inverse of a symmetric positive matrix by cofactors; both by their elements 11, 12, 13, 22, 23, 33.
#[inline(always)]
pub(super) fn symmetric_inverse<T: Real>([xx, xy, xz, yy, yz, zz]: [T; 6]) -> [T; 6] {
    let (i, determinant) = SymmetricMatrix { xx, xy, xz, yy, yz, zz }.cofactors();
    let scale = xx.splat(1.0) / determinant;
    [i.xx, i.xy, i.xz, i.yy, i.yz, i.zz].map(|cofactor| cofactor * scale)
}

/// Returns the symmetric matrix with the elements 11, 12, 13, 22, 23, 33.
pub(super) fn symmetric([m11, m12, m13, m22, m23, m33]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(m11, m12, m13, m12, m22, m23, m13, m23, m33)
}
