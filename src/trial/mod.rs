//! Vocabulary of a trial: task, parameters with units, proposal, status, verdict, measured values.

mod measured;
mod overrides;
mod parameters;
mod record;
mod search;

pub use self::measured::{BounceRule, CHANGED, Displacement, JumpRow, MeasuredJump, ObjectiveRule, RepeatRecord};
pub use self::overrides::Overrides;
pub use self::parameters::{
    GAIN_UNITS, Gains, JumpParameters, ParameterInfo, ParameterValues, is_gain, other_gains, parameter_unit,
};
pub(crate) use self::record::NOT_RECORDED;
pub use self::record::{NOT_RUN, PRUNED, REMOVED, SKIPPED, TrialRecord, is_changed_verdict};
pub use self::search::{
    DrawnRange, FixedParameter, ParameterInsight, PointRecord, PredictedTrial, ProposalInsight, QueuedPoint,
    SearchStatus, SearchedParameter, SimulatorComparison, WorldResemblance,
};

use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// Returns a number of things in words, `1 trial` or `5 trials`.
pub fn counted(number: usize, thing: &str) -> String {
    if number == 1 { format!("1 {thing}") } else { format!("{number} {thing}s") }
}

/// Returns a number of things and their verb, "1 chunk is" or "5 chunks are".
pub(crate) fn counted_are(number: usize, thing: &str) -> String {
    format!("{} {}", counted(number, thing), if number == 1 { "is" } else { "are" })
}

/// Returns a number for a message: at most six significant digits, without zeros at the end.
pub fn six_digits(value: f64) -> String {
    format!("{value:.5e}").parse::<f64>().unwrap_or(value).to_string()
}

/// Returns a number for a screen, with four significant digits, as far as they fit: 1.243, 18.20, 118.2, 1240.
pub fn four_digits(value: f64) -> String {
    match value.abs() {
        _ if !value.is_finite() => "-".to_owned(),
        size if size >= 1000.0 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.1}"),
        size if size >= 10.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// The robot behind the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, EnumString, IntoStaticStr, VariantArray)]
pub enum Backend {
    /// The built-in simulator.
    #[strum(serialize = "sim")]
    Simulator,
    /// A robot over its network; `go1` in files of earlier versions.
    #[strum(serialize = "hardware", serialize = "go1")]
    Hardware,
}

impl Backend {
    /// Returns the name in recordings.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// The kind of jump that is optimized; decides the signs of the force amplitudes and the objective.
#[expect(missing_docs, reason = "the names say the direction; that of a twist is seen from above")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, EnumString, IntoStaticStr, VariantArray)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Task {
    Forward,
    LateralLeft,
    LateralRight,
    TwistCcw,
    TwistCw,
}

impl Task {
    /// All tasks.
    pub const ALL: [Task; Task::VARIANTS.len()] = *Task::VARIANTS.first_chunk().unwrap();

    /// Returns the name on the command line and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Returns the unit of a jump's displacement or turn: m, or rad for a twist.
    pub const fn unit(self) -> &'static str {
        match self {
            Task::Forward | Task::LateralLeft | Task::LateralRight => "m",
            Task::TwistCcw | Task::TwistCw => "rad",
        }
    }

    /// Returns the unit of the objective: that of a jump, or with `rate` per second.
    pub fn objective_unit(self, rate: bool) -> &'static str {
        match (self.unit(), rate) {
            (unit, false) => unit,
            ("m", true) => "m/s",
            (_, true) => "rad/s",
        }
    }
}

/// Rule by which jumps are approved and judged. STOP, the loss of the operator and every limit work the same in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "kebab-case")]
pub enum Approval {
    /// A person approves and judges each jump.
    #[default]
    Each,
    /// A jump that landed and settled is accepted automatically, and on the simulator the next jump is approved
    /// automatically; a fall or an interrupted jump waits for a person.
    FallsOnly,
    /// Everything is approved and judged automatically; on the simulator only.
    Auto,
}

impl Approval {
    /// All of them.
    pub const ALL: [Approval; Approval::VARIANTS.len()] = *Approval::VARIANTS.first_chunk().unwrap();

    /// Returns the name on the command line and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Stage of the experiment's current trial.
///
/// ```text
/// proposed -> running -> review -> proposed | finished
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum ExperimentStage {
    /// A proposal waits for approval.
    #[default]
    Proposed,
    /// The trial was approved and runs.
    Running,
    /// The trial was measured and waits for its verdict.
    Review,
    /// The budget is used up.
    Finished,
}

impl ExperimentStage {
    /// All stages.
    pub const ALL: [ExperimentStage; ExperimentStage::VARIANTS.len()] =
        *ExperimentStage::VARIANTS.first_chunk().unwrap();

    /// Returns the name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Origin of a trial's parameters.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, EnumString, IntoStaticStr, VariantArray,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "lowercase")]
pub enum ProposalSource {
    /// The sampler alone.
    #[default]
    Sampler,
    /// The operator changed at least one.
    Operator,
    /// A re-run of an earlier trial.
    #[serde(rename = "re-run")]
    #[strum(serialize = "re-run")]
    Rerun,
    /// A point queued beforehand, by the operator or by another program.
    Queued,
    /// A repeat of one of the best points, to confirm the best; beyond the budget.
    Confirm,
    /// Another program ran the trial.
    #[strum(serialize = "other program")]
    OtherProgram,
}

impl ProposalSource {
    /// All sources.
    pub const ALL: [ProposalSource; ProposalSource::VARIANTS.len()] = *ProposalSource::VARIANTS.first_chunk().unwrap();

    /// Returns the name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Returns the name with the number of the trial that is repeated, if there is one: `re-run of #3`; with values of the operator
    /// `changed re-run of #3`.
    pub fn with_parent(self, parent: Option<u32>) -> String {
        match (self, parent) {
            (ProposalSource::Operator, Some(parent)) => {
                format!("changed {} of #{parent}", ProposalSource::Rerun.name())
            }
            (_, Some(parent)) => format!("{} of #{parent}", self.name()),
            (_, None) => self.name().to_owned(),
        }
    }
}

/// A proposed trial: the values that run if it is approved.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Proposal {
    /// The number that the trial will have.
    pub trial: u32,
    /// Changed by every override: an approval names the revision that the operator saw.
    pub revision: u32,
    /// Origin of the parameters.
    pub source: ProposalSource,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// The values, in table order.
    pub parameters: Vec<ProposedParameter>,
    /// Distance to earlier falls; none before the first judged trial.
    pub risk: Option<FallRisk>,
    /// Expectation of the sampler's model of the values that run; none for a sampler without a model.
    pub expected: Option<ExpectedResult>,
    /// The controller's gains, in table order; `proposed` is the configured value.
    pub gains: Vec<ProposedParameter>,
    /// Number of the rollout within the trial, from 1; 0 for a trial that is one rollout.
    pub repeat: u32,
    /// Rollouts of the trial; 0 for a trial that is one rollout.
    pub repeats: u32,
}

impl Proposal {
    /// Returns the parameters, and after them the gains, that have another value than the proposed one.
    pub fn changed(&self) -> impl Iterator<Item = &ProposedParameter> {
        self.parameters.iter().chain(&self.gains).filter(|p| p.value != p.proposed)
    }

    /// Returns the gains that have another value than the proposed one.
    pub fn changed_gains(&self) -> impl Iterator<Item = &ProposedParameter> {
        self.gains.iter().filter(|gain| gain.value != gain.proposed)
    }

    /// Returns the proposed values of the parameters and gains that have another one.
    pub fn replaced(&self) -> ParameterValues {
        self.changed().map(|p| (p.name.clone(), p.proposed)).collect()
    }
}

/// One value of a proposal.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProposedParameter {
    /// Name.
    pub name: String,
    /// The value that will run.
    pub value: f64,
    /// The value from the sampler or the queue; differs from `value` after an override.
    pub proposed: f64,
}

/// Distance of a proposal to earlier falls, in parameters scaled to their bounds. Shown only: it changes no proposal.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FallRisk {
    /// Euclidean distance to the nearest fall; none without a fall.
    pub nearest_fall: Option<f64>,
    /// The trial that fell there.
    pub nearest_fall_trial: Option<u32>,
    /// Falls among the nearest judged trials.
    pub falls: u32,
    /// Number of nearest judged trials that were compared, at most 5.
    pub neighbours: u32,
}

/// Expectation of the sampler's model of a trial before it runs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ExpectedResult {
    /// Mean objective if the robot stands, in the study's unit.
    #[serde(rename = "predicted")]
    pub value: f64,
    /// Standard deviation of this mean, without the noise of a trial, in the study's unit.
    #[serde(rename = "predicted_deviation")]
    pub deviation: f64,
    /// Probability that the robot stands, 0 to 1.
    pub p_stand: f64,
    /// Smallest mean of the simulated robots, in the study's unit; none for a sampler without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated_least: Option<f64>,
    /// Largest mean of the simulated robots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated_most: Option<f64>,
    /// Whether no point is worth its risk of a fall any more: the sampler advises to end the search and to confirm the best.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub advises_to_stop: bool,
}

/// Decision of the operator, or of the automatic rule, on a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, EnumString, IntoStaticStr, VariantArray)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Verdict {
    /// The trial counts with its value.
    Accept,
    /// The robot fell: reported to the sampler with J = 0.
    Fall,
    /// The cause lies outside the parameters: hidden from the sampler, kept on record.
    Void,
}

impl Verdict {
    /// All verdicts.
    pub const ALL: [Verdict; Verdict::VARIANTS.len()] = *Verdict::VARIANTS.first_chunk().unwrap();

    /// Returns the name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Origin of a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, EnumString, IntoStaticStr, VariantArray)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum JudgedBy {
    /// A person.
    Operator,
    /// The program by its rules: automatic approval, the end of a session, a trial that a program has left.
    Rule,
}

impl JudgedBy {
    /// All origins.
    pub const ALL: [JudgedBy; JudgedBy::VARIANTS.len()] = *JudgedBy::VARIANTS.first_chunk().unwrap();

    /// Returns the name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Growth of the largest forces on a robot: section `[hop_envelope]` of `config/safety.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HopEnvelope {
    /// Share of the force bounds before the first accepted trial.
    pub start: f64,
    /// Growth of the share with each accepted trial.
    pub step: f64,
}
