//! Findings of the model about the robot, for the operator; the sampler does not read them.

use super::history::History;
use super::model::ValueModel;
use super::{safeguard, worlds};
use crate::optimize::ask::Direction;
use crate::optimize::prior::PriorModel;
use crate::optimize::prior::terms::Ensemble;
use crate::optimize::trial::Trial;
use libm::sqrt;
use serde::{Deserialize, Serialize};

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
    /// ln of the likelihood of the values with the simulated robots over that without them, each at its best hyperparameters and times
    /// their prior.
    pub log_bayes_factor: f64,
    /// Whether the sampler uses the simulated values; see [`safeguard`].
    pub trusted: bool,
}

/// Computes the insight. `None` if the prior cannot be used ([`PriorModel::covers`]) or a covariance cannot be factored.
pub fn insight(prior: &PriorModel, trials: &[Trial], direction: Direction) -> Option<PriorInsight> {
    let ensemble = prior.ensemble()?;
    let history = History::gather(prior, ensemble, trials, direction);
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
        bias: estimate(coefficients[0], direction.maximized(ensemble.scale)),
        worlds,
        log_bayes_factor: checked.log_bayes_factor,
        trusted: checked.trusted,
    })
}

/// The likelihood of each world with its name.
fn weights(prior: &PriorModel, ensemble: &Ensemble, history: &History) -> Vec<WorldWeight> {
    let shares = worlds::normalized(&worlds::log_likelihoods(ensemble, history), 1.0);
    let named = prior.prior().worlds.iter().zip(shares);
    named.map(|(world, weight)| WorldWeight { name: world.name.clone(), weight }).collect()
}
