//! The probability of standing at a point: a Gaussian-process classifier of trials with and without a fall.
//!
//! A fall carries information about the boundary, not about the objective. So the boundary is learned separately and
//! the improvement is weighted by the probability of standing, as Gelbart, Snoek and Adams do for unknown constraints
//! ("Bayesian optimization with unknown constraints", UAI 2014), by a Laplace approximation ([`super::laplace`]). The kernel is a
//! Matern 5/2 for the shape of the boundary plus a linear trend (Rasmussen and Williams, 4.2.2), because falls become likelier with a
//! harder push.

use super::laplace::Laplace;
use super::regression::Hyperparameters;
use libm::log;
use nalgebra::{DMatrix, DVector};

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
    laplace: Laplace,
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
        fits.reduce(|a, b| if b.laplace.log_evidence > a.laplace.log_evidence { b } else { a })
    }

    /// The Laplace approximation for one (lengthscale, signal, trend).
    fn laplace(
        points: &[Vec<f64>],
        stood: &[bool],
        (lengthscale, signal, trend): (f64, f64, f64),
        prior: f64,
    ) -> Option<Self> {
        let n = points.len();
        let d = points.first()?.len();
        let hyper = Hyperparameters { lengthscale: vec![lengthscale; d], signal, noise: 0.0 };
        let k = DMatrix::from_fn(n, n, |i, j| kernel(&hyper, trend, &points[i], &points[j]));
        let laplace = Laplace::fit(&k, &DVector::from_element(n, prior), stood)?;
        Some(StandProbability { points: points.to_vec(), hyper, trend, prior, laplace })
    }

    /// The probability of standing at `x`, averaged over the uncertainty of the latent function.
    pub fn probability(&self, x: &[f64]) -> f64 {
        let k = self.points.iter().map(|p| kernel(&self.hyper, self.trend, p, x));
        let k = DVector::from_iterator(self.points.len(), k);
        self.laplace.probability(self.prior, &k, kernel(&self.hyper, self.trend, x, x))
    }
}

/// Matern 5/2 plus the linear trend about the cube's centre.
fn kernel(hyper: &Hyperparameters, trend: f64, a: &[f64], b: &[f64]) -> f64 {
    let product: f64 = a.iter().zip(b).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
    hyper.kernel(a, b) + trend * product
}
