//! The check of the prior against the robot's values: a wrong simulator is left as soon as the values contradict it.
//!
//! The values are explained once about the simulated robots and once without them, by a constant and a Matern process of the same
//! scale. The model without them is used where its likelihood is larger by a factor of exp(3) = 20, "strong" evidence (Kass and
//! Raftery, "Bayes factors", J. Am. Stat. Assoc. 90, 1995); the choice among priors by likelihood is that of Pautrat,
//! Chatzilygeroudis and Mouret, "Bayesian optimization with automatic prior selection for data-efficient direct policy search", ICRA
//! 2018 (MLEI). Standing is learned without the simulated robots where they are left: those whose values are wrong do not say where the
//! robot stands. The choice is made anew for each proposal, so that more values can restore the prior.

use super::history::History;
use super::model::ValueModel;
use crate::optimize::prior::terms::Ensemble;

/// ln of the Bayes factor against the simulated robots from which they are left.
const LEFT: f64 = 3.0;

/// The model of the value to use.
#[derive(Debug, Clone)]
pub struct CheckedValue {
    /// The model.
    pub value: ValueModel,
    /// Whether it is about the simulated robots.
    pub trusted: bool,
    /// ln of the likelihood of the values with the simulated robots over that without them, each at its best hyperparameters and times
    /// their prior.
    pub log_bayes_factor: f64,
}

/// Chooses between `about`, the model about the simulated robots, and one without them. `None` if a covariance cannot be factored, or the
/// values are so large that a likelihood is no number.
pub fn check(about: ValueModel, ensemble: &Ensemble, history: &History) -> Option<CheckedValue> {
    let without = ValueModel::without_prior(ensemble, history)?;
    let log_bayes_factor = about.log_posterior - without.log_posterior;
    let trusted = log_bayes_factor >= -LEFT;
    log_bayes_factor.is_finite().then_some(CheckedValue {
        value: if trusted { about } else { without },
        trusted,
        log_bayes_factor,
    })
}
