//! Findings of the model about the robot, for the operator; the sampler does not read them.

use super::history::History;
use super::model::ValueModel;
use super::safeguard;
use crate::optimize::ask::Direction;
use crate::optimize::gp::laplace::sigmoid;
use crate::optimize::prior::PriorModel;
use crate::optimize::prior::terms::Ensemble;
use crate::optimize::trial::Trial;
use libm::{exp, log, sqrt};
use serde::{Deserialize, Serialize};

/// Least probability of a label under a world: a single label does not rule a world out.
const LEAST_PROBABILITY: f64 = 0.02;

/// Mean and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeanAndDeviation {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// Weight of one simulated robot by its likelihood.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorldWeight {
    /// Name of the world.
    pub name: String,
    /// Its likelihood as a share of that of all worlds, 0..1.
    pub weight: f64,
}

/// Findings of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PriorInsight {
    /// rho: how much of the simulated change over the points the robot shows; 1 for a robot as simulated.
    pub rho: MeanAndDeviation,
    /// b: by how much the robot differs from the simulated robots' mean everywhere, in the objective's unit and sign.
    pub bias: MeanAndDeviation,
    /// The simulated robots in their order.
    pub worlds: Vec<WorldWeight>,
    /// ln of the likelihood of the values with the simulated robots over that without them.
    pub log_bayes_factor: f64,
    /// Whether the sampler uses the simulated values; see [`safeguard`].
    pub trusted: bool,
}

/// Computes the insight. `None` if the prior cannot be used ([`PriorModel::covers`]) or a covariance cannot be factored.
pub fn insight(prior: &PriorModel, trials: &[Trial], direction: Direction) -> Option<PriorInsight> {
    let ensemble = prior.ensemble()?;
    let history = History::gather(prior, ensemble, trials, direction);
    let sign = if direction == Direction::Maximize { 1.0 } else { -1.0 };
    let about = ValueModel::fit(ensemble, &history)?;
    let coefficients = about.coefficients();
    let worlds = weights(prior, ensemble, &history);
    let checked = safeguard::check(about, ensemble, &history)?;
    let estimate = |(mean, variance): (f64, f64), unit: f64| MeanAndDeviation {
        mean: unit * mean,
        deviation: unit.abs() * sqrt(variance),
    };
    Some(PriorInsight {
        rho: estimate(coefficients[1], 1.0),
        bias: estimate(coefficients[0], sign * ensemble.scale),
        worlds,
        log_bayes_factor: checked.log_bayes_factor,
        trusted: checked.trusted,
    })
}

/// Likelihood of values and labels under each world, its value with the robot's bias and difference, its label through the logistic
/// prior. A world without a value explains no jump that stood.
fn weights(prior: &PriorModel, ensemble: &Ensemble, history: &History) -> Vec<WorldWeight> {
    let [b0, b1, b2] = ensemble.standing.mean;
    let any_stood = history.stood().next().is_some();
    let log_likelihood = |k: usize| {
        let labels = history.jumps.iter().map(|jump| {
            let label = ensemble.world_labels(&jump.point)[k];
            let p = sigmoid(b0 + b1 * label + b2 * jump.features.standing[2]);
            log(if jump.stood { p } else { 1.0 - p }.max(LEAST_PROBABILITY))
        });
        let values = match ensemble.known.iter().position(|known| *known == k) {
            Some(at) => {
                let simulated = |x: &[f64]| (ensemble.world_values(x)[at] - ensemble.offset) / ensemble.scale;
                ValueModel::log_likelihood_about(ensemble, history, simulated)
            }
            None if any_stood => f64::NEG_INFINITY,
            None => 0.0,
        };
        labels.sum::<f64>() + values
    };
    let worlds = &prior.prior().worlds;
    let logs: Vec<f64> = (0..worlds.len()).map(log_likelihood).collect();
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let relative: Vec<f64> = logs.iter().map(|log| exp(log - largest)).collect();
    let sum: f64 = relative.iter().sum();
    let weight = |(world, relative): (&crate::optimize::prior::World, f64)| WorldWeight {
        name: world.name.clone(),
        weight: relative / sum,
    };
    worlds.iter().zip(relative).map(weight).collect()
}
