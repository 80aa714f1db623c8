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
use super::prior::terms::{CANDIDATES, Ensemble, Features};
use super::sobol::Sobol;
use super::space::Parameter;
use history::{History, Jump};
use libm::sqrt;
use model::{StandingModel, ValueModel};
use search::{Acquisition, PointPrediction};

/// Proposes the next point for the given parameters.
pub fn propose(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let covering = ask.prior.filter(|prior| prior.covers(ask.space).is_ok());
    let proposal = covering.and_then(|prior| about_prior(ask, prior, prior.ensemble()?, streams));
    proposal.unwrap_or_else(|| gp::propose(ask, streams))
}

/// Returns what the model expects of a trial at `values`, in the order of the space.
pub fn expect(ask: &Ask<'_>, values: &[f64]) -> Option<Expectation> {
    let fixed: Vec<(String, f64)> =
        ask.space.parameters().iter().zip(values).map(|(p, value)| (p.name.clone(), *value)).collect();
    let given = Ask { fixed: &fixed, ..*ask };
    // With all parameters given no random number is drawn.
    propose(&given, &mut Streams::new(0)).expected.or_else(|| gp::expect(ask, values))
}

/// Returns what the model says of the finished trials.
pub fn predict(ask: &Ask<'_>) -> Vec<Prediction> {
    let covering = ask.prior.filter(|prior| prior.covers(ask.space).is_ok());
    let about = |prior: &PriorModel| {
        let ensemble = prior.ensemble()?;
        let history = History::gather(prior, ensemble, ask.trials, ask.direction);
        let models = models(ensemble, &history)?;
        let acquisition = Acquisition::new((prior.prior(), ensemble), models, &history, &[], ask.config)?;
        let prediction = |jump: &Jump| {
            let prediction = acquisition.predict(&jump.point, &jump.features);
            let Expectation { value, deviation, .. } =
                expectation(ask.direction, ensemble, &jump.point, &prediction, true);
            let worth = in_own_unit(ask.direction, ensemble, acquisition.worth(&prediction));
            Prediction { trial: jump.number, stood: jump.stood, value, deviation, worth }
        };
        Some(history.jumps.iter().map(prediction).collect())
    };
    covering.and_then(about).unwrap_or_else(|| gp::predict(ask))
}

/// The models of value and standing. `None` if a covariance cannot be factored.
fn models(ensemble: &Ensemble, history: &History) -> Option<(ValueModel, StandingModel)> {
    let checked = safeguard::check(ValueModel::fit(ensemble, history)?, ensemble, history)?;
    let shares = checked.trusted.then(|| worlds::shares(&worlds::log_likelihoods(ensemble, history)));
    Some((checked.value, StandingModel::fit(ensemble, history, shares)?))
}

/// The proposal of the model; `None` if a covariance cannot be factored.
fn about_prior(ask: &Ask<'_>, prior: &PriorModel, ensemble: &Ensemble, streams: &mut Streams) -> Option<Candidate> {
    let history = History::gather(prior, ensemble, ask.trials, ask.direction);
    let search = SearchBox::of(ask, prior);
    let models = models(ensemble, &history)?;
    let all_given = ask.space.parameters().iter().all(|p| ask.given(p).is_some());
    // The first jump was chosen by the simulated robots alone and does not count.
    let begins_anew = !models.1.has_worlds() && history.jumps.len() <= ask.config.startup_trials(ask.space);
    if begins_anew && !all_given {
        // Far from the few jumps all points seem alike: a search would jump one corner of the space after the other.
        let values = model_free::sobol(ask, streams).values;
        return Some(Candidate { expected: expect(ask, &values), ..Candidate::from(values) });
    }
    let candidates = if all_given { Vec::new() } else { search.candidates(prior, ensemble) };
    let acquisition = Acquisition::new((prior.prior(), ensemble), models, &history, &candidates, ask.config)?;
    let (unit, worth_the_risk) = if all_given {
        (search.bounds.iter().map(|(low, _)| *low).collect(), true)
    } else {
        let best = acquisition.best_point(&candidates, &search.bounds, streams)?;
        let worth = best.is_worth_the_risk();
        (best.point, worth)
    };
    let features = ensemble.features(prior.prior(), &unit);
    let prediction = acquisition.predict(&unit, &features);
    let value = |p: &Parameter| {
        let at = prior.prior().parameters.iter().position(|known| known.name == p.name)?;
        let proposed = prior.prior().parameters[at].range.extrapolate(unit[at]);
        Some(ask.given(p).unwrap_or(proposed.clamp(p.range.low, p.range.high)))
    };
    let values = ask.space.parameters().iter().map(value).collect::<Option<Vec<f64>>>()?;
    let expected = Some(expectation(ask.direction, ensemble, &unit, &prediction, worth_the_risk));
    Some(Candidate { expected, ..Candidate::from(values) })
}

/// The prediction in the objective's unit and sign.
fn expectation(
    direction: Direction,
    ensemble: &Ensemble,
    unit: &[f64],
    prediction: &PointPrediction,
    worth_the_risk: bool,
) -> Expectation {
    let worlds = ensemble.world_values(unit).into_iter().map(|value| direction.maximized(value));
    let worlds = worlds.fold(None, |range: Option<(f64, f64)>, value| {
        Some(range.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
    });
    Expectation {
        value: in_own_unit(direction, ensemble, prediction.mean),
        deviation: ensemble.scale * sqrt(prediction.variance),
        p_stand: prediction.p_stand,
        worlds,
        worth_the_risk,
    }
}

/// A scaled value in the objective's unit and sign.
fn in_own_unit(direction: Direction, ensemble: &Ensemble, scaled: f64) -> f64 {
    direction.maximized(ensemble.offset + ensemble.scale * scaled)
}

/// The part of the prior's unit cube that is searched.
struct SearchBox {
    /// Lower and upper bound of each coordinate; equal for a given parameter, and beyond 0..1 where the study's bounds are wider.
    bounds: Vec<(f64, f64)>,
}

impl SearchBox {
    fn of(ask: &Ask<'_>, prior: &PriorModel) -> SearchBox {
        let bound = |known: &Parameter| {
            let searched = ask.space.parameters().iter().find(|p| p.name == known.name);
            let range = searched.map_or(known.range, |p| p.range);
            match searched.and_then(|p| ask.given(p)) {
                Some(value) => (known.range.scale(value), known.range.scale(value)),
                None => (known.range.scale(range.low), known.range.scale(range.high)),
            }
        };
        SearchBox { bounds: prior.prior().parameters.iter().map(bound).collect() }
    }

    /// Points over the box with their terms: those of the prior where the box is the cube, else as many of the same sequence.
    fn candidates(&self, prior: &PriorModel, ensemble: &Ensemble) -> Vec<(Vec<f64>, Features)> {
        if self.bounds.iter().all(|bounds| *bounds == (0.0, 1.0)) {
            return ensemble.candidates.clone();
        }
        let sobol = Sobol::new(self.bounds.len(), &mut Mt19937::new(super::prior::terms::CANDIDATE_SEED));
        let point = |i| -> Vec<f64> {
            sobol.point(i).iter().zip(&self.bounds).map(|(u, (low, high))| low + (high - low) * u).collect()
        };
        let points = (0..CANDIDATES).map(point);
        points
            .map(|x| {
                let features = ensemble.features(prior.prior(), &x);
                (x, features)
            })
            .collect()
    }
}
