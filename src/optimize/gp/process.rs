//! Gaussian-process regression with a Matern 5/2 kernel, a lengthscale per coordinate and an estimated noise.
//!
//! Rasmussen and Williams, "Gaussian Processes for Machine Learning", MIT Press 2006 (R&W below): algorithm 2.1,
//! equations 4.17 and 5.9. Coordinates are scaled to the unit cube, values to mean 0 and variance 1.

use super::ascent;
use libm::{exp, log, sqrt};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::f64::consts::PI;

/// ln of the lengthscales' prior median and its width.
const LENGTHSCALE_PRIOR: (f64, f64) = (-0.35, 0.5);
/// ln of the signal variance's prior median and its width.
const SIGNAL_PRIOR: (f64, f64) = (0.0, 1.0);
/// ln of the noise variance's prior median and its width.
const NOISE_PRIOR: (f64, f64) = (-7.0, 2.0);

/// Hyperparameters of the kernel and of the noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Hyperparameters {
    /// l_d, per coordinate, as a share of its range.
    pub lengthscale: Vec<f64>,
    /// s^2, variance of the function.
    pub signal: f64,
    /// Variance of the noise.
    pub noise: f64,
}

impl Hyperparameters {
    fn from_log(theta: &[f64]) -> Self {
        let d = theta.len() - 2;
        let lengthscale = theta[..d].iter().map(|t| exp(*t)).collect();
        Hyperparameters { lengthscale, signal: exp(theta[d]), noise: exp(theta[d + 1]) }
    }

    /// k(x, x') = s^2 (1 + sqrt(5) r + 5/3 r^2) exp(-sqrt(5) r),  r^2 = sum ((x_d - x'_d) / l_d)^2   (R&W 4.17)
    pub fn kernel(&self, a: &[f64], b: &[f64]) -> f64 {
        let r2: f64 = a.iter().zip(b).zip(&self.lengthscale).map(|((a, b), l)| ((a - b) / l) * ((a - b) / l)).sum();
        let q = sqrt(5.0 * r2);
        self.signal * (1.0 + q + q * q / 3.0) * exp(-q)
    }

    /// K + noise I of the points.
    fn covariance(&self, points: &[Vec<f64>]) -> DMatrix<f64> {
        let n = points.len();
        let mut k = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                k[(i, j)] = self.kernel(&points[i], &points[j]);
                k[(j, i)] = k[(i, j)];
            }
            k[(i, i)] += self.noise;
        }
        k
    }
}

/// A Gaussian process conditioned on observed values.
#[derive(Debug, Clone)]
pub struct GaussianProcess {
    points: Vec<Vec<f64>>,
    hyper: Hyperparameters,
    factor: Cholesky<f64, Dyn>,
    /// alpha = (K + noise I)^-1 y
    alpha: DVector<f64>,
    mean: f64,
    deviation: f64,
}

impl GaussianProcess {
    /// Fits the hyperparameters (maximum a posteriori) and conditions on the values. `points` lie in the unit cube.
    /// `None` if there are no points or the covariance cannot be factored.
    pub fn fit(points: Vec<Vec<f64>>, values: &[f64]) -> Option<Self> {
        let d = points.first()?.len();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
        let deviation = if variance > 0.0 { sqrt(variance) } else { 1.0 };
        let y = DVector::from_iterator(values.len(), values.iter().map(|v| (v - mean) / deviation));
        let mut bounds = vec![(log(0.03), log(20.0)); d];
        bounds.extend([(log(0.05), log(20.0)), (log(1e-7), log(0.5))]);
        let posterior = |theta: &[f64]| log_posterior(theta, &points, &y);
        // Two starts, smooth with little noise and rough with more; the better optimum counts.
        let starts = [(log(0.7), log(1e-4)), (log(0.25), log(1e-2))];
        let summit = starts.map(|(lengthscale, noise)| {
            let mut start = vec![lengthscale; d];
            start.extend([0.0, noise]);
            ascent::maximize(posterior, &start, &bounds, 60)
        });
        let (theta, _) = summit.into_iter().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
        Self::condition(points, &y, Hyperparameters::from_log(&theta), mean, deviation)
    }

    fn condition(
        points: Vec<Vec<f64>>,
        y: &DVector<f64>,
        hyper: Hyperparameters,
        mean: f64,
        deviation: f64,
    ) -> Option<Self> {
        let factor = Cholesky::new(hyper.covariance(&points))?;
        let alpha = factor.solve(y);
        Some(GaussianProcess { points, hyper, factor, alpha, mean, deviation })
    }

    /// Conditions on the expected value at each pending point ("kriging believer", Ginsbourger et al. 2010): the mean
    /// stays, the uncertainty around the points vanishes.
    pub fn believing(self, pending: &[Vec<f64>]) -> Option<Self> {
        if pending.is_empty() {
            return Some(self);
        }
        let y = self.hyper.covariance(&self.points) * &self.alpha;
        let expected = pending.iter().map(|x| (self.predict(x).0 - self.mean) / self.deviation);
        let y = DVector::from_iterator(y.len() + pending.len(), y.iter().copied().chain(expected));
        let points = self.points.into_iter().chain(pending.iter().cloned()).collect();
        Self::condition(points, &y, self.hyper, self.mean, self.deviation)
    }

    /// Mean and standard deviation of the function (without noise) at `x`, in the values' own unit.
    pub fn predict(&self, x: &[f64]) -> (f64, f64) {
        let k = DVector::from_iterator(self.points.len(), self.points.iter().map(|p| self.hyper.kernel(p, x)));
        // mu = k' alpha,  v = L^-1 k,  sigma^2 = k(x,x) - v'v   (R&W algorithm 2.1)
        let mean = k.dot(&self.alpha);
        let v = self.factor.l_dirty().solve_lower_triangular(&k).unwrap_or(k);
        let variance = (self.hyper.signal - v.dot(&v)).max(1e-12 * self.hyper.signal);
        (self.mean + self.deviation * mean, self.deviation * sqrt(variance))
    }

    /// The fitted hyperparameters.
    pub fn hyperparameters(&self) -> &Hyperparameters {
        &self.hyper
    }

    /// Observed points, pending ones included after [`Self::believing`].
    pub fn points(&self) -> &[Vec<f64>] {
        &self.points
    }
}

/// ln p(y | X, theta) + ln p(theta) up to a constant, and its gradient; theta = ln (l_1 .. l_d, s^2, noise).
fn log_posterior(theta: &[f64], points: &[Vec<f64>], y: &DVector<f64>) -> (f64, Vec<f64>) {
    let (n, d) = (points.len(), theta.len() - 2);
    let hyper = Hyperparameters::from_log(theta);
    let Some(factor) = Cholesky::new(hyper.covariance(points)) else {
        return (f64::NEG_INFINITY, vec![0.0; theta.len()]);
    };
    let alpha = factor.solve(y);
    // ln p = -y'alpha/2 - sum ln L_ii - n/2 ln(2 pi)   (R&W algorithm 2.1)
    let log_determinant: f64 = (0..n).map(|i| log(factor.l_dirty()[(i, i)])).sum();
    let mut value = -0.5 * y.dot(&alpha) - log_determinant - 0.5 * n as f64 * log(2.0 * PI);
    // d ln p/d theta_j = tr((alpha alpha' - K^-1) dK/d theta_j) / 2   (R&W 5.9)
    let inverse = factor.inverse();
    let mut gradient = vec![0.0; theta.len()];
    for i in 0..n {
        for j in 0..=i {
            let weight = (alpha[i] * alpha[j] - inverse[(i, j)]) * if i == j { 0.5 } else { 1.0 };
            if i == j {
                gradient[d] += weight * hyper.signal;
                gradient[d + 1] += weight * hyper.noise;
                continue;
            }
            let scaled = |c: usize| (points[i][c] - points[j][c]) / hyper.lengthscale[c];
            let r2: f64 = (0..d).map(|c| scaled(c) * scaled(c)).sum();
            let q = sqrt(5.0 * r2);
            let decay = hyper.signal * exp(-q);
            gradient[d] += weight * decay * (1.0 + q + q * q / 3.0);
            // dk/d ln l_d = 5/3 s^2 (1 + q) exp(-q) ((x_d - x'_d)/l_d)^2
            let slope = weight * 5.0 / 3.0 * decay * (1.0 + q);
            (0..d).for_each(|c| gradient[c] += slope * scaled(c) * scaled(c));
        }
    }
    let priors = std::iter::repeat_n(LENGTHSCALE_PRIOR, d).chain([SIGNAL_PRIOR, NOISE_PRIOR]);
    for (j, (median, width)) in priors.enumerate() {
        let z = (theta[j] - median) / width;
        value -= 0.5 * z * z;
        gradient[j] -= z / width;
    }
    (value, gradient)
}
