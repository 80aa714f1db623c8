//! The probability of standing at a point: a Gaussian-process classifier of trials with and without a fall.
//!
//! A fall carries information about the boundary, not about the objective. So the boundary is learned separately and
//! the improvement is weighted by the probability of standing, as Gelbart, Snoek and Adams do for unknown constraints
//! ("Bayesian optimization with unknown constraints", UAI 2014). Laplace approximation with a logistic likelihood:
//! Rasmussen and Williams (R&W), algorithms 3.1 and 3.2. The kernel is a Matern 5/2 for the shape of the boundary plus a
//! linear trend (R&W 4.2.2), because falls become likelier with a harder push.

use super::process::Hyperparameters;
use libm::{exp, log, log1p, sqrt};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::f64::consts::PI;

/// Lengthscales that are tried, as shares of the range; the setting with the largest evidence is used.
const LENGTHSCALES: [f64; 5] = [0.1, 0.2, 0.4, 0.8, 1.6];
/// Variances of the latent function that are tried: probabilities near the prior, or far from it.
const SIGNALS: [f64; 2] = [1.0, 9.0];
/// Variances of the trend's slope that are tried, per unit of the cube: no trend, or one that is nearly certain from one
/// side to the other.
const TRENDS: [f64; 2] = [0.0, 50.0];

/// The probability of standing, as a function of the point.
#[derive(Debug, Clone)]
pub struct StandProbability {
    points: Vec<Vec<f64>>,
    hyper: Hyperparameters,
    /// Variance of the linear trend's slope.
    trend: f64,
    /// Latent mean far from all points: the log odds of standing over all trials.
    prior: f64,
    /// Gradient of ln p(y|f) at the mode.
    gradient: DVector<f64>,
    /// W^(1/2), W the negative Hessian of ln p(y|f) at the mode.
    root_w: DVector<f64>,
    /// The factor of I + W^(1/2) K W^(1/2).
    factor: Cholesky<f64, Dyn>,
}

impl StandProbability {
    /// Fits points of the unit cube; `stood`: whether each ended without a fall. `None` if no trial has fallen.
    pub fn fit(points: &[Vec<f64>], stood: &[bool]) -> Option<Self> {
        let stands = stood.iter().filter(|s| **s).count() as f64;
        let falls = stood.len() as f64 - stands;
        if falls == 0.0 {
            return None;
        }
        // One pseudo-observation of each kind keeps the odds finite.
        let prior = log((stands + 1.0) / (falls + 1.0));
        let settings = LENGTHSCALES
            .iter()
            .flat_map(|l| SIGNALS.iter().flat_map(move |s| TRENDS.iter().map(move |t| (*l, *s, *t))));
        let fits = settings.filter_map(|setting| Self::laplace(points, stood, setting, prior));
        fits.reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(fit, _)| fit)
    }

    /// The Laplace approximation for one (lengthscale, signal, trend), with the logarithm of its evidence.
    fn laplace(
        points: &[Vec<f64>],
        stood: &[bool],
        (lengthscale, signal, trend): (f64, f64, f64),
        prior: f64,
    ) -> Option<(Self, f64)> {
        let n = points.len();
        let d = points.first()?.len();
        let hyper = Hyperparameters { lengthscale: vec![lengthscale; d], signal, noise: 0.0 };
        let k = DMatrix::from_fn(n, n, |i, j| kernel(&hyper, trend, &points[i], &points[j]));
        let target = DVector::from_iterator(n, stood.iter().map(|s| f64::from(u8::from(*s))));
        let mut latent = DVector::from_element(n, prior);
        let mut objective = f64::NEG_INFINITY;
        for _ in 0..50 {
            let probability = latent.map(sigmoid);
            let gradient = &target - &probability;
            let w = probability.map(|p| (p * (1.0 - p)).max(1e-12));
            let root_w = w.map(sqrt);
            // B = I + W^(1/2) K W^(1/2)
            let b_matrix =
                DMatrix::from_fn(n, n, |i, j| root_w[i] * k[(i, j)] * root_w[j] + f64::from(u8::from(i == j)));
            let factor = Cholesky::new(b_matrix)?;
            // b = W (f - m) + grad,  a = b - W^(1/2) B^-1 W^(1/2) K b,  f = m + K a
            let b = w.component_mul(&latent.add_scalar(-prior)) + &gradient;
            let a = &b - root_w.component_mul(&factor.solve(&root_w.component_mul(&(&k * &b))));
            latent = (&k * &a).add_scalar(prior);
            // psi = -a'(f - m)/2 + ln p(y|f)
            let log_likelihood: f64 =
                latent.iter().zip(stood).map(|(f, s)| -log1p(exp(if *s { -f } else { *f }))).sum();
            let next = -0.5 * a.dot(&latent.add_scalar(-prior)) + log_likelihood;
            if (next - objective).abs() < 1e-9 {
                // ln q(y) = psi - sum ln L_ii   (R&W 3.32)
                let evidence = next - (0..n).map(|i| log(factor.l_dirty()[(i, i)])).sum::<f64>();
                let fit = StandProbability { points: points.to_vec(), hyper, trend, prior, gradient, root_w, factor };
                return Some((fit, evidence));
            }
            objective = next;
        }
        None
    }

    /// The probability of standing at `x`, averaged over the uncertainty of the latent function.
    pub fn probability(&self, x: &[f64]) -> f64 {
        let k = self.points.iter().map(|p| kernel(&self.hyper, self.trend, p, x));
        let k = DVector::from_iterator(self.points.len(), k);
        let mean = self.prior + k.dot(&self.gradient);
        // v = L^-1 W^(1/2) k,  variance = k(x,x) - v'v   (R&W algorithm 3.2)
        let weighted = self.root_w.component_mul(&k);
        let v = self.factor.l_dirty().solve_lower_triangular(&weighted).unwrap_or(weighted);
        let variance = (kernel(&self.hyper, self.trend, x, x) - v.dot(&v)).max(0.0);
        // MacKay's approximation of the averaged sigmoid (Neural Computation 4, 1992)
        sigmoid(mean / sqrt(1.0 + PI * variance / 8.0))
    }
}

/// Matern 5/2 plus the linear trend about the cube's centre.
fn kernel(hyper: &Hyperparameters, trend: f64, a: &[f64], b: &[f64]) -> f64 {
    let product: f64 = a.iter().zip(b).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
    hyper.kernel(a, b) + trend * product
}

fn sigmoid(f: f64) -> f64 {
    1.0 / (1.0 + exp(-f))
}
