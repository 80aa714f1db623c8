//! Dispatch to the sampler of the configuration. No sampler proposes the point of a void trial again.

use super::ask::{Ask, Candidate, Expectation, Prediction, SamplerKind, Streams};
use super::trial::TrialState;
use super::{gp, model_free, sim, tpe};

/// Distance in every parameter, as a share of its range, below which a proposal repeats a void trial.
const SAME_POINT: f64 = 1e-3;
/// Attempts of the sampler, and then of uniform draws, at another point.
const ATTEMPTS: u32 = 16;

/// Proposes the next point. A function of its arguments alone; advances `streams`.
///
/// A void trial has no value to learn from: a deterministic sampler would propose its point again, and the robot would do again
/// what a person has just judged to be no result. A point that is queued is no proposal and is not changed.
pub fn propose(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let candidate = propose_once(ask, streams);
    let all_given = ask.space.parameters().iter().all(|parameter| ask.given(parameter).is_some());
    if all_given || !repeats_void(ask, &candidate) {
        return candidate;
    }
    for attempt in 0..2 * ATTEMPTS {
        let another = if attempt < ATTEMPTS { propose_once(ask, streams) } else { model_free::random(ask, streams) };
        if !repeats_void(ask, &another) {
            return another;
        }
    }
    candidate
}

fn propose_once(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    match ask.config.kind {
        SamplerKind::Tpe => tpe::propose(ask, streams),
        SamplerKind::Gp => gp::propose(ask, streams),
        SamplerKind::Sim => sim::propose(ask, streams),
        SamplerKind::Random => model_free::random(ask, streams),
        SamplerKind::Sobol => model_free::sobol(ask, streams),
    }
}

/// Returns what the sampler's model expects of a trial at `values`, in the order of the space; none for a sampler without a model
/// of the objective, or before the model has enough trials.
pub fn expect(ask: &Ask<'_>, values: &[f64]) -> Option<Expectation> {
    match ask.config.kind {
        SamplerKind::Gp => gp::expect(ask, values),
        SamplerKind::Sim => sim::expect(ask, values),
        SamplerKind::Tpe | SamplerKind::Random | SamplerKind::Sobol => None,
    }
}

/// Returns what the sampler's model says of the finished trials, in the order of their numbers; empty where [`expect`] has
/// nothing.
pub fn predict(ask: &Ask<'_>) -> Vec<Prediction> {
    match ask.config.kind {
        SamplerKind::Gp => gp::predict(ask),
        SamplerKind::Sim => sim::predict(ask),
        SamplerKind::Tpe | SamplerKind::Random | SamplerKind::Sobol => Vec::new(),
    }
}

/// Whether a failed trial has the candidate's values.
fn repeats_void(ask: &Ask<'_>, candidate: &Candidate) -> bool {
    ask.trials.iter().filter(|trial| trial.state == TrialState::Fail).any(|trial| {
        ask.space.parameters().iter().zip(&candidate.values).all(|(parameter, value)| {
            let before = trial.parameter(&parameter.name).map(|value| parameter.range.scale(value));
            before.is_some_and(|before| (before - parameter.range.scale(*value)).abs() < SAME_POINT)
        })
    })
}
