//! The Sobol sequence: points that fill the unit cube more evenly than random ones.
//!
//! Direction numbers of Joe and Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J. Sci.
//! Comput. 30, 2008 (table new-joe-kuo-6.21201), in the Gray-code order of Antonov and Saleev, with a random digital
//! shift (Cranley-Patterson in base 2), which keeps every stratification.

use super::mt19937::Mt19937;

/// Bits of a coordinate.
const BITS: usize = 32;
/// Number of coordinates in the table.
pub const MAX_DIMENSIONS: usize = 10;

/// Primitive polynomial (degree is the number of initial values; inner coefficients as bits) and initial values m_i.
const TABLE: [(u32, &[u32]); MAX_DIMENSIONS - 1] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
];

/// A shifted Sobol sequence in [0, 1)^dimensions.
#[derive(Debug, Clone)]
pub struct Sobol {
    directions: Vec<[u32; BITS]>,
    shift: Vec<u32>,
}

impl Sobol {
    /// The sequence shifted by one draw of `stream` per dimension. Beyond [`MAX_DIMENSIONS`] the table's coordinates
    /// repeat with other shifts: even in each coordinate, not pairwise.
    pub fn new(dimensions: usize, stream: &mut Mt19937) -> Self {
        let directions = (0..dimensions).map(|d| direction_numbers(d % MAX_DIMENSIONS)).collect();
        let shift = (0..dimensions).map(|_| (stream.double() * f64::from(u32::MAX)) as u32).collect();
        Sobol { directions, shift }
    }

    /// Point number `index` of the sequence.
    pub fn point(&self, index: u32) -> Vec<f64> {
        // x_n = xor of v_j over the bits j of the Gray code of n
        let gray = index ^ (index >> 1);
        let coordinate = |(v, shift): (&[u32; BITS], &u32)| {
            let x = (0..BITS).filter(|j| gray >> j & 1 == 1).fold(*shift, |x, j| x ^ v[j]);
            f64::from(x) / 2.0_f64.powi(BITS as i32)
        };
        self.directions.iter().zip(&self.shift).map(coordinate).collect()
    }
}

fn direction_numbers(dimension: usize) -> [u32; BITS] {
    let mut v = [0; BITS];
    let Some((a, m)) = dimension.checked_sub(1).map(|d| TABLE[d]) else {
        // The first coordinate is van der Corput's sequence.
        (0..BITS).for_each(|i| v[i] = 1 << (BITS - 1 - i));
        return v;
    };
    let s = m.len();
    for i in 0..BITS {
        v[i] = if i < s {
            m[i] << (BITS - 1 - i)
        } else {
            // v_i = a_1 v_{i-1} xor ... xor a_{s-1} v_{i-s+1} xor v_{i-s} xor (v_{i-s} >> s)
            let first = v[i - s] ^ (v[i - s] >> s);
            (1..s).filter(|k| a >> (s - 1 - k) & 1 == 1).fold(first, |x, k| x ^ v[i - k])
        };
    }
    v
}
