//! The sampler `sim`: a Gaussian process about the results of simulated robots, for some five jumps of a robot.
//!
//! The value and the standing of the robot are learned about those of the ensemble ([`model`]); the next point maximizes the
//! expected gain less the price of a fall ([`search`]). A simulator that the values contradict is left ([`safeguard`]); with few jumps the
//! study then begins over the whole space, as with `gp`. Without a prior, or with one of other parameters ([`PriorModel::covers`]), the
//! sampler proposes as `gp`.

pub mod history;
pub mod insight;
pub mod model;
pub mod propagation;
pub mod safeguard;
pub mod search;
pub mod worlds;

use super::ask::{Ask, Candidate, Direction, Expectation, Prediction, Streams};
use super::gp;
use super::model_free;
use super::mt19937::Mt19937;
use super::prior::PriorModel;
use super::prior::terms::{CANDIDATE_SEED, CANDIDATES, Ensemble, Features};
use super::sobol::Sobol;
use super::space::Parameter;
use history::{History, Jump};
use libm::sqrt;
use model::{StandingModel, ValueModel};
use search::Acquisition;
use std::borrow::Cow;

/// Proposes the next point for the given parameters.
pub fn propose(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let proposal = Fitted::of(ask).and_then(|fitted| fitted.propose(streams));
    proposal.unwrap_or_else(|| gp::propose(ask, streams))
}

/// Returns what the model expects of a trial at `values`, in the order of the space.
pub fn expect(ask: &Ask<'_>, values: &[f64]) -> Option<Expectation> {
    Fitted::of(ask).and_then(|fitted| fitted.expect(values)).or_else(|| gp::expect(ask, values))
}

/// Returns what the model says of the finished trials.
pub fn predict(ask: &Ask<'_>) -> Vec<Prediction> {
    Fitted::of(ask).and_then(Fitted::predict).unwrap_or_else(|| gp::predict(ask))
}

/// The trials, and the models of value and standing that are fitted to them.
struct Fitted<'a> {
    ask: &'a Ask<'a>,
    prior: &'a PriorModel,
    ensemble: &'a Ensemble,
    history: History,
    models: (ValueModel, StandingModel),
}

impl<'a> Fitted<'a> {
    /// Fits the models. `None` without a prior that covers the space, or if a covariance cannot be factored.
    fn of(ask: &'a Ask<'a>) -> Option<Fitted<'a>> {
        let prior = ask.prior.filter(|prior| prior.covers(ask.space).is_ok())?;
        let ensemble = prior.ensemble()?;
        let history = History::gather(prior, ensemble, ask.trials, ask.direction);
        let checked = safeguard::check(ValueModel::fit(ensemble, &history)?, ensemble, &history)?;
        let shares = checked.trusted.then(|| worlds::shares(&worlds::log_likelihoods(ensemble, &history)));
        let models = (checked.value, StandingModel::fit(ensemble, &history, shares)?);
        Some(Fitted { ask, prior, ensemble, history, models })
    }

    /// The proposal of the model. Given parameters stay as they are.
    fn propose(self, streams: &mut Streams) -> Option<Candidate> {
        let ask = self.ask;
        let given: Option<Vec<f64>> = ask.space.parameters().iter().map(|p| ask.given(p)).collect();
        // The first jump was chosen by the simulated robots alone and does not count. Far from the few jumps all points seem alike: a
        // search would jump one corner of the space after the other.
        let begins_anew =
            !self.models.1.has_worlds() && self.history.jumps.len() <= ask.config.startup_trials(ask.space);
        if let Some(values) = given.or_else(|| begins_anew.then(|| model_free::sobol(ask, streams).values)) {
            return Some(Candidate { expected: self.expect(&values), ..Candidate::from(values) });
        }
        let bounds = self.bounds();
        let candidates = self.candidates(&bounds);
        let (prior, ensemble) = (self.prior, self.ensemble);
        let acquisition = self.acquisition(&candidates)?;
        let best = acquisition.best_point(&candidates, &bounds, streams)?;
        let value = |p: &Parameter| {
            let at = prior.prior().parameters.iter().position(|known| known.name == p.name)?;
            let proposed = prior.prior().parameters[at].range.extrapolate(best.point[at]);
            Some(ask.given(p).unwrap_or(proposed.clamp(p.range.low, p.range.high)))
        };
        let values = ask.space.parameters().iter().map(value).collect::<Option<Vec<f64>>>()?;
        let expected =
            expectation(&acquisition, ask.direction, &best.point, &ensemble.features(prior.prior(), &best.point));
        let expected = Expectation { worth_the_risk: best.is_worth_the_risk(), ..expected };
        Some(Candidate { expected: Some(expected), ..Candidate::from(values) })
    }

    /// Returns what the model expects at `values`, in the order of the space.
    fn expect(self, values: &[f64]) -> Option<Expectation> {
        let (ask, prior, ensemble) = (self.ask, self.prior, self.ensemble);
        let value = |known: &Parameter| {
            let at = ask.space.parameters().iter().position(|p| p.name == known.name);
            known.range.scale(at.map_or(known.range.low, |at| values[at]))
        };
        let unit: Vec<f64> = prior.prior().parameters.iter().map(value).collect();
        let acquisition = self.acquisition(&[])?;
        Some(expectation(&acquisition, ask.direction, &unit, &ensemble.features(prior.prior(), &unit)))
    }

    /// Returns what the model says of the finished trials.
    fn predict(self) -> Option<Vec<Prediction>> {
        let (direction, jumps) = (self.ask.direction, self.history.jumps.clone());
        let acquisition = self.acquisition(&[])?;
        let prediction = |jump: &Jump| {
            let Expectation { value, deviation, .. } =
                expectation(&acquisition, direction, &jump.point, &jump.features);
            let worth = acquisition.worth(&acquisition.predict(&jump.point, &jump.features));
            let worth = in_own_unit(direction, acquisition.ensemble, worth);
            Prediction { trial: jump.number, stood: jump.stood, value, deviation, worth }
        };
        Some(jumps.iter().map(prediction).collect())
    }

    fn acquisition(self, candidates: &[(Vec<f64>, Features)]) -> Option<Acquisition<'a>> {
        let simulated = (self.prior.prior(), self.ensemble);
        Acquisition::new(simulated, self.models, &self.history, candidates, self.ask.config)
    }

    /// Lower and upper bound of each coordinate of the prior's unit cube; equal for a given parameter, and beyond 0..1 where the study's
    /// bounds are wider.
    fn bounds(&self) -> Vec<(f64, f64)> {
        let bound = |known: &Parameter| {
            let searched = self.ask.space.parameters().iter().find(|p| p.name == known.name);
            let range = searched.map_or(known.range, |p| p.range);
            match searched.and_then(|p| self.ask.given(p)) {
                Some(value) => (known.range.scale(value), known.range.scale(value)),
                None => (known.range.scale(range.low), known.range.scale(range.high)),
            }
        };
        self.prior.prior().parameters.iter().map(bound).collect()
    }

    /// Points within the bounds with their terms: those of the prior where the bounds are the cube, else as many of the same sequence.
    fn candidates(&self, bounds: &[(f64, f64)]) -> Cow<'a, [(Vec<f64>, Features)]> {
        if bounds.iter().all(|bounds| *bounds == (0.0, 1.0)) {
            return Cow::Borrowed(&self.ensemble.candidates);
        }
        let sobol = Sobol::new(bounds.len(), &mut Mt19937::new(CANDIDATE_SEED));
        let candidate = |i| {
            let place = |(u, (low, high)): (f64, &(f64, f64))| low + (high - low) * u;
            let x: Vec<f64> = sobol.point(i).into_iter().zip(bounds).map(place).collect();
            let features = self.ensemble.features(self.prior.prior(), &x);
            (x, features)
        };
        Cow::Owned((0..CANDIDATES).map(candidate).collect())
    }
}

/// The prediction at a point of the unit cube with its terms, in the objective's unit and sign.
fn expectation(acquisition: &Acquisition<'_>, direction: Direction, unit: &[f64], features: &Features) -> Expectation {
    let ensemble = acquisition.ensemble;
    let prediction = acquisition.predict(unit, features);
    let worlds = ensemble.world_values(unit).into_iter().map(|value| direction.maximized(value));
    let worlds = worlds.fold(None, |range: Option<(f64, f64)>, value| {
        Some(range.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
    });
    Expectation {
        value: in_own_unit(direction, ensemble, prediction.mean),
        deviation: ensemble.scale * sqrt(prediction.variance),
        p_stand: prediction.p_stand,
        worlds,
        worth_the_risk: true,
    }
}

/// A scaled value in the objective's unit and sign.
fn in_own_unit(direction: Direction, ensemble: &Ensemble, scaled: f64) -> f64 {
    direction.maximized(ensemble.offset + ensemble.scale * scaled)
}
