//! Regression of values of unknown scale: [`super::regression`] without linear terms. Coordinates are scaled to the unit cube,
//! values to mean 0 and variance 1.

use super::regression::{
    HyperPrior, Hyperparameters, LinearPrior, LogNormal, Observations, Regression, log_likelihood,
};
use libm::{exp2, floor, log, log2, sqrt};
use nalgebra::DVector;

/// A Gaussian process conditioned on observed values.
#[derive(Debug, Clone)]
pub struct GaussianProcess {
    regression: Regression,
    mean: f64,
    deviation: f64,
}

impl GaussianProcess {
    /// Fits the hyperparameters (maximum a posteriori) and conditions on the values. `points` lie in the unit cube.
    /// `None` if there are no points or the covariance cannot be factored.
    pub fn fit(points: Vec<Vec<f64>>, values: &[f64]) -> Option<Self> {
        let d = points.first()?.len();
        let unit = unit_of(values);
        let values: Vec<f64> = values.iter().map(|v| v / unit).collect();
        let (mean, variance) = mean_and_variance(&values);
        let deviation = if variance > 0.0 { sqrt(variance) } else { 1.0 / unit };
        let y = DVector::from_iterator(values.len(), values.iter().map(|v| (v - mean) / deviation));
        let likelihood = |theta: &[f64]| log_likelihood(theta, &points, &y, None);
        let (hyper, _) = hyper_prior().maximize(d, 60, likelihood)?;
        let terms = vec![Vec::new(); points.len()];
        let observed = Observations { points, terms, values: y.iter().copied().collect() };
        let regression = Regression::condition(observed, LinearPrior::default(), hyper)?;
        Some(GaussianProcess { regression, mean: mean * unit, deviation: deviation * unit })
    }

    /// Conditions on the expected value at each pending point; see [`Regression::believing`].
    pub fn believing(self, pending: &[Vec<f64>]) -> Option<Self> {
        let pending: Vec<(Vec<f64>, Vec<f64>)> = pending.iter().map(|x| (x.clone(), Vec::new())).collect();
        Some(GaussianProcess { regression: self.regression.believing(&pending)?, ..self })
    }

    /// Mean and standard deviation of the function (without noise) at `x`, in the values' own unit.
    pub fn predict(&self, x: &[f64]) -> (f64, f64) {
        let (mean, variance) = self.regression.predict(x, &[]);
        (self.mean + self.deviation * mean, self.deviation * sqrt(variance))
    }

    /// The fitted hyperparameters.
    pub fn hyperparameters(&self) -> &Hyperparameters {
        self.regression.hyperparameters()
    }

    /// Observed points, pending ones included after [`Self::believing`].
    pub fn points(&self) -> &[Vec<f64>] {
        self.regression.points()
    }
}

/// A power of two as the unit of values whose variance leaves the range of a double: their largest magnitude; else 1.
fn unit_of(values: &[f64]) -> f64 {
    if mean_and_variance(values).1.is_normal() {
        return 1.0;
    }
    let largest = values.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    if largest.is_normal() { exp2(floor(log2(largest))) } else { 1.0 }
}

fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n)
}

fn hyper_prior() -> HyperPrior {
    HyperPrior {
        lengthscale: LogNormal::new(-0.35, 0.5, (0.03, 20.0)),
        signal: LogNormal::new(0.0, 1.0, (0.05, 20.0)),
        noise: LogNormal::new(-7.0, 2.0, (1e-7, 0.5)),
        // Two starts, smooth with little noise and rough with more.
        starts: vec![[log(0.7), 0.0, log(1e-4)], [log(0.25), 0.0, log(1e-2)]],
    }
}
