//! The Parzen estimator of TPE: a mixture of product normals truncated to the search range, one per observation and one
//! broad prior.
//!
//! Bergstra et al., "Algorithms for hyper-parameter optimization", NeurIPS 2011; the weights and bandwidths are those of
//! Optuna 5. Coordinates are those of the search (logarithms for logarithmic parameters).

use super::mt19937::Mt19937;
use super::truncnorm::{HALF_LN_TWO_PI, log_mass, quantile};
use libm::{exp, log};

/// Number of newest observations with full weight.
const FULL_WEIGHT: usize = 25;

/// The kernels of one coordinate, one entry per kernel in each list.
#[derive(Debug, Clone)]
struct Axis {
    centre: Vec<f64>,
    bandwidth: Vec<f64>,
    /// (low - centre) / bandwidth
    a: Vec<f64>,
    /// (high - centre) / bandwidth
    b: Vec<f64>,
    /// ln(Phi(b) - Phi(a))
    log_mass: Vec<f64>,
    log_bandwidth: Vec<f64>,
}

/// A density over the search coordinates.
#[derive(Debug, Clone)]
pub struct Parzen {
    axes: Vec<Axis>,
    weight: Vec<f64>,
    log_weight: Vec<f64>,
}

impl Parzen {
    /// Fits the observations: `columns[p]` holds coordinate p of every observation, oldest first, and
    /// `bounds[p]` its search range. Observations outside the range are used unchanged.
    pub fn new(columns: &[Vec<f64>], bounds: &[(f64, f64)]) -> Self {
        let observations = columns.first().map_or(0, Vec::len);
        let mut weight = observation_weights(observations);
        weight.push(1.0); // the prior
        let sum: f64 = weight.iter().sum();
        weight.iter_mut().for_each(|w| *w /= sum);
        let log_weight = weight.iter().map(|w| log(*w)).collect();
        let axes = columns.iter().zip(bounds).map(|(column, &(low, high))| Axis::new(column, low, high)).collect();
        Parzen { axes, weight, log_weight }
    }

    /// Draws `count` points; `result[p][i]` is coordinate p of point i. Takes `count (1 + coordinates)` doubles: first
    /// the components, then coordinate by coordinate.
    pub fn sample(&self, stream: &mut Mt19937, count: usize) -> Vec<Vec<f64>> {
        let kernels: Vec<usize> = (0..count).map(|_| choose(&self.weight, stream)).collect();
        let draw =
            |axis: &Axis, k: usize, u: f64| quantile(u, axis.a[k], axis.b[k]) * axis.bandwidth[k] + axis.centre[k];
        self.axes.iter().map(|axis| kernels.iter().map(|&k| draw(axis, k, stream.double())).collect()).collect()
    }

    /// ln p(x) at each of the points `columns[p][i]`.
    pub fn log_density(&self, columns: &[Vec<f64>]) -> Vec<f64> {
        let points = columns.first().map_or(0, Vec::len);
        let mut terms = vec![0.0; self.weight.len()];
        (0..points)
            .map(|i| {
                terms.fill(0.0);
                for (axis, column) in self.axes.iter().zip(columns) {
                    axis.add_log_kernels(column[i], &mut terms);
                }
                terms.iter_mut().zip(&self.log_weight).for_each(|(t, w)| *t += w);
                log_sum_exp(&terms)
            })
            .collect()
    }

    /// The marginal density of coordinate `axis` at `x`, per unit of the search coordinate.
    pub fn marginal(&self, axis: usize, x: f64) -> f64 {
        let mut terms = self.log_weight.clone();
        self.axes[axis].add_log_kernels(x, &mut terms);
        exp(log_sum_exp(&terms))
    }
}

impl Axis {
    fn new(observations: &[f64], low: f64, high: f64) -> Self {
        let mut centre = observations.to_vec();
        let mut bandwidth = bandwidths(observations, low, high);
        centre.push(0.5 * (low + high)); // the prior
        bandwidth.push(high - low);
        let standardize =
            |bound: f64| -> Vec<f64> { centre.iter().zip(&bandwidth).map(|(m, s)| (bound - m) / s).collect() };
        let (a, b) = (standardize(low), standardize(high));
        let log_mass = a.iter().zip(&b).map(|(&a, &b)| log_mass(a, b)).collect();
        let log_bandwidth = bandwidth.iter().map(|s| log(*s)).collect();
        Axis { centre, bandwidth, a, b, log_mass, log_bandwidth }
    }

    /// Adds -z^2/2 - ln(2 pi)/2 - ln(Phi(b) - Phi(a)) - ln sigma, z = (x - mu)/sigma, to each kernel's term.
    fn add_log_kernels(&self, x: f64, terms: &mut [f64]) {
        for (k, term) in terms.iter_mut().enumerate() {
            let z = (x - self.centre[k]) / self.bandwidth[k];
            let log_kernel = -(z * z) / 2.0 - HALF_LN_TWO_PI - self.log_mass[k] - self.log_bandwidth[k];
            let inside = self.a[k] <= z && z <= self.b[k];
            *term += if inside { log_kernel } else { f64::NEG_INFINITY };
        }
    }
}

/// Draws an index with probability proportional to its weight: the number of cumulative shares that do not exceed u.
pub fn choose(weight: &[f64], stream: &mut Mt19937) -> usize {
    let u = stream.double();
    let total: f64 = weight.iter().fold(0.0, |sum, w| sum + w);
    let mut sum = 0.0;
    let not_above = |w: &&f64| {
        sum += **w;
        sum / total <= u
    };
    weight.iter().take_while(not_above).count().min(weight.len() - 1)
}

/// Weights of `m` observations, oldest first: 1 for the newest 25, a ramp from 1/m for the older ones.
pub fn observation_weights(m: usize) -> Vec<f64> {
    let old = m.saturating_sub(FULL_WEIGHT);
    let first = 1.0 / m as f64;
    let step = if old > 1 { (1.0 - first) / (old - 1) as f64 } else { 0.0 };
    let ramp = (0..old).map(|i| if old > 1 && i == old - 1 { 1.0 } else { i as f64 * step + first });
    ramp.chain(std::iter::repeat_n(1.0, m - old)).collect()
}

/// Bandwidth per observation: the distance to the farther of its two neighbours in the sorted list (a single observation
/// has the bounds as neighbours), clipped from below against spikes ("magic clip"). Equal values keep their order.
fn bandwidths(observations: &[f64], low: f64, high: f64) -> Vec<f64> {
    let m = observations.len();
    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&i, &j| observations[i].total_cmp(&observations[j]));
    let width = high - low;
    let narrowest = width / (m + 2).min(100) as f64;
    let mut result = vec![0.0; m];
    for (rank, &i) in order.iter().enumerate() {
        let below = (rank > 0).then(|| observations[i] - observations[order[rank - 1]]);
        let above = (rank + 1 < m).then(|| observations[order[rank + 1]] - observations[i]);
        let raw = match (below, above) {
            (Some(below), Some(above)) => below.max(above),
            (Some(only), None) | (None, Some(only)) => only,
            (None, None) => (observations[i] - low).max(high - observations[i]),
        };
        result[i] = raw.clamp(narrowest, width);
    }
    result
}

/// ln sum exp(terms), factored by the largest; negative infinity if all terms are.
fn log_sum_exp(terms: &[f64]) -> f64 {
    let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    // Terms below e^-50 of the largest do not change the last bit of a sum of thousands; most kernels are that far away.
    let share = |t: &f64| if t - largest < -50.0 { 0.0 } else { exp(t - largest) };
    log(terms.iter().map(share).sum::<f64>()) + largest
}
