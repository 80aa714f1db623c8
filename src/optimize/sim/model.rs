//! The model of the robot: its value and its standing about the terms of the prior.
//!
//! Value: y = b + rho m + sum w_j phi_j + delta + eps, of the jumps that stood; b ~ N(0, 0.5^2), rho ~ N(1, 0.3^2),
//! w_j ~ N(0, 2/r), delta Matern 5/2, all linear terms integrated out (Kennedy and O'Hagan, "Bayesian calibration of computer
//! models", J. R. Statist. Soc. B 63, 2001). Standing: f = b0 + b1 sum q_k l_k + b2 z + sum gamma_j psi_j + delta_c, with a logistic
//! likelihood; q_k is the share of world k (`worlds.rs`). Without the simulated robots f = b0 + b2 z + delta_c, b0 of mean 1.
//! Values are in units of the prior's scale about its offset.

use super::history::History;
use crate::optimize::gp::laplace::{Laplace, averaged_sigmoid};
use crate::optimize::gp::regression::{
    HyperPrior, Hyperparameters, LinearPrior, LogNormal, Observations, Regression, log_likelihood,
};
use crate::optimize::prior::standing::LogisticPrior;
use crate::optimize::prior::terms::{Ensemble, Features};
use libm::log;
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the bias b.
const BIAS: f64 = 0.5;
/// Standard deviation of the scale rho about 1.
const SCALE: f64 = 0.3;
/// Sum of the variances of the weights of the components.
const COMPONENTS: f64 = 2.0;
/// Factor of these variances for the label's components: an odds ratio a unit of the label.
const LABEL_COMPONENTS: f64 = 4.0;
/// ln of the median variance of delta.
const DELTA: f64 = -2.0;
/// Mean of b0 without the simulated robots: a jump within the bounds stands rather than falls.
const STANDS: f64 = 1.0;
/// Lengthscale and variance of delta_c.
const STANDING: (f64, f64) = (0.4, 3.0);
/// Observations from which hyperparameters are fitted: the cost grows with their cube.
const FITTED: usize = 30;
/// Steps of the ascent.
const ITERATIONS: usize = 30;

/// The robot's value at a point.
#[derive(Debug, Clone)]
pub struct ValueModel {
    /// The regression; `None` before the first jump that stood.
    regression: Option<Regression>,
    linear: LinearPrior,
    hyper: Hyperparameters,
    /// ln p(y | theta) p(theta) at the fitted hyperparameters.
    pub log_evidence: f64,
}

impl ValueModel {
    /// Fits the jumps that stood. `None` if a covariance cannot be factored.
    pub fn fit(ensemble: &Ensemble, history: &History) -> Option<ValueModel> {
        let r = ensemble.components().0;
        let mut linear = LinearPrior { mean: vec![0.0, 1.0], variance: vec![BIAS * BIAS, SCALE * SCALE] };
        linear.mean.extend(std::iter::repeat_n(0.0, r));
        linear.variance.extend(std::iter::repeat_n(COMPONENTS / r.max(1) as f64, r));
        let observed = Observations {
            points: history.stood().map(|jump| jump.point.clone()).collect(),
            terms: history.stood().map(|jump| jump.features.value.clone()).collect(),
            values: history.stood().map(|jump| (jump.value - ensemble.offset) / ensemble.scale).collect(),
        };
        ValueModel::about(observed, linear, &hyper_prior(DELTA), history.dimensions)
    }

    /// Fits a model without prior: a constant of variance 1 and a signal of the prior's scale.
    pub fn without_prior(ensemble: &Ensemble, history: &History) -> Option<ValueModel> {
        let observed = Observations {
            points: history.stood().map(|jump| jump.point.clone()).collect(),
            terms: history.stood().map(|_| vec![1.0]).collect(),
            values: history.stood().map(|jump| (jump.value - ensemble.offset) / ensemble.scale).collect(),
        };
        let linear = LinearPrior { mean: vec![0.0], variance: vec![1.0] };
        ValueModel::about(observed, linear, &hyper_prior(0.0), history.dimensions)
    }

    /// ln p of the values about a single simulated robot, given by its scaled values at the jumps that stood, with the bias and the
    /// median hyperparameters.
    pub fn log_likelihood_about(ensemble: &Ensemble, history: &History, simulated: &[f64]) -> f64 {
        let linear = LinearPrior { mean: vec![0.0, 1.0], variance: vec![BIAS * BIAS, 0.0] };
        let observed = Observations {
            points: history.stood().map(|jump| jump.point.clone()).collect(),
            terms: simulated.iter().map(|value| vec![1.0, *value]).collect(),
            values: history.stood().map(|jump| (jump.value - ensemble.offset) / ensemble.scale).collect(),
        };
        let theta = hyper_prior(DELTA).median(history.dimensions).to_log();
        let covariance = observed.linear_covariance(&linear);
        log_likelihood(&theta, &observed.points, &observed.residual(&linear), Some(&covariance)).0
    }

    fn about(observed: Observations, linear: LinearPrior, prior: &HyperPrior, d: usize) -> Option<ValueModel> {
        let hyper = if observed.values.len() > 1 { fitted(&observed, &linear, prior, d)? } else { prior.median(d) };
        if observed.values.is_empty() {
            return Some(ValueModel { regression: None, linear, hyper, log_evidence: 0.0 });
        }
        let log_evidence = prior.log_posterior(&hyper, |theta| {
            let covariance = observed.linear_covariance(&linear);
            log_likelihood(theta, &observed.points, &observed.residual(&linear), Some(&covariance)).0
        });
        let regression = Regression::condition(observed, linear.clone(), hyper.clone())?;
        Some(ValueModel { regression: Some(regression), linear, hyper, log_evidence })
    }

    /// Takes running trials as observed at their expected value.
    pub fn believing(self, pending: &[(Vec<f64>, Features)]) -> Option<ValueModel> {
        let pending: Vec<(Vec<f64>, Vec<f64>)> = pending.iter().map(|(x, f)| (x.clone(), f.value.clone())).collect();
        let regression = match self.regression {
            Some(regression) => Some(regression.believing(&pending)?),
            None if pending.is_empty() => None,
            None => {
                let (points, terms): (Vec<_>, Vec<Vec<f64>>) = pending.into_iter().unzip();
                let values = terms.iter().map(|h| self.linear.expected(h)).collect();
                let observed = Observations { points, terms, values };
                Some(Regression::condition(observed, self.linear.clone(), self.hyper.clone())?)
            }
        };
        Some(ValueModel { regression, ..self })
    }

    /// Mean and variance at a point with its linear terms, in scaled units, without noise.
    pub fn predict(&self, x: &[f64], terms: &[f64]) -> (f64, f64) {
        match &self.regression {
            Some(regression) => regression.predict(x, terms),
            None => (self.linear.expected(terms), self.hyper.signal + self.linear.covariance(terms, terms)),
        }
    }

    /// Mean and variance of the coefficients of 1, m and the components.
    pub fn coefficients(&self) -> Vec<(f64, f64)> {
        match &self.regression {
            Some(regression) => regression.coefficients(),
            None => self.linear.mean.iter().copied().zip(self.linear.variance.iter().copied()).collect(),
        }
    }
}

/// Maximum a posteriori; with many observations from an even choice of [`FITTED`] among them.
fn fitted(observed: &Observations, linear: &LinearPrior, prior: &HyperPrior, d: usize) -> Option<Hyperparameters> {
    let n = observed.values.len();
    let chosen: Vec<usize> = if n <= FITTED { (0..n).collect() } else { (0..FITTED).map(|i| i * n / FITTED).collect() };
    let part = Observations {
        points: chosen.iter().map(|i| observed.points[*i].clone()).collect(),
        terms: chosen.iter().map(|i| observed.terms[*i].clone()).collect(),
        values: chosen.iter().map(|i| observed.values[*i]).collect(),
    };
    let (covariance, residual) = (part.linear_covariance(linear), part.residual(linear));
    let likelihood = |theta: &[f64]| log_likelihood(theta, &part.points, &residual, Some(&covariance));
    prior.maximize(d, ITERATIONS, likelihood).map(|(hyper, _)| hyper)
}

/// ln lengthscale ~ N(-0.35, 0.5^2), ln s^2 ~ N(`signal`, 1), ln sigma^2 ~ N(-6, 1.5^2)
fn hyper_prior(signal: f64) -> HyperPrior {
    let prior = |median, width, (low, high)| LogNormal { median, width, bounds: (log(low), log(high)) };
    HyperPrior {
        lengthscale: prior(-0.35, 0.5, (0.05, 20.0)),
        signal: prior(signal, 1.0, (1e-4, 20.0)),
        noise: prior(-6.0, 1.5, (1e-6, 0.5)),
        // The medians, and rougher with more noise.
        starts: vec![[-0.35, signal, -6.0], [-1.15, signal, -4.5]],
    }
}

/// The robot's probability of standing at a point.
#[derive(Debug, Clone)]
pub struct StandingModel {
    points: Vec<Vec<f64>>,
    terms: Vec<Vec<f64>>,
    /// Share of each world in the label; `None` without the simulated robots.
    shares: Option<Vec<f64>>,
    linear: LinearPrior,
    hyper: Hyperparameters,
    /// `None` before the first jump.
    laplace: Option<Laplace>,
}

impl StandingModel {
    /// Fits all jumps; `shares` are those of the worlds, `None` leaves the simulated robots out. `None` if the mode is not found.
    pub fn fit(ensemble: &Ensemble, history: &History, shares: Option<Vec<f64>>) -> Option<StandingModel> {
        let r = ensemble.components().1;
        let LogisticPrior { mean: [b0, b1, b2], deviation } = ensemble.standing;
        let [v0, v1, v2] = deviation.map(|s| s * s);
        let linear = if shares.is_some() {
            let components = std::iter::repeat_n(LABEL_COMPONENTS * COMPONENTS / r.max(1) as f64, r);
            let mean = [b0, b1, b2].into_iter().chain(std::iter::repeat_n(0.0, r)).collect();
            LinearPrior { mean, variance: [v0, v1, v2].into_iter().chain(components).collect() }
        } else {
            LinearPrior { mean: vec![STANDS, b2], variance: vec![v0, v2] }
        };
        let terms: Vec<Vec<f64>> = history.jumps.iter().map(|jump| terms(&jump.features, shares.as_deref())).collect();
        let points: Vec<Vec<f64>> = history.jumps.iter().map(|jump| jump.point.clone()).collect();
        let stood: Vec<bool> = history.jumps.iter().map(|jump| jump.stood).collect();
        let hyper =
            Hyperparameters { lengthscale: vec![STANDING.0; history.dimensions], signal: STANDING.1, noise: 0.0 };
        let n = points.len();
        let laplace = if n == 0 {
            None
        } else {
            let covariance =
                |i: usize, j: usize| hyper.kernel(&points[i], &points[j]) + linear.covariance(&terms[i], &terms[j]);
            let k = DMatrix::from_fn(n, n, covariance);
            let mean = DVector::from_iterator(n, terms.iter().map(|h: &Vec<f64>| linear.expected(h)));
            Some(Laplace::fit(&k, &mean, &stood)?)
        };
        Some(StandingModel { points, terms, shares, linear, hyper, laplace })
    }

    /// The probability of standing at a point with the prior's terms there, averaged over the uncertainty.
    pub fn probability(&self, x: &[f64], features: &Features) -> f64 {
        let terms = &terms(features, self.shares.as_deref())[..];
        let mean = self.linear.expected(terms);
        let variance = self.hyper.signal + self.linear.covariance(terms, terms);
        let Some(laplace) = &self.laplace else { return averaged_sigmoid(mean, variance) };
        let covariance = self
            .points
            .iter()
            .zip(&self.terms)
            .map(|(p, h)| self.hyper.kernel(p, x) + self.linear.covariance(h, terms));
        laplace.probability(mean, &DVector::from_iterator(self.points.len(), covariance), variance)
    }
}

/// The terms of standing with the label that the worlds have together by their shares, in place of their mean label; 1 and the reserve of
/// friction without the worlds.
fn terms(features: &Features, shares: Option<&[f64]>) -> Vec<f64> {
    let Some(shares) = shares else { return vec![1.0, features.standing[2]] };
    let mut terms = features.standing.clone();
    terms[1] = features.labels.iter().zip(shares).map(|(label, share)| label * share).sum();
    terms
}
