//! The tree-structured Parzen estimator, equal to Optuna 5.0's `TPESampler` for float parameters.
//!
//! Bergstra et al., NeurIPS 2011; Watanabe, "Tree-structured Parzen estimator", arXiv:2304.11127. Finished trials are
//! split into good and bad; l(x) and g(x) are the Parzen estimators of the two; of 24 candidates drawn from l the one
//! with the largest l(x)/g(x) is proposed. Running trials count as bad (constant liar), which keeps parallel workers
//! apart. `docs/tpe.md` has the rules of Optuna 5.0 in full.

use super::ask::{Ask, Candidate, Direction, SamplerConfig, Streams};
use super::model_free::uniform;
use super::mt19937::Mt19937;
use super::parzen::Parzen;
use super::space::{Parameter, Range, Space};
use super::trial::{Trial, TrialState, value_of};
use std::cmp::Ordering;

/// Number of good trials among `n` finished ones: min(ceil(0.1 n), 25).
pub fn good_count(n: usize) -> usize {
    ((0.1 * n as f64).ceil() as usize).min(25)
}

/// Trials split into good and bad, each in the order of their numbers.
#[derive(Debug)]
pub struct TpeSplit<'a> {
    /// The best tenth.
    pub good: Vec<&'a Trial>,
    /// The others, running ones included.
    pub bad: Vec<&'a Trial>,
}

/// Splits the history; failed and waiting trials are in neither part.
pub fn split(trials: &[Trial], direction: Direction) -> TpeSplit<'_> {
    let observed = trials.iter().filter(|t| t.state.is_observed());
    let places = good_count(observed.clone().count());
    let (feasible, mut infeasible): (Vec<&Trial>, Vec<&Trial>) = observed.partition(|t| t.violation() <= 0.0);
    let (mut complete, mut pruned): (Vec<&Trial>, Vec<&Trial>) =
        feasible.into_iter().partition(|t| t.state == TrialState::Complete);
    // Stable sorts: equal trials keep the order of their numbers.
    complete.sort_by(|a, b| direction.best_first(a.value.unwrap_or(f64::NAN), b.value.unwrap_or(f64::NAN)));
    pruned.sort_by(|a, b| pruned_order(a, b, direction));
    infeasible.sort_by(|a, b| a.violation().total_cmp(&b.violation()));
    let ranked: Vec<&Trial> = complete.into_iter().chain(pruned).chain(infeasible).collect();
    let (good, bad) = ranked.split_at(places.min(ranked.len()));
    let (mut good, mut bad) = (good.to_vec(), bad.to_vec());
    bad.extend(trials.iter().filter(|t| t.state == TrialState::Running));
    for part in [&mut good, &mut bad] {
        part.sort_by_key(|t| t.number);
    }
    TpeSplit { good, bad }
}

/// Order of pruned trials: by last step, descending, then by the value there; those without intermediate values last.
fn pruned_order(a: &Trial, b: &Trial, direction: Direction) -> Ordering {
    let key = |t: &Trial| match t.intermediate.last_key_value() {
        None => (1, 0.0),
        Some((step, v)) if v.is_nan() => (-step, f64::INFINITY),
        Some((step, v)) => (-step, if direction == Direction::Maximize { -v } else { *v }),
    };
    let ((step_a, value_a), (step_b, value_b)) = (key(a), key(b));
    step_a.cmp(&step_b).then(value_a.partial_cmp(&value_b).unwrap_or(Ordering::Equal))
}

/// Parameters that every finished trial has with the same range, sorted by name: those sampled jointly.
pub fn joint_space(trials: &[Trial]) -> Vec<Parameter> {
    let mut observed = trials.iter().filter(|t| t.state.is_observed());
    let Some(first) = observed.next() else { return Vec::new() };
    let mut joint: Vec<Parameter> = first
        .parameters
        .iter()
        .zip(&first.distributions)
        .filter_map(|((name, _), d)| Some(Parameter { name: name.clone(), range: d.range()? }))
        .collect();
    for trial in observed {
        joint.retain(|p| trial.distribution(&p.name).and_then(|d| d.range()) == Some(p.range));
    }
    joint.retain(|p| !p.range.is_point());
    joint.sort_by(|a, b| a.name.cmp(&b.name));
    joint
}

/// The two densities over some parameters.
pub struct TpeModel {
    parameters: Vec<Parameter>,
    /// l(x), of the good trials.
    pub good: Parzen,
    /// g(x), of the bad trials.
    pub bad: Parzen,
}

impl TpeModel {
    /// Fits both densities. `announced`: whether the joint samples announced by running trials substitute for
    /// parameters that are not set yet.
    pub fn fit(split: &TpeSplit<'_>, parameters: &[Parameter], announced: bool) -> Self {
        let bounds: Vec<(f64, f64)> = parameters.iter().map(|p| p.range.inner_bounds()).collect();
        let fit = |trials: &[&Trial]| Parzen::new(&observations(trials, parameters, announced), &bounds);
        TpeModel { parameters: parameters.to_vec(), good: fit(&split.good), bad: fit(&split.bad) }
    }

    /// Returns the best of `candidates` points drawn from l, in the parameters' own units and in their order.
    pub fn propose(&self, stream: &mut Mt19937, candidates: usize) -> Vec<f64> {
        let drawn = self.good.sample(stream, candidates);
        let ranges: Vec<Range> = self.parameters.iter().map(|p| p.range).collect();
        let values: Vec<Vec<f64>> =
            drawn.iter().zip(&ranges).map(|(column, r)| column.iter().map(|&x| r.outer(x)).collect()).collect();
        // Scored at the value that is proposed: for logarithmic parameters ln of the rounded exp.
        let scored: Vec<Vec<f64>> =
            values.iter().zip(&ranges).map(|(column, r)| column.iter().map(|&v| r.inner(v)).collect()).collect();
        let (log_l, log_g) = (self.good.log_density(&scored), self.bad.log_density(&scored));
        let mut best = 0;
        for i in 1..candidates {
            if log_l[i] - log_g[i] > log_l[best] - log_g[best] {
                best = i;
            }
        }
        values.iter().map(|column| column[best]).collect()
    }
}

/// Search coordinates, by parameter, of the trials that have every parameter. One without a finite coordinate, of another program, is no
/// observation: a kernel there has no density.
fn observations(trials: &[&Trial], parameters: &[Parameter], announced: bool) -> Vec<Vec<f64>> {
    let mut columns = vec![Vec::with_capacity(trials.len()); parameters.len()];
    for trial in trials {
        let sample = if announced && trial.state == TrialState::Running { trial.announced() } else { Vec::new() };
        let value = |p: &Parameter| trial.parameter(&p.name).or_else(|| value_of(&sample, &p.name));
        let inner = |p: &Parameter| value(p).map(|v| p.range.inner(v)).filter(|x| x.is_finite());
        let row: Option<Vec<f64>> = parameters.iter().map(inner).collect();
        columns.iter_mut().zip(row.into_iter().flatten()).for_each(|(column, x)| column.push(x));
    }
    columns
}

/// Returns whether the next point is drawn without the model: too few trials have been observed.
pub fn starts_at_random(config: &SamplerConfig, trials: &[Trial], space: &Space) -> bool {
    trials.iter().filter(|t| t.state.is_observed()).count() < config.startup_trials(space)
}

/// Proposes the next point, parameter by parameter as Optuna asks for them.
pub fn propose(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let Ask { config, trials, space, direction, .. } = *ask;
    let startup = starts_at_random(config, trials, space);
    let mut parts: Option<TpeSplit<'_>> = None;
    let mut joint: Option<Vec<(String, f64)>> = None;
    let mut values = Vec::with_capacity(space.parameters().len());
    for parameter in space.parameters() {
        let Parameter { name, range } = parameter;
        let value = if let Some(given) = ask.given(parameter) {
            given
        } else if startup {
            uniform(range, &mut streams.startup)
        } else {
            let parts = parts.get_or_insert_with(|| split(trials, direction));
            let joint = joint.get_or_insert_with(|| {
                let together = if config.multivariate { joint_space(trials) } else { Vec::new() };
                if together.is_empty() {
                    return Vec::new();
                }
                let point = TpeModel::fit(parts, &together, true).propose(&mut streams.model, config.candidates);
                together.into_iter().map(|p| p.name).zip(point).collect()
            });
            value_of(joint, name).filter(|v| range.contains(*v)).unwrap_or_else(|| {
                let alone = TpeModel::fit(parts, std::slice::from_ref(parameter), config.multivariate);
                // Of a kernel far beyond the bounds the rounding reaches beyond them, too.
                alone.propose(&mut streams.model, config.candidates)[0].max(range.low).min(range.high)
            })
        };
        values.push(value);
    }
    Candidate { values, joint: joint.unwrap_or_default(), expected: None }
}
