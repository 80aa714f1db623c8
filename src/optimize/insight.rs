//! Why a point was proposed and how near the edge it is: for the operator's eyes, never for the sampler's.

use super::importance;
use super::sampler::{Direction, SamplerConfig};
use super::space::{Parameter, Space};
use super::tpe::{Model, joint_space, split};
use super::trial::Trial;
use serde_json::Value;

/// How many of the nearest trials the share of falls is taken over.
pub const NEIGHBOURS: usize = 5;

/// TPE's two densities along one parameter, both per unit of the parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Density {
    /// The parameter.
    pub name: String,
    /// Values of the parameter, ascending from its lower to its upper bound.
    pub at: Vec<f64>,
    /// l(x), of the good trials, at these values.
    pub good: Vec<f64>,
    /// g(x), of the bad ones.
    pub bad: Vec<f64>,
}

/// The densities along every parameter of the space for the present history, at `points` values each (at least 2): in
/// multivariate mode the marginals of the joint densities. Parameters whose range is a point are left out.
pub fn densities(
    config: &SamplerConfig,
    trials: &[Trial],
    space: &Space,
    direction: Direction,
    points: usize,
) -> Vec<Density> {
    let parts = split(trials, direction);
    let joint = if config.multivariate { joint_space(trials) } else { Vec::new() };
    let together = Model::fit(&parts, &joint, true);
    let density = |p: &Parameter| {
        let axis = joint.iter().position(|j| j == p);
        let alone;
        let (model, axis) = match axis {
            Some(axis) => (&together, axis),
            None => {
                alone = Model::fit(&parts, std::slice::from_ref(p), config.multivariate);
                (&alone, 0)
            }
        };
        let last = points.max(2) - 1;
        let at: Vec<f64> = (0..=last).map(|i| p.range.unscale(i as f64 / last as f64)).collect();
        // p(x) = p(ln x) / x for a logarithmic parameter
        let per_unit = |x: f64| if p.range.log { 1.0 / x } else { 1.0 };
        let good = at.iter().map(|&x| model.good.marginal(axis, p.range.inner(x)) * per_unit(x)).collect();
        let bad = at.iter().map(|&x| model.bad.marginal(axis, p.range.inner(x)) * per_unit(x)).collect();
        Density { name: p.name.clone(), at, good, bad }
    };
    space.parameters().iter().filter(|p| !p.range.is_point()).map(density).collect()
}

/// How many finished trials are needed before a share of importance is told: with fewer the best tenth is one trial.
pub const IMPORTANCE_TRIALS: usize = 11;

/// The share of each parameter in reaching the best tenth of the trials, all together 1, in the order of the space; empty
/// while there are fewer than [`IMPORTANCE_TRIALS`] finished trials or nothing can be told.
pub fn importances(trials: &[Trial], space: &Space, direction: Direction) -> Vec<(String, f64)> {
    if trials.iter().filter(|t| t.state.is_observed()).count() < IMPORTANCE_TRIALS {
        return Vec::new();
    }
    let divergences = importance::divergences(trials, space, direction);
    let sum: f64 = divergences.iter().map(|(_, d)| d).sum();
    if sum > 0.0 { divergences.into_iter().map(|(name, d)| (name, d / sum)).collect() } else { Vec::new() }
}

/// How near a point is to trials that fell.
#[derive(Debug, Clone, PartialEq)]
pub struct Risk {
    /// Falls by distance, the nearest first: number of the trial and distance in scaled units, where every parameter's
    /// range has length 1.
    pub falls: Vec<(u32, f64)>,
    /// How many of the nearest trials fell.
    pub fell_near: usize,
    /// How many nearest trials were looked at: [`NEIGHBOURS`], or as many as there are.
    pub neighbours: usize,
}

impl Risk {
    /// Of a point, given by name, among the finished trials that have all parameters of the space.
    pub fn of(point: &[(String, f64)], trials: &[Trial], space: &Space) -> Self {
        let scaled = |value: &dyn Fn(&str) -> Option<f64>| -> Option<Vec<f64>> {
            space.parameters().iter().map(|p| value(&p.name).map(|v| p.range.scale(v))).collect()
        };
        let here = scaled(&|name| point.iter().find(|(n, _)| n == name).map(|(_, v)| *v));
        let distance = |t: &Trial| {
            let there = scaled(&|name| t.parameter(name))?;
            Some(here.as_ref()?.iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt())
        };
        let observed = trials.iter().filter(|t| t.state.is_observed());
        let mut near: Vec<(f64, &Trial)> = observed.filter_map(|t| Some((distance(t)?, t))).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let nearest = &near[..near.len().min(NEIGHBOURS)];
        Risk {
            falls: near.iter().filter(|(_, t)| t.is_fall()).map(|(d, t)| (t.number, *d)).collect(),
            fell_near: nearest.iter().filter(|(_, t)| t.is_fall()).count(),
            neighbours: nearest.len(),
        }
    }

    /// As attributes of a trial: `nearest_fall` (distance in scaled units, null without any fall) and `falls_near`
    /// (`2/5`).
    pub fn attributes(&self) -> [(String, Value); 2] {
        let nearest = self.falls.first().map_or(Value::Null, |(_, d)| Value::from(*d));
        let share = format!("{}/{}", self.fell_near, self.neighbours);
        [("nearest_fall".to_owned(), nearest), ("falls_near".to_owned(), Value::from(share))]
    }
}
