//! What is worth keeping of a session besides its ticks. The screen and the recording receive the same records, so a
//! replay shows what live showed.

use serde::{Deserialize, Serialize};

use crate::telemetry::{ArmingCheck, ArmingCheckState, Counters, Mode, Tick};
use crate::trial::{ExperimentStage, ParameterInfo, PointRecord, Proposal, ProposalInsight, SearchStatus, TrialRecord};

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
