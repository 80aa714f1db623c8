//! Search space, reasons of a proposal and statistics of repeated points, as they are shown.

use super::{ParameterInfo, ParameterValues, ProposalSource, four_digits};

/// The present search space and the progress of the study.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SearchStatus {
    /// Trials that are to count.
    pub budget: u32,
    /// Trials that count so far: accepted or fallen, without repeats that confirm the best.
    pub counted: u32,
    /// Every parameter, in table order.
    pub parameters: Vec<SearchedParameter>,
    /// Repeats left to confirm the best; none while no confirmation runs.
    pub confirming: Option<u32>,
    /// Share of the force bounds that trials on the robot may use; none where the whole bounds are open.
    pub hop_share: Option<f64>,
    /// Points that run before the sampler's, the next one first.
    pub queue: Vec<QueuedPoint>,
}

/// A point that was queued.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct QueuedPoint {
    /// The trial that it will be.
    pub trial: u32,
    /// Why it was queued.
    pub source: ProposalSource,
    /// The trial that it repeats.
    pub parent: Option<u32>,
    /// Parameters that are given, in their units; the others are proposed when it is its turn.
    pub parameters: ParameterValues,
    /// Gains that differ from the configured ones.
    pub gains: ParameterValues,
}

impl QueuedPoint {
    /// Returns its values in words, `f0 1.300 Hz, Fx 90.00 N`, with the units of `known` parameters and gains; those that it lacks come
    /// from the sampler.
    pub fn in_words<'a>(&self, known: impl Iterator<Item = &'a ParameterInfo> + Clone) -> String {
        let in_words = |(name, value): &(String, f64)| {
            let unit = known.clone().find(|info| info.name == *name).map_or("", |info| info.unit.as_str());
            format!("{name} {} {unit}", four_digits(*value)).trim_end().to_owned()
        };
        let values: Vec<String> = self.parameters.iter().chain(self.gains.iter()).map(in_words).collect();
        if values.is_empty() { "parameters from the sampler".to_owned() } else { values.join(", ") }
    }
}

/// One parameter as it is searched at present.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SearchedParameter {
    /// Name.
    pub name: String,
    /// Present lower bound, in the parameter's unit.
    pub low: f64,
    /// Present upper bound.
    pub high: f64,
    /// The least lower bound that it may be given (`safety.toml`).
    pub least: f64,
    /// The greatest upper bound that it may be given.
    pub most: f64,
    /// Its value for the next trials, if the operator has fixed it.
    pub fixed: Option<FixedParameter>,
}

/// The range from which a parameter of one trial was drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DrawnRange {
    /// Name of the parameter.
    pub name: String,
    /// Lower end, in the parameter's unit.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A parameter that is fixed for some trials.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FixedParameter {
    /// Its value, in the parameter's unit.
    pub value: f64,
    /// Trials left, including the proposed one.
    pub trials: u32,
}

/// Reasons of a proposal.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProposalInsight {
    /// The proposed trial.
    pub trial: u32,
    /// Every parameter, in table order.
    pub parameters: Vec<ParameterInsight>,
    /// Predictions of the sampler's model of the finished trials, in the order of their numbers; empty without a model.
    pub predicted: Vec<PredictedTrial>,
    /// The trial that is the best by the model among those that stood: a single jump may be lucky.
    pub best: Option<u32>,
    /// Comparison of the robot with the simulator; none for a sampler without a prior.
    pub simulator: Option<SimulatorComparison>,
}

impl ProposalInsight {
    /// Returns what the model says of the trial that it takes for the best.
    pub fn predicted_best(&self) -> Option<&PredictedTrial> {
        self.predicted.iter().find(|predicted| Some(predicted.trial) == self.best)
    }
}

/// Prediction of a model of a finished trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PredictedTrial {
    /// Its number.
    pub trial: u32,
    /// Mean objective at its point if the robot stands, in the study's unit.
    pub value: f64,
    /// Standard deviation of this mean, without the noise of a trial, in the study's unit.
    pub deviation: f64,
}

/// The robot as the sampler `sim` sees it beside its simulated robots.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SimulatorComparison {
    /// rho: ratio of the change of the robot's values over the parameters to the simulated change, 1 for a robot that jumps as simulated.
    pub ratio: f64,
    /// Standard deviation of the ratio.
    pub ratio_deviation: f64,
    /// b: difference of the robot's values from the simulated mean everywhere, in the study's unit.
    pub bias: f64,
    /// Standard deviation of the bias, in the study's unit.
    pub bias_deviation: f64,
    /// The simulated robots, the most alike first.
    pub worlds: Vec<WorldResemblance>,
    /// Whether the robot's values contradict the simulated ones, so that the sampler does not use them.
    pub contradicted: bool,
}

/// One simulated robot beside the real one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorldResemblance {
    /// Its name.
    pub name: String,
    /// Probability that the robot's results are those of this one rather than of another, 0 to 1, all together 1.
    pub weight: f64,
}

/// Reasons of one parameter's proposed value, and its importance.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterInsight {
    /// Name.
    pub name: String,
    /// The proposed value, in the parameter's unit.
    pub proposed: f64,
    /// Share of this parameter in reaching the best tenth of the trials, 0 to 1, all together 1 (PED-ANOVA); none while
    /// there are too few trials to tell.
    pub importance: Option<f64>,
    /// Values at which the densities are given, from the lower to the upper bound; empty where TPE does not propose.
    pub at: Vec<f64>,
    /// TPE's l(x), of the good trials, per unit of the parameter.
    pub good: Vec<f64>,
    /// TPE's g(x), of the others.
    pub bad: Vec<f64>,
}

/// A point that was run more than once or is being confirmed; repeats are aggregated as in `optimize::repeats`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointRecord {
    /// Parameters by name, in table order.
    pub parameters: ParameterValues,
    /// Its trials that count, ascending: n is their number.
    pub trials: Vec<u32>,
    /// k: number of them that did not fall.
    pub without_fall: u32,
    /// Mean value, falls included.
    pub mean: f64,
    /// Standard deviation of a single repeat, from two repeats on.
    pub deviation: Option<f64>,
    /// Whether it is or was one of the points among which the best is confirmed.
    pub contender: bool,
    /// The confidence that it is the best of the contenders; of the leading one alone.
    pub confidence: Option<f64>,
}
