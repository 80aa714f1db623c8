//! Vocabulary of a trial: task, parameters with units, proposal, status, verdict, measured values.

mod measured;
mod search;

pub use self::measured::{BounceRule, CHANGED, Displacement, JumpRow, MeasuredJump, ObjectiveRule, RepeatRecord};
pub use self::search::{
    DrawnRange, FixedParameter, ParameterInsight, PointRecord, PredictedTrial, ProposalInsight, QueuedPoint,
    SearchStatus, SearchedParameter, SimulatorComparison, WorldResemblance,
};

use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// Returns a number for a message: at most six significant digits, without zeros at the end.
pub fn six_digits(value: f64) -> String {
    format!("{value:.5e}").parse::<f64>().unwrap_or(value).to_string()
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

/// The gains of the controller, in table order, with their units.
pub const GAIN_UNITS: [(&str, &str); 4] = [("kp", "N/m"), ("kd", "N s/m"), ("kd_joint", "N m s/rad"), ("k_att", "N/m")];

/// Whether `name` is a gain of the controller.
pub fn is_gain(name: &str) -> bool {
    GAIN_UNITS.iter().any(|(gain, _)| *gain == name)
}

/// Returns the unit of an optimized parameter; empty for an unknown name.
pub fn parameter_unit(name: &str) -> &'static str {
    match name {
        "f0" | "f1" => "Hz",
        "Fx" | "Fy" | "Fz" => "N",
        _ => GAIN_UNITS.iter().find(|(gain, _)| *gain == name).map_or("", |(_, unit)| unit),
    }
}

/// Values by name, in table order: the parameters of a point, or the gains of a trial.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ParameterValues(Vec<(String, f64)>);

impl ParameterValues {
    /// Returns the value of that name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
    }
}

/// The optimizer's plain pairs.
impl std::ops::Deref for ParameterValues {
    type Target = [(String, f64)];

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl From<Vec<(String, f64)>> for ParameterValues {
    fn from(pairs: Vec<(String, f64)>) -> ParameterValues {
        ParameterValues(pairs)
    }
}

impl FromIterator<(String, f64)> for ParameterValues {
    fn from_iter<I: IntoIterator<Item = (String, f64)>>(pairs: I) -> ParameterValues {
        ParameterValues(pairs.into_iter().collect())
    }
}

impl<'a> IntoIterator for &'a ParameterValues {
    type Item = &'a (String, f64);
    type IntoIter = std::slice::Iter<'a, (String, f64)>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// The force profile of one jump: frequencies and amplitudes (paper, equations 1 and 2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JumpParameters {
    /// Frequency of the impulse phase, Hz: the impulse lasts 1 / (2 f0).
    pub f0_hz: f64,
    /// Frequency of the off phase, Hz, for continuous jumping: the pause lasts 1 / (2 f1). Zero for single jumps.
    pub f1_hz: f64,
    /// Amplitude along x, N per foot; positive, or of either sign where the task moves along y.
    pub fx_n: f64,
    /// Amplitude along y, N per foot; positive, or of either sign where the task moves along x.
    pub fy_n: f64,
    /// Amplitude along z, N per foot, positive.
    pub fz_n: f64,
}

impl JumpParameters {
    /// Returns the jump of a point; `f1_hz` holds where the point has no `f1`, and an amplitude that it lacks is 0.
    pub fn from_values(values: &ParameterValues, f1_hz: f64) -> JumpParameters {
        let value = |name: &str| values.get(name).unwrap_or(0.0);
        JumpParameters {
            f0_hz: value("f0"),
            f1_hz: values.get("f1").unwrap_or(f1_hz),
            fx_n: value("Fx"),
            fy_n: value("Fy"),
            fz_n: value("Fz"),
        }
    }
}

impl JumpParameters {
    /// Duration of one impulse, s.
    pub fn impulse_s(&self) -> f64 {
        0.5 / self.f0_hz
    }

    /// Duration of one impulse and the pause after it, s; infinite without a pause.
    pub fn period_s(&self) -> f64 {
        self.impulse_s() + if self.f1_hz > 0.0 { 0.5 / self.f1_hz } else { f64::INFINITY }
    }

    /// Returns the number of impulses that begin within `duration_s`, at least one.
    pub fn within(&self, duration_s: f64) -> u32 {
        ((duration_s / self.period_s()).ceil() as u32).max(1)
    }
}

/// Gains of the leg controller (paper, equation 4 and the Virtual Model Control).
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Gains {
    /// Cartesian stiffness Kp, N/m, the same along all axes.
    pub kp: f64,
    /// Cartesian damping Kd, N s/m.
    pub kd: f64,
    /// Joint damping Kd,joint, N m s/rad.
    pub kd_joint: f64,
    /// Attitude gain of the Virtual Model Control k_att, N/m.
    pub k_att: f64,
}

impl Gains {
    /// Returns the gains by name, in table order.
    pub fn values(&self) -> ParameterValues {
        let Gains { kp, kd, kd_joint, k_att } = *self;
        GAIN_UNITS.iter().zip([kp, kd, kd_joint, k_att]).map(|((name, _), value)| ((*name).to_owned(), value)).collect()
    }

    /// Returns these gains with the values of `values` in place of their own.
    pub fn with(&self, values: &ParameterValues) -> Gains {
        let value = |name: &str, own| values.get(name).unwrap_or(own);
        Gains {
            kp: value("kp", self.kp),
            kd: value("kd", self.kd),
            kd_joint: value("kd_joint", self.kd_joint),
            k_att: value("k_att", self.k_att),
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

/// One optimized parameter, or one gain.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterInfo {
    /// Name, for example `Fx`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

impl ParameterInfo {
    /// Returns whether `value` is within the bounds; false for NaN.
    pub fn contains(&self, value: f64) -> bool {
        value >= self.low && value <= self.high
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

/// A row of the trial table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrialRecord {
    /// Number in the study.
    pub trial: u32,
    /// Origin of the parameters.
    pub source: ProposalSource,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// Parameters by name, in table order.
    pub parameters: ParameterValues,
    /// Measured values; none while it runs, or if it was stopped before.
    pub measured: Option<MeasuredJump>,
    /// The objective that is reported to the sampler: the measured or the hand-measured value, 0 for a fall, none for void.
    pub value: Option<f64>,
    /// A value measured by hand, kept beside the measured one.
    pub hand_value: Option<f64>,
    /// The verdict that the rules suggest.
    pub suggested: Option<Verdict>,
    /// Reason of the suggestion, or of another verdict.
    pub cause: String,
    /// The verdict; none while it runs or waits.
    pub verdict: Option<Verdict>,
    /// The operator's note.
    pub note: String,
    /// Distance to earlier falls at its approval.
    pub risk: Option<FallRisk>,
    /// Expectation of the sampler's model at its approval.
    pub expected: Option<ExpectedResult>,
    /// The controller's gains that it ran with; empty for a trial of another program.
    pub gains: ParameterValues,
    /// Judged rollouts, in order, void ones included; empty for a trial that is one rollout.
    pub repeats: Vec<RepeatRecord>,
    /// Seed of its noise and terrain, of the first rollout if it has several; none for a trial of another program.
    pub seed: Option<u64>,
    /// The ranges from which its parameters were drawn; empty in older recordings.
    pub ranges: Vec<DrawnRange>,
}

impl TrialRecord {
    /// Returns whether it counts for the budget: accepted or fallen. Repeats that confirm the best are beyond the budget.
    pub fn counts(&self) -> bool {
        matches!(self.verdict, Some(Verdict::Accept | Verdict::Fall)) && self.source != ProposalSource::Confirm
    }

    /// Returns the name of its verdict on screens and in reports; a trial of another program was not judged: it is complete
    /// or has failed. None while it runs or waits.
    pub fn verdict_name(&self) -> Option<&'static str> {
        Some(match (self.verdict?, self.source) {
            (Verdict::Accept, ProposalSource::OtherProgram) => "complete",
            (Verdict::Void, ProposalSource::OtherProgram) => "failed",
            (verdict, _) => verdict.name(),
        })
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
