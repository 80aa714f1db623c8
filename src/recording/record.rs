//! What is worth keeping of a session besides its ticks. The screen and the recording receive the same records, so a
//! replay shows what live showed.

use serde::{Deserialize, Serialize};

use crate::realtime::pre_arm::{Check, CheckState};
use crate::realtime::telemetry::{Counters, Mode, Tick};

/// A record and when it happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Stamped {
    /// Time since the engine started, ns; the same clock as the ticks'.
    pub time_ns: u64,
    /// What happened.
    pub record: Record,
}

/// One thing that happened, or that is now known.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// What this session is. The first record of each recording.
    Session(SessionInfo),
    /// The mode changed.
    Transition(Transition),
    /// The session moved to another stage of a trial's life.
    Stage(StageInfo),
    /// A proposal is on the table, or changed by an override.
    Proposal(Proposal),
    /// A row of the trial table is new or changed; the newest record of a number counts.
    Trial(TrialRecord),
    /// An operator's wish and what became of it.
    Command(CommandRecord),
    /// Counters, ten times a second.
    Counters(Counters),
    /// A line for the log.
    Log(LogRecord),
    /// The last ticks before a fault, oldest first.
    FaultTicks(Vec<Tick>),
    /// The whole pre-arm list. The screen sees it twice a second while the robot is disarmed, the recording when an item
    /// changes its state.
    PreArm(Vec<PreArmCheck>),
    /// What is searched, and how far the study is.
    Search(Search),
    /// Why the proposal was made: told with each that the sampler makes.
    Insight(Insight),
    /// What repeated points amount to; all of them, each time that one of them changes.
    Points(Vec<PointRecord>),
}

/// An item of the pre-arm list and how it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PreArmCheck {
    /// The item.
    pub check: Check,
    /// What was found, in words with a unit.
    pub found: String,
    /// What is needed, in words with a unit.
    pub needed: String,
    /// How it stands.
    pub state: CheckState,
}

/// What a session is: written first into a recording, shown in the frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SessionInfo {
    /// Version of this program.
    pub version: String,
    /// `sim` or `go1`.
    pub backend: String,
    /// Name of the robot model.
    pub robot: String,
    /// Task name.
    pub task: String,
    /// Unit of the objective.
    pub unit: String,
    /// Sampler name.
    pub sampler: String,
    /// Seed of the study.
    pub seed: u64,
    /// How many trials the study is to have.
    pub budget: u32,
    /// The parameters with their bounds, in table order.
    pub parameters: Vec<ParameterInfo>,
    /// The study's file; empty where there is none.
    pub study: String,
    /// The recording's file; empty where there is none.
    pub recording: String,
    /// Start, UTC, ISO 8601.
    pub started: String,
    /// Whether this session may only look.
    pub observe: bool,
    /// The controller's gains with the ranges in which an operator may set them, in table order.
    pub gains: Vec<ParameterInfo>,
    /// Who approves and judges: `each`, `falls-only` or `auto`.
    pub approve: String,
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

/// A change of mode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Transition {
    /// From this mode.
    pub from: Mode,
    /// To this one.
    pub to: Mode,
    /// Why, in words.
    pub cause: String,
}

/// Where the session is in a trial's life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stage {
    /// A proposal waits for approval.
    Proposed,
    /// The trial was approved and runs.
    Running,
    /// The trial was measured and waits for its verdict.
    Review,
    /// The budget is used up.
    Finished,
}

impl Stage {
    /// All stages.
    pub const ALL: [Stage; 4] = [Stage::Proposed, Stage::Running, Stage::Review, Stage::Finished];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            Stage::Proposed => "proposed",
            Stage::Running => "running",
            Stage::Review => "review",
            Stage::Finished => "finished",
        }
    }
}

/// The stage and what it is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageInfo {
    /// The stage.
    pub stage: Stage,
    /// The trial that it is about; the last one when finished.
    pub trial: u32,
    /// Whether the last verdict can still be undone.
    pub can_undo: bool,
}

/// Who chose a trial's parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
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

impl Source {
    /// All sources.
    pub const ALL: [Source; 5] = [Source::Sampler, Source::Operator, Source::Rerun, Source::Queued, Source::Confirm];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            Source::Sampler => "sampler",
            Source::Operator => "operator",
            Source::Rerun => "re-run",
            Source::Queued => "queued",
            Source::Confirm => "confirm",
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
    pub source: Source,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// The values, in table order.
    pub parameters: Vec<ProposedParameter>,
    /// How near earlier falls are; none before the first judged trial.
    pub risk: Option<Risk>,
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
pub struct Risk {
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
pub struct Measured {
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
    pub source: Source,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// Parameters by name, in table order.
    pub parameters: Vec<(String, f64)>,
    /// What was measured; none while it runs, or if it was stopped before.
    pub measured: Option<Measured>,
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
    pub risk: Option<Risk>,
    /// The controller's gains that it ran with, by name; empty for a trial of another program.
    pub gains: Vec<(String, f64)>,
}

/// An operator's wish and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommandRecord {
    /// The wish in words, for example `override Fx = 120`.
    pub wish: String,
    /// Whether it was carried out.
    pub accepted: bool,
    /// Why not, or what followed.
    pub answer: String,
}

/// How grave a line of the log is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Level {
    /// For the curious.
    Info,
    /// Something to look at.
    Warning,
    /// Something failed.
    Error,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogRecord {
    /// How grave.
    pub level: Level,
    /// Which part speaks.
    pub source: String,
    /// The line.
    pub message: String,
}

/// What is searched at present, and how far the study is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Search {
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
    pub fixed: Option<Fixed>,
}

/// A parameter that is not searched for some trials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fixed {
    /// Its value, in the parameter's unit.
    pub value: f64,
    /// For how many trials more, the proposed one among them.
    pub trials: u32,
}

/// Why a point was proposed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Insight {
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
