//! What a sampler is told and what it answers; which sampler is used is a setting.

use super::gp;
use super::mt19937::Mt19937;
use super::sobol::Sobol;
use super::space::{Parameter, Space};
use super::tpe;
use super::trial::Trial;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Whether the objective is to become large or small; the discriminants are the journal's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Smaller is better.
    Minimize = 1,
    /// Larger is better.
    Maximize = 2,
}

impl Direction {
    /// Orders two objective values, the better one first.
    pub fn best_first(self, a: f64, b: f64) -> Ordering {
        let ascending = a.partial_cmp(&b).unwrap_or(Ordering::Equal);
        if self == Direction::Maximize { ascending.reverse() } else { ascending }
    }
}

/// Which sampler proposes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SamplerKind {
    /// Tree-structured Parzen estimator, as Optuna 5.0.
    #[default]
    Tpe,
    /// Gaussian process with expected improvement: better where there are only some tens of trials.
    Gp,
    /// Uniform random points.
    Random,
    /// Points of the Sobol sequence: even, but blind to results.
    Sobol,
}

impl SamplerKind {
    const ALL: [SamplerKind; 4] = [SamplerKind::Tpe, SamplerKind::Gp, SamplerKind::Random, SamplerKind::Sobol];

    /// Returns the name in files and recordings.
    pub const fn name(self) -> &'static str {
        match self {
            SamplerKind::Tpe => "tpe",
            SamplerKind::Gp => "gp",
            SamplerKind::Random => "random",
            SamplerKind::Sobol => "sobol",
        }
    }

    /// Returns the sampler of that name.
    pub fn from_name(name: &str) -> Option<SamplerKind> {
        SamplerKind::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// The settings of `[sampler]` in `config/optimize.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SamplerConfig {
    /// Which sampler proposes.
    pub kind: SamplerKind,
    /// TPE: whether all parameters are sampled together (Optuna 5) or one by one (Optuna 3, the paper).
    pub multivariate: bool,
    /// Seed of the random streams.
    pub seed: u32,
    /// How many finished trials are needed before the model proposes; until then points are drawn over the whole space.
    /// Left out: 10 for TPE, as Optuna; two more than there are parameters for the Gaussian process.
    pub startup_trials: Option<usize>,
    /// TPE: how many candidates are drawn from l(x) for one proposal.
    pub candidates: usize,
}

impl Default for SamplerConfig {
    fn default() -> Self {
        SamplerConfig { kind: SamplerKind::Tpe, multivariate: true, seed: 0, startup_trials: None, candidates: 24 }
    }
}

impl SamplerConfig {
    /// How many finished trials are needed before the model proposes.
    pub fn startup_trials(&self, space: &Space) -> usize {
        let usual = if self.kind == SamplerKind::Gp { space.parameters().len() + 2 } else { 10 };
        self.startup_trials.unwrap_or(usual)
    }
}

/// The two random streams of a sampler, both of the same seed. They never influence one another, so that the number of
/// startup points does not change what the model draws.
#[derive(Debug, Clone)]
pub struct Streams {
    /// Read when the model proposes.
    pub model: Mt19937,
    /// Read when a point is drawn over the whole space.
    pub startup: Mt19937,
}

/// How far the streams of one seed have been read: what has to be kept to continue them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Draws {
    /// Doubles taken from [`Streams::model`].
    pub model: u64,
    /// Doubles taken from [`Streams::startup`].
    pub startup: u64,
}

impl Streams {
    /// Both streams at their start.
    pub fn new(seed: u32) -> Self {
        Streams { model: Mt19937::new(seed), startup: Mt19937::new(seed) }
    }

    /// How far they have been read.
    pub fn draws(&self) -> Draws {
        Draws { model: self.model.drawn(), startup: self.startup.drawn() }
    }

    /// Reads on to `draws`; a stream that is farther already stays where it is.
    pub fn advance_to(&mut self, draws: Draws) {
        self.model.advance_to(draws.model);
        self.startup.advance_to(draws.startup);
    }
}

/// A proposed point.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// One value per parameter, in the order of the space.
    pub values: Vec<f64>,
    /// TPE: the joint sample behind it, by name, also of parameters that were fixed; empty where none was drawn.
    pub joint: Vec<(String, f64)>,
}

/// The next point of the sampler of `config`, given the history. `trials` holds everything but the trial that is being
/// asked for; `fixed` are parameters of it that are given. A function of its arguments alone; `streams` moves on.
pub fn propose(
    config: &SamplerConfig,
    streams: &mut Streams,
    trials: &[Trial],
    space: &Space,
    fixed: &[(String, f64)],
    direction: Direction,
) -> Proposal {
    match config.kind {
        SamplerKind::Tpe => tpe::propose(config, streams, trials, space, fixed, direction),
        SamplerKind::Gp => gp::propose(config, streams, trials, space, fixed, direction),
        SamplerKind::Random => random(streams, space, fixed),
        SamplerKind::Sobol => startup_point(config.seed, streams, space, fixed),
    }
}

fn random(streams: &mut Streams, space: &Space, fixed: &[(String, f64)]) -> Proposal {
    let value = |p: &Parameter| given(p, fixed).unwrap_or_else(|| tpe::uniform(&p.range, &mut streams.startup));
    Proposal { values: space.parameters().iter().map(value).collect(), joint: Vec::new() }
}

/// The next point of the seed's Sobol sequence; takes one double per parameter, unless all are given.
pub(super) fn startup_point(seed: u32, streams: &mut Streams, space: &Space, fixed: &[(String, f64)]) -> Proposal {
    let parameters = space.parameters();
    let mut values: Vec<Option<f64>> = parameters.iter().map(|p| given(p, fixed)).collect();
    if values.iter().any(Option::is_none) {
        // The shift is the seed's; only the position moves on.
        let sequence = Sobol::new(parameters.len(), &mut Mt19937::new(seed));
        let index = streams.startup.drawn() / parameters.len() as u64;
        streams.startup.advance_to((index + 1) * parameters.len() as u64);
        for ((value, p), u) in values.iter_mut().zip(parameters).zip(sequence.point(index as u32)) {
            value.get_or_insert_with(|| p.range.unscale(u));
        }
    }
    Proposal { values: values.into_iter().flatten().collect(), joint: Vec::new() }
}

/// The value that a parameter has without being chosen: a given one, or the only one there is.
fn given(parameter: &Parameter, fixed: &[(String, f64)]) -> Option<f64> {
    let value = fixed.iter().find(|(n, _)| *n == parameter.name).map(|(_, v)| *v);
    value.or(parameter.range.is_point().then_some(parameter.range.low))
}
