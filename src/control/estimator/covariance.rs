//! The filter's covariance; symmetric, so only its lower blocks are computed.

use nalgebra::{Matrix3, SMatrix};

/// Three columns: covariance of the whole state with three numbers.
pub type Columns<const N: usize> = SMatrix<f64, N, 3>;

/// A symmetric N x N matrix, N a multiple of three. Only its 3 x 3 blocks on and below the diagonal are stored. The index of a
/// block is that of its first row or column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance<const N: usize> {
    columns: [[f64; N]; N],
}

impl<const N: usize> Covariance<N> {
    /// The zero matrix.
    pub fn zeros() -> Self {
        Covariance { columns: [[0.0; N]; N] }
    }

    /// Adds to the variance of the three states from `at` on.
    pub fn add_variance(&mut self, at: usize, variance: f64) {
        for i in at..at + 3 {
            self.columns[i][i] += variance;
        }
    }

    /// Adds to the covariance of two states. The block of `row` is below that of `column`, or both are the same state.
    pub fn add(&mut self, row: usize, column: usize, covariance: f64) {
        self.columns[column][row] += covariance;
    }

    /// The columns of the three states from `at` on, whole.
    pub fn columns(&self, at: usize) -> Columns<N> {
        let mut whole = Columns::zeros();
        for (k, column) in whole.data.0.iter_mut().enumerate() {
            for (element, row) in column[..at].iter_mut().zip(&self.columns) {
                *element = row[at + k];
            }
            column[at..].copy_from_slice(&self.columns[at + k][at..]);
        }
        whole
    }

    /// Sets these columns, and by symmetry these rows.
    pub fn set_columns(&mut self, at: usize, columns: &Columns<N>) {
        for k in 0..3 {
            for i in 0..at {
                self.columns[i][at + k] = columns[(i, k)];
            }
            for i in at..N {
                self.columns[at + k][i] = columns[(i, k)];
            }
        }
    }

    /// P <- P - U U^T. A block on the diagonal stays symmetric to the bit.
    pub fn subtract_square(&mut self, u: &Columns<N>) {
        let [u0, u1, u2] = &u.data.0;
        // Three columns at a time, so that each number of U is loaded once.
        for (block, [a, b, c]) in self.columns.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let at = 3 * block;
            let [va, vb, vc] = [at, at + 1, at + 2].map(|j| [u0[j], u1[j], u2[j]]);
            for i in at..N {
                let product = |v: [f64; 3]| u0[i] * v[0] + u1[i] * v[1] + u2[i] * v[2];
                a[i] -= product(va);
                b[i] -= product(vb);
                c[i] -= product(vc);
            }
        }
    }

    /// P <- F P F^T, where F is the identity but for two blocks: d(position)/d(velocity) = `dt_s`, d(velocity)/d(bias) = `turned`.
    /// The indices ascend in this order.
    pub fn carry(&mut self, [position, velocity, bias]: [usize; 3], dt_s: f64, turned: &Matrix3<f64>) {
        // The two column blocks of P F^T that differ from P's, then their rows in F (P F^T); the rest follows by symmetry.
        let (of_velocity, of_bias) = (self.columns(velocity), self.columns(bias));
        let mut to_position = self.columns(position) + of_velocity * dt_s;
        let mut to_velocity = of_velocity + of_bias * turned.transpose();
        for columns in [&mut to_position, &mut to_velocity] {
            let (v, b) = (block(columns, velocity), block(columns, bias));
            let mut rows = columns.fixed_rows_mut::<3>(position);
            rows += v * dt_s;
            let mut rows = columns.fixed_rows_mut::<3>(velocity);
            rows += turned * b;
        }
        // Rounding would make the blocks on the diagonal asymmetric.
        for (columns, at) in [(&mut to_position, position), (&mut to_velocity, velocity)] {
            let mut square = block(columns, at);
            square.fill_upper_triangle_with_lower_triangle();
            columns.fixed_rows_mut::<3>(at).copy_from(&square);
        }
        self.set_columns(velocity, &to_velocity);
        self.set_columns(position, &to_position);
    }
}

/// The rows of three states.
fn block<const N: usize>(columns: &Columns<N>, at: usize) -> Matrix3<f64> {
    columns.fixed_rows::<3>(at).into_owned()
}
