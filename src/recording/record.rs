//! What is worth keeping of a session besides its ticks. The screen and the recording receive the same records, so a
//! replay shows what live showed.

use serde::{Deserialize, Serialize};

use crate::optimize::sampler::SamplerKind;
use crate::telemetry::{ArmingCheck, ArmingCheckState, Counters, Mode, Tick};
use crate::trial::{
    Approval, Backend, ExperimentStage, ParameterInfo, PointRecord, Proposal, ProposalInsight, SearchStatus, Task,
    TrialRecord,
};

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
    Stage(StageRecord),
    /// A proposal is on the table, or changed by an override.
    Proposal(Proposal),
    /// A row of the trial table is new or changed; the newest record of a number counts.
    Trial(TrialRecord),
    /// An operator's wish and what became of it.
    Request(RequestRecord),
    /// Counters, ten times a second.
    Counters(Counters),
    /// A line for the log.
    Log(LogRecord),
    /// The last ticks before a fault, oldest first.
    FaultTicks(Vec<Tick>),
    /// The whole pre-arm list. The screen sees it twice a second while the robot is disarmed, the recording when an item
    /// changes its state.
    ArmingChecks(Vec<ArmingCheckRecord>),
    /// What is searched, and how far the study is.
    Search(SearchStatus),
    /// Why the proposal was made: told with each that the sampler makes.
    Insight(ProposalInsight),
    /// What repeated points amount to; all of them, each time that one of them changes.
    Points(Vec<PointRecord>),
}

/// An item of the pre-arm list and how it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArmingCheckRecord {
    /// The item.
    pub check: ArmingCheck,
    /// What was found, in words with a unit.
    pub found: String,
    /// What is needed, in words with a unit.
    pub needed: String,
    /// How it stands.
    pub state: ArmingCheckState,
}

/// What a session is: written first into a recording, shown in the frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SessionInfo {
    /// Version of this program.
    pub version: String,
    /// The robot behind the controller; none before a session begins, and for a name that this version does not know.
    pub backend: Option<Backend>,
    /// Name of the robot model.
    pub robot: String,
    /// Task; none as for `backend`.
    pub task: Option<Task>,
    /// Unit of the objective.
    pub unit: String,
    /// Sampler; none as for `backend`.
    pub sampler: Option<SamplerKind>,
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
    /// The jumps that a person approves and judges.
    pub approve: Approval,
    /// Limits by which a screen colours its values.
    pub limits: HealthLimits,
}

impl SessionInfo {
    /// Returns whether the session drives the simulator.
    pub fn is_simulated(&self) -> bool {
        self.backend == Some(Backend::Simulator)
    }

    /// Returns whether the session drives a robot.
    pub fn is_hardware(&self) -> bool {
        self.backend == Some(Backend::Hardware)
    }

    /// Returns the backend's name in recordings; empty where it is not known.
    pub fn backend_name(&self) -> &'static str {
        self.backend.map_or("", Backend::name)
    }

    /// Returns the task's name; empty where it is not known.
    pub fn task_name(&self) -> &'static str {
        self.task.map_or("", Task::name)
    }

    /// Returns the sampler's name; empty where it is not known.
    pub fn sampler_name(&self) -> &'static str {
        self.sampler.map_or("", SamplerKind::name)
    }
}

/// Limits by which a screen colours the health of link, motors, battery and control loop. The default holds for recordings
/// without them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HealthLimits {
    /// Largest age of the robot's state, ms (`safety.toml`, `[watchdog] state_age_warn_ms`).
    pub state_age_ms: u32,
    /// Share of lost states that is no longer good (`[pre_arm] loss_share`).
    pub loss_share: f64,
    /// Motor temperature that is no longer good, degrees Celsius (`[pre_arm] motor_c`).
    pub motor_c: f64,
    /// Least charge of the battery, % (`[pre_arm] battery_percent`).
    pub battery_percent: f64,
    /// Largest share of late ticks.
    pub late_share: f64,
    /// Largest delay of a tick, ms (`[watchdog] hardware_late_ms`).
    pub late_ms: f64,
}

impl Default for HealthLimits {
    fn default() -> HealthLimits {
        HealthLimits {
            state_age_ms: 5,
            loss_share: 0.01,
            motor_c: 60.0,
            battery_percent: 30.0,
            late_share: 0.001,
            late_ms: 10.0,
        }
    }
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

/// The stage and what it is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageRecord {
    /// The stage.
    pub stage: ExperimentStage,
    /// The trial that it is about; the last one when finished.
    pub trial: u32,
    /// Whether the last verdict can still be undone.
    pub can_undo: bool,
}

/// An operator's wish and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RequestRecord {
    /// The wish in words, for example `override Fx = 120`.
    pub wish: String,
    /// Whether it was carried out.
    pub accepted: bool,
    /// Why not, or what followed.
    pub answer: String,
}

/// How grave a line of the log is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum LogLevel {
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
    pub level: LogLevel,
    /// Which part speaks.
    pub source: String,
    /// The line.
    pub message: String,
}
