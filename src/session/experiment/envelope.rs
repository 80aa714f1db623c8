//! The hop envelope: on a robot a study begins with weak jumps. The largest forces of its trials are a share of the configured
//! bounds, which grows with each trial that was accepted on that robot (`safety.toml`, `[hop_envelope]`).

use super::attributes::TrialAttributes;
use super::plan::{ExperimentPlan, RequestRefusal, not_now};
use crate::optimize::space::{Parameter, Range, Space};
use crate::optimize::trial::{Trial, TrialState};
use crate::trial::{HopEnvelope, ParameterInfo, Verdict, parameter_unit};

/// Returns the share of the force bounds that the next trial may use; none where the whole bounds are open.
pub fn share(plan: &ExperimentPlan, trials: &[Trial]) -> Option<f64> {
    let HopEnvelope { start, step } = plan.envelope?;
    let accepted = |trial: &&Trial| {
        let kept = TrialAttributes::of(trial);
        let here = kept.backend.as_deref().and_then(|name| name.parse().ok()) == Some(plan.backend);
        here && trial.state == TrialState::Complete && kept.verdict == Some(Verdict::Accept)
    };
    let share = start + step * trials.iter().filter(accepted).count() as f64;
    (share < 1.0).then_some(share)
}

/// Returns the least and the largest allowed value of a force, N; none for a parameter that is no force. The share acts on
/// the magnitude: it counts from the value of the bounds that is nearest to zero, to both sides of it.
fn allowed(plan: &ExperimentPlan, share: f64, name: &str) -> Option<[f64; 2]> {
    let &ParameterInfo { low, high, .. } = plan.parameters.iter().find(|parameter| parameter.name == name)?;
    if parameter_unit(name) != "N" {
        return None;
    }
    let weakest = 0.0_f64.clamp(low, high);
    let [least, most] = [low, high].map(|bound| weakest + share * (bound - weakest));
    // Where the bounds are on one side of zero, the operator's may reach beyond: the same magnitude holds there.
    Some([if low < 0.0 { least } else { -most }, if high > 0.0 { most } else { -least }])
}

/// Returns the part of `space` inside the envelope.
pub fn inside(space: &Space, plan: &ExperimentPlan, share: f64) -> Option<Space> {
    let limited = |Parameter { name, range }: &Parameter| {
        let [least, most] = allowed(plan, share, name).unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        (name.clone(), Range { low: range.low.clamp(least, most), high: range.high.clamp(least, most), ..*range })
    };
    Space::new(space.parameters().iter().map(limited)).ok()
}

/// Refuses a value beyond the envelope.
pub fn must_be_inside(plan: &ExperimentPlan, share: Option<f64>, name: &str, value: f64) -> Result<(), RequestRefusal> {
    let Some(share) = share else { return Ok(()) };
    let beyond = allowed(plan, share, name)
        .and_then(|[least, most]| if value > most { Some(most) } else { (value < least).then_some(least) });
    match beyond {
        Some(limit) => not_now(format!(
            "{name} = {value} N is beyond the hop envelope, at present {limit:.0} N ({:.0} % of the bounds); each trial that is accepted on this robot widens it",
            100.0 * share
        )),
        None => Ok(()),
    }
}
