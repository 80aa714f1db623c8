//! Vectors and symmetric matrices of six: velocities of the trunk, the rows of a leg.

use nalgebra::{Scalar, Vector3};

use super::spatial::Real;

/// A six-vector. A plain array, which the compiler vectorizes.
pub(super) type Six = [f64; 6];

/// Joins linear and angular part.
#[inline(always)]
pub(super) fn stack<T: Scalar + Copy>(linear: &Vector3<T>, angular: &Vector3<T>) -> [T; 6] {
    [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
}

/// Returns linear and angular part.
#[inline]
pub(super) fn split(six: &Six) -> (Vector3<f64>, Vector3<f64>) {
    (Vector3::new(six[0], six[1], six[2]), Vector3::new(six[3], six[4], six[5]))
}

/// a . b; of lanes, each by its own.
#[inline(always)]
pub(super) fn dot<T: Real>(a: &[T; 6], b: &[T; 6]) -> T {
    (a[0] * b[0] + a[2] * b[2] + a[4] * b[4]) + (a[1] * b[1] + a[3] * b[3] + a[5] * b[5])
}

/// y += s x
#[inline(always)]
pub(super) fn add_scaled(y: &mut Six, x: &Six, s: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}

/// L of a symmetric positive matrix A = L L^T.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cholesky6 {
    /// L by columns; those above the diagonal are undefined.
    columns: [Six; 6],
    diagonal_inverse: Six,
}

impl Cholesky6 {
    /// Factor of the identity.
    pub const IDENTITY: Cholesky6 = Cholesky6 {
        columns: [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ],
        diagonal_inverse: [1.0; 6],
    };

    /// Factors a matrix of which only the lower triangle, by columns, is used.
    #[inline(always)]
    pub fn new(mut a: [Six; 6]) -> Cholesky6 {
        let mut diagonal_inverse = [0.0; 6];
        for j in 0..6 {
            let d = 1.0 / a[j][j].sqrt();
            diagonal_inverse[j] = d;
            for x in &mut a[j][j..] {
                *x *= d;
            }
            for k in j + 1..6 {
                for i in k..6 {
                    a[k][i] -= a[j][i] * a[j][k];
                }
            }
        }
        Cholesky6 { columns: a, diagonal_inverse }
    }

    /// Replaces x by L^-1 x; of lanes, each by its own.
    #[inline(always)]
    pub fn solve_lower<T: Real>(&self, x: &mut [T; 6]) {
        for j in 0..6 {
            let solved = x[j] * x[j].splat(self.diagonal_inverse[j]);
            x[j] = solved;
            for (x, l) in x[j + 1..].iter_mut().zip(&self.columns[j][j + 1..]) {
                *x -= solved.splat(*l) * solved;
            }
        }
    }

    /// Replaces x by L^-T x.
    #[inline(always)]
    pub fn solve_upper(&self, x: &mut Six) {
        for j in (0..6).rev() {
            for i in j + 1..6 {
                x[j] -= self.columns[j][i] * x[i];
            }
            x[j] *= self.diagonal_inverse[j];
        }
    }
}
