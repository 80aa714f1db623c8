//! The model of the robot: its value and its standing about the terms of the prior.
//!
//! Value: y = b + rho m + sum w_j phi_j + delta + eps, of the jumps that stood; b ~ N(0, 0.5^2), rho ~ N(1, 0.3^2),
//! w_j ~ N(0, 2/r), delta Matern 5/2, all linear terms integrated out (Kennedy and O'Hagan, "Bayesian calibration of computer
//! models", J. R. Statist. Soc. B 63, 2001). Standing: f = b0 + b1 sum q_k l_k + b2 z + sum gamma_j psi_j + delta_c, with a logistic
//! likelihood (`propagation.rs`); q_k is the share of world k (`worlds.rs`). Without the simulated robots f = b0 + b2 z + delta_c, b0 of
//! mean 1. Values are in units of the prior's scale about its offset.

use super::history::History;
use super::propagation::{Propagation, averaged};
use crate::optimize::gp::regression::{
    HyperPrior, Hyperparameters, LinearPrior, LogNormal, Observations, Regression, log_likelihood,
};
use crate::optimize::prior::standing::LogisticPrior;
use crate::optimize::prior::terms::{Ensemble, Features};
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the bias b.
const BIAS: f64 = 0.5;
/// Standard deviation of the scale rho about 1.
const RHO: f64 = 0.3;
/// Sum of the variances of the weights of the components.
const WEIGHTS: f64 = 2.0;
/// Factor of these variances for the label's components: an odds ratio a unit of the label.
const LABEL_WEIGHTS: f64 = 4.0;
/// ln of the median variance of delta.
const LOG_DELTA: f64 = -2.0;
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
    pub log_posterior: f64,
}

impl ValueModel {
    /// Fits the jumps that stood. `None` if a covariance cannot be factored.
    pub fn fit(ensemble: &Ensemble, history: &History) -> Option<ValueModel> {
        let r = ensemble.components().0;
        let mut linear = LinearPrior { mean: vec![0.0, 1.0], variance: vec![BIAS * BIAS, RHO * RHO] };
        linear.mean.extend(std::iter::repeat_n(0.0, r));
        linear.variance.extend(std::iter::repeat_n(WEIGHTS / r.max(1) as f64, r));
        let terms = history.stood().map(|jump| jump.features.value.clone()).collect();
        let observed = history.observations(ensemble, terms);
        ValueModel::about(observed, linear, &hyper_prior(LOG_DELTA), history.dimensions)
    }

    /// Fits a model without prior: a constant of variance 1 and a signal of the prior's scale.
    pub fn without_prior(ensemble: &Ensemble, history: &History) -> Option<ValueModel> {
        let observed = history.observations(ensemble, history.stood().map(|_| vec![1.0]).collect());
        let linear = LinearPrior { mean: vec![0.0], variance: vec![1.0] };
        ValueModel::about(observed, linear, &hyper_prior(0.0), history.dimensions)
    }

    /// ln p of the values about a single simulated robot, given by its scaled values at the jumps that stood, with the bias and the
    /// median hyperparameters.
    pub fn log_likelihood_about(ensemble: &Ensemble, history: &History, simulated: &[f64]) -> f64 {
        let linear = LinearPrior { mean: vec![0.0, 1.0], variance: vec![BIAS * BIAS, 0.0] };
        let observed = history.observations(ensemble, simulated.iter().map(|value| vec![1.0, *value]).collect());
        let theta = hyper_prior(LOG_DELTA).median(history.dimensions).to_log();
        let covariance = observed.linear_covariance(&linear);
        log_likelihood(&theta, &observed.points, &observed.residual(&linear), Some(&covariance)).0
    }

    fn about(observed: Observations, linear: LinearPrior, prior: &HyperPrior, d: usize) -> Option<ValueModel> {
        let hyper = if observed.values.len() > 1 { fitted(&observed, &linear, prior, d)? } else { prior.median(d) };
        if observed.values.is_empty() {
            return Some(ValueModel { regression: None, linear, hyper, log_posterior: 0.0 });
        }
        let log_posterior = prior.log_posterior(&hyper, |theta| {
            let covariance = observed.linear_covariance(&linear);
            log_likelihood(theta, &observed.points, &observed.residual(&linear), Some(&covariance)).0
        });
        let regression = Regression::condition(observed, linear.clone(), hyper.clone())?;
        Some(ValueModel { regression: Some(regression), linear, hyper, log_posterior })
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
    HyperPrior {
        lengthscale: LogNormal::new(-0.35, 0.5, (0.05, 20.0)),
        signal: LogNormal::new(signal, 1.0, (1e-4, 20.0)),
        noise: LogNormal::new(-6.0, 1.5, (1e-6, 0.5)),
        // The medians, and rougher with more noise.
        starts: vec![[-0.35, signal, -6.0], [-1.15, signal, -4.5]],
    }
}

/// Prior of the coefficients of the standing's terms: normal, with correlations.
#[derive(Debug, Clone)]
struct StandingPrior {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl StandingPrior {
    /// That of the worlds with the components of their labels; without them that of 1 and z alone.
    fn of(ensemble: &Ensemble, with_worlds: bool) -> StandingPrior {
        let LogisticPrior { mean, covariance } = ensemble.standing;
        if !with_worlds {
            let variance = DVector::from_vec(vec![covariance[(0, 0)], covariance[(2, 2)]]);
            return StandingPrior {
                mean: DVector::from_vec(vec![STANDS, mean[2]]),
                covariance: DMatrix::from_diagonal(&variance),
            };
        }
        let r = ensemble.components().1;
        let component = LABEL_WEIGHTS * WEIGHTS / r.max(1) as f64;
        let mut all = StandingPrior {
            mean: DVector::zeros(3 + r),
            covariance: DMatrix::from_diagonal_element(3 + r, 3 + r, component),
        };
        all.mean.rows_mut(0, 3).copy_from(&mean);
        all.covariance.view_mut((0, 0), (3, 3)).copy_from(&covariance);
        all
    }
}

/// The robot's probability of standing at a point.
#[derive(Debug, Clone)]
pub struct StandingModel {
    points: Vec<Vec<f64>>,
    terms: Vec<DVector<f64>>,
    /// Share of each world in the label; `None` without the simulated robots.
    shares: Option<Vec<f64>>,
    prior: StandingPrior,
    /// Of delta_c.
    hyper: Hyperparameters,
    /// `None` before the first jump.
    posterior: Option<Propagation>,
}

impl StandingModel {
    /// Fits all jumps; `shares` are those of the worlds, `None` leaves the simulated robots out. `None` if the approximation does not
    /// converge.
    pub fn fit(ensemble: &Ensemble, history: &History, shares: Option<Vec<f64>>) -> Option<StandingModel> {
        let prior = StandingPrior::of(ensemble, shares.is_some());
        let points: Vec<Vec<f64>> = history.jumps.iter().map(|jump| jump.point.clone()).collect();
        let terms: Vec<_> = history.jumps.iter().map(|jump| terms(&jump.features, shares.as_deref())).collect();
        let stood: Vec<bool> = history.jumps.iter().map(|jump| jump.stood).collect();
        let hyper =
            Hyperparameters { lengthscale: vec![STANDING.0; history.dimensions], signal: STANDING.1, noise: 0.0 };
        let mut model = StandingModel { points, terms, shares, prior, hyper, posterior: None };
        let n = stood.len();
        if n > 0 {
            let row = |(x, terms): (&Vec<f64>, &DVector<f64>)| {
                model.covariances(x, &(&model.prior.covariance * terms)).transpose()
            };
            let rows = model.points.iter().zip(&model.terms).map(row);
            let k = DMatrix::from_rows(&rows.collect::<Vec<_>>());
            let mean = DVector::from_iterator(n, model.terms.iter().map(|h| h.dot(&model.prior.mean)));
            model.posterior = Some(Propagation::fit(&k, &mean, &stood)?);
        }
        Some(model)
    }

    /// Whether the model is about the simulated robots.
    pub fn has_worlds(&self) -> bool {
        self.shares.is_some()
    }

    /// Covariances of the latent value at a point with those at the jumps; `weighted`: the prior's covariance times the terms there.
    fn covariances(&self, x: &[f64], weighted: &DVector<f64>) -> DVector<f64> {
        let covariance = |(p, h): (&Vec<f64>, &DVector<f64>)| self.hyper.kernel(x, p) + weighted.dot(h);
        DVector::from_iterator(self.points.len(), self.points.iter().zip(&self.terms).map(covariance))
    }

    /// The probability of standing at a point with the prior's terms there, averaged over the uncertainty.
    pub fn probability(&self, x: &[f64], features: &Features) -> f64 {
        let terms = terms(features, self.shares.as_deref());
        let mean = terms.dot(&self.prior.mean);
        let weighted = &self.prior.covariance * &terms;
        let variance = self.hyper.signal + terms.dot(&weighted);
        match &self.posterior {
            Some(posterior) => posterior.probability(mean, &self.covariances(x, &weighted), variance),
            None => averaged(mean, variance),
        }
    }
}

/// The terms of standing with the label that the worlds have together by their shares, in place of their mean label; 1 and the reserve of
/// friction without the worlds.
fn terms(features: &Features, shares: Option<&[f64]>) -> DVector<f64> {
    let Some(shares) = shares else { return DVector::from_vec(vec![1.0, features.standing[2]]) };
    let mut terms = DVector::from_column_slice(&features.standing);
    terms[1] = features.labels.iter().zip(shares).map(|(label, share)| label * share).sum();
    terms
}
