//! The vocabulary of an ask: direction, settings, random streams, question ([`Ask`]) and answer ([`Candidate`]).

use super::mt19937::Mt19937;
use super::prior::PriorModel;
use super::space::{Parameter, Space};
use super::trial::{Trial, value_of};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use strum::{EnumString, IntoStaticStr, VariantArray};

/// Whether the objective is minimized or maximized; the discriminants are the journal's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Direction {
    /// Smaller is better.
    Minimize = 1,
    /// Larger is better.
    Maximize = 2,
}

impl Direction {
    /// Orders two objective values, the better one first. A NaN comes after every number: a total order, as sorting needs it.
    pub fn best_first(self, a: f64, b: f64) -> Ordering {
        match a.partial_cmp(&b) {
            Some(ascending) if self == Direction::Maximize => ascending.reverse(),
            Some(ascending) => ascending,
            None => a.is_nan().cmp(&b.is_nan()),
        }
    }

    /// Returns a value of the objective with the sign by which larger is better, or one with that sign as the objective's.
    pub fn maximized(self, value: f64) -> f64 {
        if self == Direction::Maximize { value } else { -value }
    }
}

/// The algorithm that proposes candidates.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, EnumString, IntoStaticStr, VariantArray,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum SamplerKind {
    /// Tree-structured Parzen estimator, as Optuna 5.0.
    #[default]
    Tpe,
    /// Gaussian process with expected improvement: better with only some tens of trials.
    Gp,
    /// Gaussian process about the results of simulated robots: for some five trials on a robot.
    Sim,
    /// Uniform random points.
    Random,
    /// Points of the Sobol sequence: evenly spread, independent of results.
    Sobol,
}

impl SamplerKind {
    /// All samplers.
    pub const ALL: &[SamplerKind] = <SamplerKind as VariantArray>::VARIANTS;

    /// Returns the name in files, recordings and on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// The settings of `[sampler]` in `config/optimize.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SamplerConfig {
    /// The sampler.
    pub kind: SamplerKind,
    /// TPE: whether all parameters are sampled jointly (Optuna 5) or one by one (Optuna 3, the paper).
    pub multivariate: bool,
    /// Seed of the random streams.
    pub seed: u32,
    /// Finished trials before the model proposes; until then points are drawn over the whole space.
    /// Default: 10 for TPE, as Optuna; the number of parameters plus two for the Gaussian process, and for `sim` where it leaves a wrong
    /// simulator.
    pub startup_trials: Option<usize>,
    /// TPE: candidates drawn from l(x) for one proposal.
    pub candidates: usize,
    /// `sim`: probability of standing, 0..1, below which no gain is worth a jump; three times the risk of a fall where the simulated
    /// robots are left, after a start as with `gp`, which has no bound (`src/optimize/README.md`, "Ask", "Wrong simulator").
    pub least_p_stand: f64,
    /// `sim`: price of a fall, as a share of the predicted value of the best jump so far, counted from the lowest value of the simulated
    /// robots where that is negative. In `config/optimize.toml` each task has its own.
    #[serde(skip_deserializing)]
    pub fall_price: f64,
}

impl Default for SamplerConfig {
    fn default() -> Self {
        SamplerConfig {
            kind: SamplerKind::Tpe,
            multivariate: true,
            seed: 0,
            startup_trials: None,
            candidates: 24,
            least_p_stand: 0.85,
            fall_price: 0.2,
        }
    }
}

impl SamplerConfig {
    /// Number of finished trials from which on the model proposes.
    pub fn startup_trials(&self, space: &Space) -> usize {
        let default =
            if matches!(self.kind, SamplerKind::Gp | SamplerKind::Sim) { space.parameters().len() + 2 } else { 10 };
        self.startup_trials.unwrap_or(default)
    }
}

/// The two random streams of a sampler, both of the same seed. They are independent, so that the number of startup
/// points does not change the draws of the model.
#[derive(Debug, Clone)]
pub struct Streams {
    /// Read when the model proposes.
    pub model: Mt19937,
    /// Read when a point is drawn over the whole space.
    pub startup: Mt19937,
}

/// Positions in the streams of one seed, from which they can be continued.
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

    /// Present positions.
    pub fn draws(&self) -> Draws {
        Draws { model: self.model.drawn(), startup: self.startup.drawn() }
    }

    /// Reads on to `draws`; a stream beyond its position there does not move.
    pub fn advance_to(&mut self, draws: Draws) {
        self.model.advance_to(draws.model);
        self.startup.advance_to(draws.startup);
    }
}

/// The inputs of a sampler.
#[derive(Debug, Clone, Copy)]
pub struct Ask<'a> {
    /// Settings of the sampler.
    pub config: &'a SamplerConfig,
    /// All trials except the one that is asked for.
    pub trials: &'a [Trial],
    /// Parameters to choose, with their bounds.
    pub space: &'a Space,
    /// Given parameters of the trial that is asked for.
    pub fixed: &'a [(String, f64)],
    /// Direction of the objective.
    pub direction: Direction,
    /// Results of simulated robots, for [`SamplerKind::Sim`].
    pub prior: Option<&'a PriorModel>,
}

impl Ask<'_> {
    /// The value of a parameter that needs no choice: a given one, or the only one in its range.
    pub fn given(&self, parameter: &Parameter) -> Option<f64> {
        value_of(self.fixed, &parameter.name).or(parameter.range.is_point().then_some(parameter.range.low))
    }
}

/// A point that a sampler proposes.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// One value per parameter, in the order of the space.
    pub values: Vec<f64>,
    /// TPE: the joint sample behind it, by name, including parameters that were fixed; empty if none was drawn.
    pub joint: Vec<(String, f64)>,
    /// Expectation of the sampler's model of a trial there; none for a sampler without a model of the objective.
    pub expected: Option<Expectation>,
}

impl From<Vec<f64>> for Candidate {
    fn from(values: Vec<f64>) -> Self {
        Candidate { values, joint: Vec::new(), expected: None }
    }
}

/// Expectation of a model of a trial before it runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Expectation {
    /// Mean of the objective if the robot stands, in the objective's unit.
    pub value: f64,
    /// Standard deviation of this mean, without the noise of a trial, in the objective's unit.
    pub deviation: f64,
    /// Probability that the trial ends without a fall, 0..1.
    pub p_stand: f64,
    /// Smallest and largest value of the simulated robots there; none without a prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worlds: Option<(f64, f64)>,
    /// Whether the gain that is expected anywhere is worth its risk of a fall: if not, the sampler advises to end the search and
    /// to confirm the best.
    pub worth_the_risk: bool,
}

/// Prediction of a model of a finished trial, after it has learned from all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Number of the trial.
    pub trial: u32,
    /// Whether it stood.
    pub stood: bool,
    /// Mean of the objective at its point if the robot stands, in the objective's unit.
    pub value: f64,
    /// Standard deviation of this mean, without the noise of a trial, in the objective's unit.
    pub deviation: f64,
    /// Value by which trials that stood are compared for the best, in the objective's unit: the mean, less the risk of a fall where the
    /// sampler knows it.
    pub worth: f64,
}
