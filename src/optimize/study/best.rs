//! The best trial of a study: by the sampler's model where it has one, else by the values of the trials.

use super::{Study, StudyError};
use crate::optimize::ask::{Prediction, SamplerKind};
use crate::optimize::repeats;
use crate::optimize::sampler;
use crate::optimize::sim::insight::{PriorInsight, insight};
use crate::optimize::trial::{Trial, TrialState};
use serde::{Deserialize, Serialize};

/// User attribute of a study: the best trial by the sampler's model, a [`ModelBest`].
pub(super) const MODEL_BEST: &str = "model_best";

/// The trial of the best predicted mean among those that stood, with `sim` less the risk of a fall ([`Prediction::worth`]). The largest
/// value of a noisy objective is that of a lucky jump, and is not reached again.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ModelBest {
    /// Its number.
    pub trial: u32,
    /// Mean of the objective at its point, in the objective's unit.
    pub predicted: f64,
    /// Standard deviation of this mean, without the noise of a trial, in the objective's unit.
    pub predicted_deviation: f64,
    /// Finished trials from which the model has learned.
    pub learned: u32,
}

/// Predictions of the sampler's model of the finished trials.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelPredictions {
    /// Every finished trial, in the order of the numbers; empty without a model or before it has enough trials.
    pub trials: Vec<Prediction>,
    /// The best of those that stood.
    pub best: Option<ModelBest>,
    /// Findings of the sampler `sim` about robot and simulator; none for another sampler and without a prior.
    pub simulator: Option<PriorInsight>,
}

impl Study {
    /// The best trial: by the sampler's model if that was stored after the newest trial, else by value, repeats averaged
    /// ([`repeats::best`]).
    pub fn best(&self) -> Option<&Trial> {
        let by_model = self.model_best().and_then(|best| self.trials().get(best.trial as usize));
        by_model.or_else(|| repeats::best(self.trials(), self.options.direction))
    }

    /// Returns the predictions of the sampler's model of the finished trials.
    pub fn predict(&self) -> ModelPredictions {
        let trials = sampler::predict(&self.ask(&[]));
        let best_first = |a: &&Prediction, b: &&Prediction| self.options.direction.best_first(a.worth, b.worth);
        let best =
            trials.iter().filter(|prediction| prediction.stood && prediction.worth.is_finite()).min_by(best_first);
        let best = best.map(|best| ModelBest {
            trial: best.trial,
            predicted: best.value,
            predicted_deviation: best.deviation,
            learned: self.observed(),
        });
        let prior = self.prior.as_ref().filter(|_| self.options.sampler.kind == SamplerKind::Sim);
        let simulator = prior.and_then(|prior| insight(prior, self.trials(), self.options.direction));
        ModelPredictions { trials, best, simulator }
    }

    /// The stored best trial by the sampler's model; none if trials have finished since.
    pub fn model_best(&self) -> Option<ModelBest> {
        let best: ModelBest = serde_json::from_value(self.attributes().get(MODEL_BEST)?.clone()).ok()?;
        let trial = self.trials().get(best.trial as usize)?;
        let stands = trial.state == TrialState::Complete && !trial.is_fall();
        (stands && best.learned == self.observed()).then_some(best)
    }

    /// Stores the best trial by the sampler's model unless it is stored.
    pub fn store_best(&mut self, best: ModelBest) -> Result<(), StudyError> {
        if self.model_best() != Some(best) {
            self.annotate_study(&[(MODEL_BEST.to_owned(), serde_json::json!(best))])?;
        }
        Ok(())
    }

    fn observed(&self) -> u32 {
        self.trials().iter().filter(|trial| trial.state.is_observed()).count() as u32
    }
}
