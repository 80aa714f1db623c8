//! Gaussian-process regression about linear terms, with a Matern 5/2 kernel, a lengthscale per coordinate and an estimated noise.
//!
//! y = h(x)' beta + delta(x) + eps,  beta ~ N(b0, diag(L)),  delta ~ GP(0, s^2 M52),  eps ~ N(0, sigma^2).
//! The coefficients are integrated out, K = s^2 M52 + H diag(L) H' + sigma^2 I. Rasmussen and Williams, "Gaussian Processes for
//! Machine Learning", MIT Press 2006 (R&W below): section 2.7, algorithm 2.1, equations 4.17 and 5.9.

use super::ascent;
use libm::{exp, log, sqrt};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::f64::consts::PI;

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

/// Matern 5/2 of a signal variance at q = sqrt(5) r.
pub fn matern(signal: f64, q: f64) -> f64 {
    signal * (1.0 + q + q * q / 3.0) * exp(-q)
}

impl Hyperparameters {
    /// The hyperparameters of theta = ln (l_1 .. l_d, s^2, noise).
    pub fn from_log(theta: &[f64]) -> Self {
        let d = theta.len() - 2;
        let lengthscale = theta[..d].iter().map(|t| exp(*t)).collect();
        Hyperparameters { lengthscale, signal: exp(theta[d]), noise: exp(theta[d + 1]) }
    }

    /// theta = ln (l_1 .. l_d, s^2, noise)
    pub fn to_log(&self) -> Vec<f64> {
        self.lengthscale.iter().chain([&self.signal, &self.noise]).map(|value| log(*value)).collect()
    }

    /// k(x, x') = s^2 (1 + sqrt(5) r + 5/3 r^2) exp(-sqrt(5) r),  r^2 = sum ((x_d - x'_d) / l_d)^2   (R&W 4.17)
    pub fn kernel(&self, a: &[f64], b: &[f64]) -> f64 {
        matern(self.signal, self.distance(a, b))
    }

    /// sqrt(5) r
    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let r2: f64 = a.iter().zip(b).zip(&self.lengthscale).map(|((a, b), l)| ((a - b) / l) * ((a - b) / l)).sum();
        sqrt(5.0 * r2)
    }
}

/// Natural logarithms of a prior's median, its width, and the bounds of a hyperparameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogNormal {
    /// ln of the median.
    pub log_median: f64,
    /// Standard deviation of the logarithm.
    pub width: f64,
    /// ln of the smallest and the largest value that is tried.
    pub bounds: (f64, f64),
}

impl LogNormal {
    /// From ln of the median, the width, and the smallest and the largest value that is tried.
    pub fn new(log_median: f64, width: f64, (smallest, largest): (f64, f64)) -> LogNormal {
        LogNormal { log_median, width, bounds: (log(smallest), log(largest)) }
    }
}

/// Priors of the hyperparameters, and the points from which the ascent of their posterior starts.
#[derive(Debug, Clone, PartialEq)]
pub struct HyperPrior {
    /// Of each lengthscale.
    pub lengthscale: LogNormal,
    /// Of the signal's variance.
    pub signal: LogNormal,
    /// Of the noise's variance.
    pub noise: LogNormal,
    /// ln (lengthscale, signal, noise) of each start; the best optimum counts.
    pub starts: Vec<[f64; 3]>,
}

impl HyperPrior {
    /// The prior of each coordinate of theta = ln (l_1 .. l_d, s^2, noise).
    fn coordinates(&self, d: usize) -> impl Iterator<Item = LogNormal> {
        std::iter::repeat_n(self.lengthscale, d).chain([self.signal, self.noise])
    }

    /// The medians.
    pub fn median(&self, d: usize) -> Hyperparameters {
        Hyperparameters::from_log(&self.coordinates(d).map(|c| c.log_median).collect::<Vec<_>>())
    }

    /// ln p(theta) up to a constant, plus `log_likelihood` of theta, at given hyperparameters.
    pub fn log_posterior(&self, hyper: &Hyperparameters, log_likelihood: impl Fn(&[f64]) -> f64) -> f64 {
        let theta = hyper.to_log();
        let squares = theta.iter().zip(self.coordinates(hyper.lengthscale.len())).map(|(theta, prior)| {
            let z = (theta - prior.log_median) / prior.width;
            z * z
        });
        log_likelihood(&theta) - 0.5 * squares.sum::<f64>()
    }

    /// Maximizes ln p(theta) + `log_likelihood` (value and gradient over theta). Returns the hyperparameters and the maximum.
    pub fn maximize(
        &self,
        d: usize,
        iterations: usize,
        log_likelihood: impl Fn(&[f64]) -> (f64, Vec<f64>),
    ) -> Option<(Hyperparameters, f64)> {
        let bounds: Vec<(f64, f64)> = self.coordinates(d).map(|c| c.bounds).collect();
        let posterior = |theta: &[f64]| {
            let (mut value, mut gradient) = log_likelihood(theta);
            for (j, prior) in self.coordinates(d).enumerate() {
                let z = (theta[j] - prior.log_median) / prior.width;
                value -= 0.5 * z * z;
                gradient[j] -= z / prior.width;
            }
            (value, gradient)
        };
        let summits = self.starts.iter().map(|[lengthscale, signal, noise]| {
            let mut start = vec![*lengthscale; d];
            start.extend([*signal, *noise]);
            ascent::maximize(posterior, &start, &bounds, iterations)
        });
        let (theta, value) = summits.reduce(|a, b| if b.1 > a.1 { b } else { a })?;
        Some((Hyperparameters::from_log(&theta), value))
    }
}

/// Prior of the coefficients of the linear terms: independent normal. Empty without linear terms.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LinearPrior {
    /// b0, the means.
    pub mean: Vec<f64>,
    /// L, the variances.
    pub variance: Vec<f64>,
}

impl LinearPrior {
    /// h' b0
    pub fn expected(&self, terms: &[f64]) -> f64 {
        terms.iter().zip(&self.mean).map(|(h, b)| h * b).sum()
    }

    /// a' diag(L) b
    pub fn covariance(&self, a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).zip(&self.variance).map(|((a, b), l)| a * b * l).sum()
    }
}

/// Observations: points of the unit cube, the linear terms there and the values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Observations {
    /// Coordinates.
    pub points: Vec<Vec<f64>>,
    /// h(x) of each point, as long as the prior of the coefficients.
    pub terms: Vec<Vec<f64>>,
    /// y of each point.
    pub values: Vec<f64>,
}

impl Observations {
    /// Covariance of the values without that of delta and of the noise: H diag(L) H'.
    pub fn linear_covariance(&self, linear: &LinearPrior) -> DMatrix<f64> {
        let n = self.points.len();
        DMatrix::from_fn(n, n, |i, j| linear.covariance(&self.terms[i], &self.terms[j]))
    }

    /// y - H b0
    pub fn residual(&self, linear: &LinearPrior) -> DVector<f64> {
        let residual = self.values.iter().zip(&self.terms).map(|(y, h)| y - linear.expected(h));
        DVector::from_iterator(self.values.len(), residual)
    }
}

/// A regression conditioned on observations.
#[derive(Debug, Clone)]
pub struct Regression {
    points: Vec<Vec<f64>>,
    terms: Vec<Vec<f64>>,
    linear: LinearPrior,
    hyper: Hyperparameters,
    factor: Cholesky<f64, Dyn>,
    /// alpha = K^-1 (y - H b0)
    alpha: DVector<f64>,
}

impl Regression {
    /// Conditions on observations. `None` if the covariance cannot be factored.
    pub fn condition(observed: Observations, linear: LinearPrior, hyper: Hyperparameters) -> Option<Self> {
        let residual = observed.residual(&linear);
        let Observations { points, terms, .. } = observed;
        Self::about(points, terms, &residual, linear, hyper)
    }

    fn about(
        points: Vec<Vec<f64>>,
        terms: Vec<Vec<f64>>,
        residual: &DVector<f64>,
        linear: LinearPrior,
        hyper: Hyperparameters,
    ) -> Option<Self> {
        let factor = Cholesky::new(covariance(&hyper, &points, |i, j| linear.covariance(&terms[i], &terms[j])))?;
        let alpha = factor.solve(residual);
        Some(Regression { points, terms, linear, hyper, factor, alpha })
    }

    /// Conditions on the expected value at each pending point ("kriging believer", Ginsbourger et al. 2010): the mean
    /// stays, the uncertainty around the points vanishes. `pending`: points with their linear terms.
    pub fn believing(self, pending: &[(Vec<f64>, Vec<f64>)]) -> Option<Self> {
        if pending.is_empty() {
            return Some(self);
        }
        let linear = |i: usize, j: usize| self.linear.covariance(&self.terms[i], &self.terms[j]);
        let y = covariance(&self.hyper, &self.points, linear) * &self.alpha;
        let expected = pending.iter().map(|(x, h)| self.predict(x, h).0 - self.linear.expected(h));
        let y = DVector::from_iterator(y.len() + pending.len(), y.iter().copied().chain(expected));
        let points = self.points.into_iter().chain(pending.iter().map(|(x, _)| x.clone())).collect();
        let terms = self.terms.into_iter().chain(pending.iter().map(|(_, h)| h.clone())).collect();
        Self::about(points, terms, &y, self.linear, self.hyper)
    }

    /// Mean and variance of h' beta + delta (without noise) at `x` with the linear terms `h`.
    pub fn predict(&self, x: &[f64], h: &[f64]) -> (f64, f64) {
        let covariance =
            self.points.iter().zip(&self.terms).map(|(p, t)| self.hyper.kernel(p, x) + self.linear.covariance(t, h));
        let k = DVector::from_iterator(self.points.len(), covariance);
        // mu = h'b0 + k' alpha,  v = L^-1 k,  sigma^2 = k(x,x) - v'v   (R&W algorithm 2.1)
        let mean = self.linear.expected(h) + k.dot(&self.alpha);
        let v = self.factor.l_dirty().solve_lower_triangular(&k).unwrap_or(k);
        let prior = self.hyper.signal + self.linear.covariance(h, h);
        (mean, (prior - v.dot(&v)).max(1e-12 * prior))
    }

    /// Mean and variance of the coefficients after the observations: b0 + L H' alpha, L - L H' K^-1 H L   (R&W 2.7)
    pub fn coefficients(&self) -> Vec<(f64, f64)> {
        let posterior = |c: usize| {
            let (prior, variance) = (self.linear.mean[c], self.linear.variance[c]);
            let h = DVector::from_iterator(self.terms.len(), self.terms.iter().map(|t| t[c] * variance));
            let v = self.factor.l_dirty().solve_lower_triangular(&h).unwrap_or_else(|| h.clone());
            (prior + h.dot(&self.alpha), (variance - v.dot(&v)).max(0.0))
        };
        (0..self.linear.mean.len()).map(posterior).collect()
    }

    /// The hyperparameters.
    pub fn hyperparameters(&self) -> &Hyperparameters {
        &self.hyper
    }

    /// Observed points, pending ones included after [`Self::believing`].
    pub fn points(&self) -> &[Vec<f64>] {
        &self.points
    }

    /// alpha = K^-1 (y - H b0), one per point: the mean at x is h'b0 + sum alpha_i k(x, x_i).
    pub fn alpha(&self) -> &DVector<f64> {
        &self.alpha
    }
}

/// s^2 M52 + `linear` + noise I of the points.
fn covariance(hyper: &Hyperparameters, points: &[Vec<f64>], linear: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let n = points.len();
    let mut k = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            k[(i, j)] = hyper.kernel(&points[i], &points[j]) + linear(i, j);
            k[(j, i)] = k[(i, j)];
        }
        k[(i, i)] += hyper.noise;
    }
    k
}

/// ln p(y | X, theta) and its gradient; theta = ln (l_1 .. l_d, s^2, noise). `y`: values less their expectation; `linear`: their
/// covariance by the linear terms, none without any.
pub fn log_likelihood(
    theta: &[f64],
    points: &[Vec<f64>],
    y: &DVector<f64>,
    linear: Option<&DMatrix<f64>>,
) -> (f64, Vec<f64>) {
    let (n, d) = (points.len(), theta.len() - 2);
    let hyper = Hyperparameters::from_log(theta);
    // sqrt(5) r and exp(-sqrt(5) r) below the diagonal, for covariance and gradient
    let (mut distance, mut decay, mut k) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    for i in 0..n {
        for j in 0..=i {
            let q = hyper.distance(&points[i], &points[j]);
            (distance[(i, j)], decay[(i, j)]) = (q, exp(-q));
            k[(i, j)] = hyper.signal * (1.0 + q + q * q / 3.0) * decay[(i, j)] + linear.map_or(0.0, |l| l[(i, j)]);
            k[(j, i)] = k[(i, j)];
        }
        k[(i, i)] += hyper.noise;
    }
    let Some(factor) = Cholesky::new(k) else {
        return (f64::NEG_INFINITY, vec![0.0; theta.len()]);
    };
    let alpha = factor.solve(y);
    // ln p = -y'alpha/2 - sum ln L_ii - n/2 ln(2 pi)   (R&W algorithm 2.1)
    let log_determinant: f64 = (0..n).map(|i| log(factor.l_dirty()[(i, i)])).sum();
    let value = -0.5 * y.dot(&alpha) - log_determinant - 0.5 * n as f64 * log(2.0 * PI);
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
            let q = distance[(i, j)];
            let decay = hyper.signal * decay[(i, j)];
            gradient[d] += weight * decay * (1.0 + q + q * q / 3.0);
            // dk/d ln l_d = 5/3 s^2 (1 + q) exp(-q) ((x_d - x'_d)/l_d)^2
            let slope = weight * 5.0 / 3.0 * decay * (1.0 + q);
            (0..d).for_each(|c| gradient[c] += slope * scaled(c) * scaled(c));
        }
    }
    (value, gradient)
}
