//! Vocabulary of a trial: task, parameters with units, proposal, status, verdict, measured values.

use serde::{Deserialize, Serialize};

/// What the robot is asked to learn; decides the signs of the force amplitudes and the objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Task {
    /// Jump forward.
    Forward,
    /// Jump to the left.
    LateralLeft,
    /// Jump to the right.
    LateralRight,
    /// Turn counterclockwise, seen from above.
    TwistCcw,
    /// Turn clockwise.
    TwistCw,
}

impl Task {
    /// All tasks.
    pub const ALL: [Task; 5] = [Task::Forward, Task::LateralLeft, Task::LateralRight, Task::TwistCcw, Task::TwistCw];

    /// The name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Task::Forward => "forward",
            Task::LateralLeft => "lateral-left",
            Task::LateralRight => "lateral-right",
            Task::TwistCcw => "twist-ccw",
            Task::TwistCw => "twist-cw",
        }
    }

    /// The task of that name.
    pub fn from_name(name: &str) -> Option<Task> {
        Task::ALL.into_iter().find(|task| task.name() == name)
    }

    /// The unit of the objective: metres, or radians for a twist.
    pub const fn unit(self) -> &'static str {
        match self {
            Task::Forward | Task::LateralLeft | Task::LateralRight => "m",
            Task::TwistCcw | Task::TwistCw => "rad",
        }
    }
}

/// The force profile of one jump: frequencies and amplitudes (paper, equations 1 and 2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JumpParameters {
    /// Frequency of the impulse phase, Hz: the impulse lasts 1 / (2 f0).
    pub f0_hz: f64,
    /// Frequency of the off phase, Hz, for continuous jumping: the pause lasts 1 / (2 f1). Zero for single jumps.
    pub f1_hz: f64,
    /// Amplitude along x, N per foot, positive.
    pub fx_n: f64,
    /// Amplitude along y, N per foot, positive.
    pub fy_n: f64,
    /// Amplitude along z, N per foot, positive.
    pub fz_n: f64,
}

/// Gains of the leg controller (paper, equation 4 and the Virtual Model Control).
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, serde::Serialize)]
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

/// How much a person is asked. STOP, the loss of the operator and every limit work the same in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Approval {
    /// A person approves and judges each jump.
    #[default]
    Each,
    /// What landed and settled is accepted by itself, and on the simulator the next jump is approved by itself; a fall or
    /// anything odd waits for a person.
    FallsOnly,
    /// Nobody is asked: for the simulator alone.
    Auto,
}

impl Approval {
    /// All of them.
    pub const ALL: [Approval; 3] = [Approval::Each, Approval::FallsOnly, Approval::Auto];

    /// The word on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Approval::Each => "each",
            Approval::FallsOnly => "falls-only",
            Approval::Auto => "auto",
        }
    }
}

/// One optimized parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// Where the session is in a trial's life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ExperimentStage {
    /// A proposal waits for approval.
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
    pub const ALL: [ExperimentStage; 4] =
        [ExperimentStage::Proposed, ExperimentStage::Running, ExperimentStage::Review, ExperimentStage::Finished];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            ExperimentStage::Proposed => "proposed",
            ExperimentStage::Running => "running",
            ExperimentStage::Review => "review",
            ExperimentStage::Finished => "finished",
        }
    }
}

/// Who chose a trial's parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProposalSource {
    /// The sampler alone.
    Sampler,
    /// The operator changed at least one.
    Operator,
    /// A re-run of an earlier trial.
    Rerun,
    /// A point queued beforehand, by the operator or by another program.
    Queued,
    /// A repeat of one of the best points, to be sure of the best; beyond the budget.
    Confirm,
}

impl ProposalSource {
    /// All sources.
    pub const ALL: [ProposalSource; 5] = [
        ProposalSource::Sampler,
        ProposalSource::Operator,
        ProposalSource::Rerun,
        ProposalSource::Queued,
        ProposalSource::Confirm,
    ];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            ProposalSource::Sampler => "sampler",
            ProposalSource::Operator => "operator",
            ProposalSource::Rerun => "re-run",
            ProposalSource::Queued => "queued",
            ProposalSource::Confirm => "confirm",
        }
    }
}

/// A proposal: what will run if it is approved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// The number that the trial will have.
    pub trial: u32,
    /// Changes with every override: an approval names the revision that the operator saw.
    pub revision: u32,
    /// Who chose the parameters.
    pub source: ProposalSource,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// The values, in table order.
    pub parameters: Vec<ProposedParameter>,
    /// How near earlier falls are; none before the first judged trial.
    pub risk: Option<FallRisk>,
    /// The controller's gains, in table order; `proposed` is what the trial would run with if nobody had changed them.
    pub gains: Vec<ProposedParameter>,
}

/// One value of a proposal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProposedParameter {
    /// Name.
    pub name: String,
    /// The value that will run.
    pub value: f64,
    /// What the sampler (or the queue) proposed; differs from `value` after an override.
    pub proposed: f64,
}

/// How near a proposal is to earlier falls, in parameters scaled to their bounds. Shown, never silently used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FallRisk {
    /// Euclidean distance to the nearest fall; none without a fall.
    pub nearest_fall: Option<f64>,
    /// The trial that fell there.
    pub nearest_fall_trial: Option<u32>,
    /// Falls among the nearest judged trials.
    pub falls: u32,
    /// How many nearest judged trials were looked at, at most 5.
    pub neighbours: u32,
}

/// What an operator (or the automatic rule) decides of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It counts with its value.
    Accept,
    /// It fell: told with J = 0.
    Fall,
    /// Its cause lies outside the parameters: hidden from the sampler, kept on record.
    Void,
}

impl Verdict {
    /// All verdicts.
    pub const ALL: [Verdict; 3] = [Verdict::Accept, Verdict::Fall, Verdict::Void];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::Accept => "accept",
            Verdict::Fall => "fall",
            Verdict::Void => "void",
        }
    }
}

/// What was measured of a jump, in the world frame turned so that the trial starts at yaw 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeasuredJump {
    /// Forward displacement x_final - x_init, m.
    pub dx_m: f64,
    /// Displacement to the left y_final - y_init, m.
    pub dy_m: f64,
    /// Turn, unwrapped, counterclockwise positive, rad.
    pub dyaw_rad: f64,
    /// Highest rise of the trunk over its height at the start, m.
    pub apex_m: f64,
    /// Longest time without any foot on the ground, s.
    pub air_s: f64,
}

/// A row of the trial table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialRecord {
    /// Number in the study.
    pub trial: u32,
    /// Who chose the parameters.
    pub source: ProposalSource,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// Parameters by name, in table order.
    pub parameters: Vec<(String, f64)>,
    /// What was measured; none while it runs, or if it was stopped before.
    pub measured: Option<MeasuredJump>,
    /// The objective that the sampler is told: the measured or the hand-measured value, 0 for a fall, none for a void.
    pub value: Option<f64>,
    /// A value measured by hand, kept beside the measured one.
    pub hand_value: Option<f64>,
    /// The verdict that the rules suggest.
    pub suggested: Option<Verdict>,
    /// Why they suggest it, in words.
    pub cause: String,
    /// The verdict; none while it runs or waits.
    pub verdict: Option<Verdict>,
    /// The operator's note.
    pub note: String,
    /// How near earlier falls were when it was approved.
    pub risk: Option<FallRisk>,
    /// The controller's gains that it ran with, by name; empty for a trial of another program.
    pub gains: Vec<(String, f64)>,
}

/// What is searched at present, and how far the study is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SearchStatus {
    /// How many trials are to count.
    pub budget: u32,
    /// How many count so far: accepted or fallen, repeats that confirm the best left out.
    pub counted: u32,
    /// Every parameter, in table order.
    pub parameters: Vec<SearchedParameter>,
    /// How many repeats are left to confirm the best; none while nothing is being confirmed.
    pub confirming: Option<u32>,
}

/// One parameter as it is searched at present.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// A parameter that is not searched for some trials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FixedParameter {
    /// Its value, in the parameter's unit.
    pub value: f64,
    /// For how many trials more, the proposed one among them.
    pub trials: u32,
}

/// Why a point was proposed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProposalInsight {
    /// The proposed trial.
    pub trial: u32,
    /// Every parameter, in table order.
    pub parameters: Vec<ParameterInsight>,
}

/// Why a parameter has the proposed value, and what it matters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterInsight {
    /// Name.
    pub name: String,
    /// The proposed value, in the parameter's unit.
    pub proposed: f64,
    /// Share of this parameter in reaching the best tenth of the trials, 0 to 1, all together 1 (PED-ANOVA); none while
    /// there are too few trials to tell.
    pub importance: Option<f64>,
    /// Where the densities are known, from the lower to the upper bound; empty where TPE does not propose.
    pub at: Vec<f64>,
    /// TPE's l(x), of the good trials, per unit of the parameter.
    pub good: Vec<f64>,
    /// TPE's g(x), of the others.
    pub bad: Vec<f64>,
}

/// A point that was run more than once, or is about to be: its repeats are aggregated as `optimize::repeats` says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointRecord {
    /// Parameters by name, in table order.
    pub parameters: Vec<(String, f64)>,
    /// Its trials that count, ascending: n is their number.
    pub trials: Vec<u32>,
    /// k: how many of them did not fall.
    pub stood: u32,
    /// Mean value, falls included.
    pub mean: f64,
    /// Standard deviation of a single repeat, from two repeats on.
    pub deviation: Option<f64>,
    /// Whether it is one of those among which the best is being confirmed, or was.
    pub contender: bool,
    /// The confidence that it is the best of the contenders; of the leading one alone.
    pub confidence: Option<f64>,
}
