//! The reasons for a proposal and its distance from falls, for the operator; no sampler reads them.

use super::ask::{Direction, SamplerConfig};
use super::importance;
use super::space::{Parameter, Space};
use super::tpe::{TpeModel, joint_space, split};
use super::trial::{Trial, value_of};
use serde_json::Value;

/// Number of nearest trials over which falls are counted.
pub const NEIGHBOURS: usize = 5;

/// TPE's two densities along one parameter, both per unit of the parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Density {
    /// Name of the parameter.
    pub name: String,
    /// Values of the parameter, ascending from its lower to its upper bound.
    pub at: Vec<f64>,
    /// l(x), of the good trials, at these values.
    pub good: Vec<f64>,
    /// g(x), of the bad trials, at these values.
    pub bad: Vec<f64>,
}

/// The densities along every parameter of the space, at `points` values each (at least 2): in multivariate mode the
/// marginals of the joint densities. Parameters whose range is a single point are left out.
pub fn densities(
    config: &SamplerConfig,
    trials: &[Trial],
    space: &Space,
    direction: Direction,
    points: usize,
) -> Vec<Density> {
    let parts = split(trials, direction);
    let joint = if config.multivariate { joint_space(trials) } else { Vec::new() };
    let together = TpeModel::fit(&parts, &joint, true);
    let density = |p: &Parameter| {
        let axis = joint.iter().position(|j| j == p);
        let alone = axis.is_none().then(|| TpeModel::fit(&parts, std::slice::from_ref(p), config.multivariate));
        let (model, axis) = (alone.as_ref().unwrap_or(&together), axis.unwrap_or(0));
        let last = points.max(2) - 1;
        let at: Vec<f64> = (0..=last).map(|i| p.range.unscale(i as f64 / last as f64)).collect();
        // p(x) = p(ln x) / x for a logarithmic parameter
        let per_unit = |x: f64| if p.range.log { 1.0 / x } else { 1.0 };
        let [good, bad] = [&model.good, &model.bad]
            .map(|part| at.iter().map(|&x| part.marginal(axis, p.range.inner(x)) * per_unit(x)).collect());
        Density { name: p.name.clone(), at, good, bad }
    };
    space.parameters().iter().filter(|p| !p.range.is_point()).map(density).collect()
}

/// Finished trials from which on importances are reported: with fewer the best tenth is one trial.
pub const IMPORTANCE_TRIALS: usize = 11;

/// The share of each parameter in reaching the best tenth of the trials, in the order of the space, with sum 1; empty
/// with fewer than [`IMPORTANCE_TRIALS`] finished trials or if all divergences are 0.
pub fn importances(trials: &[Trial], space: &Space, direction: Direction) -> Vec<(String, f64)> {
    if trials.iter().filter(|t| t.state.is_observed()).count() < IMPORTANCE_TRIALS {
        return Vec::new();
    }
    let divergences = importance::divergences(trials, space, direction);
    let sum: f64 = divergences.iter().map(|(_, d)| d).sum();
    if sum > 0.0 { divergences.into_iter().map(|(name, d)| (name, d / sum)).collect() } else { Vec::new() }
}

/// Falls near a point.
#[derive(Debug, Clone, PartialEq)]
pub struct FallProximity {
    /// Falls, nearest first: number of the trial and distance in scaled units (every parameter's range has length 1).
    pub falls: Vec<(u32, f64)>,
    /// Number of falls among the nearest trials.
    pub fell_near: usize,
    /// Number of nearest trials: [`NEIGHBOURS`], or all if there are fewer.
    pub neighbours: usize,
}

impl FallProximity {
    /// Measures a point, given by name, against the finished trials that have all parameters of the space.
    pub fn of(point: &[(String, f64)], trials: &[Trial], space: &Space) -> Self {
        let scaled = |value: &dyn Fn(&str) -> Option<f64>| -> Option<Vec<f64>> {
            space.parameters().iter().map(|p| value(&p.name).map(|v| p.range.scale(v))).collect()
        };
        let here = scaled(&|name| value_of(point, name));
        let distance = |t: &Trial| {
            let there = scaled(&|name| t.parameter(name))?;
            Some(here.as_ref()?.iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt())
        };
        let observed = trials.iter().filter(|t| t.state.is_observed());
        let mut near: Vec<(f64, &Trial)> = observed.filter_map(|t| Some((distance(t)?, t))).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let nearest = &near[..near.len().min(NEIGHBOURS)];
        FallProximity {
            falls: near.iter().filter(|(_, t)| t.is_fall()).map(|(d, t)| (t.number, *d)).collect(),
            fell_near: nearest.iter().filter(|(_, t)| t.is_fall()).count(),
            neighbours: nearest.len(),
        }
    }

    /// The attributes of a trial: `nearest_fall` (distance in scaled units, null without a fall) and `falls_near`
    /// (`2/5`).
    pub fn attributes(&self) -> [(String, Value); 2] {
        let nearest = self.falls.first().map_or(Value::Null, |(_, d)| Value::from(*d));
        let share = format!("{}/{}", self.fell_near, self.neighbours);
        [("nearest_fall".to_owned(), nearest), ("falls_near".to_owned(), Value::from(share))]
    }
}
