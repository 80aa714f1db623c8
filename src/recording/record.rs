//! Records of a session besides its ticks. The console and the recording receive the same records, so a replay shows the
//! same screen as the live session.

use crate::optimize::ask::SamplerKind;
use crate::telemetry::{ArmingCheck, ArmingCheckState, Counters, Mode, Tick, TransitionCause};
use crate::trial::{
    Approval, Backend, ExperimentStage, ParameterInfo, ParameterValues, PointRecord, Proposal, ProposalInsight,
    SearchStatus, Task, TrialRecord,
};

/// A record with its time.
#[derive(Debug, Clone, PartialEq)]
pub struct Stamped {
    /// Time since the engine started, ns; the same clock as the ticks'.
    pub time_ns: u64,
    /// The record.
    pub record: Record,
}

/// An event or a new state of the session.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// Facts of the session. The first record of each recording.
    Session(SessionInfo),
    /// Change of mode.
    Transition(Transition),
    /// Change of the experiment's stage.
    Stage(StageRecord),
    /// New proposal, or one changed by an override.
    Proposal(Proposal),
    /// New or changed row of the trial table; the newest record of a number counts.
    Trial(TrialRecord),
    /// Operator's request and its result.
    Request(RequestRecord),
    /// Counters, ten times a second.
    Counters(Counters),
    /// Line of the log.
    Log(LogRecord),
    /// Last ticks up to a fault, oldest first.
    FaultTicks(Vec<Tick>),
    /// All arming checks. Sent to the console twice a second while the robot is disarmed, recorded when a check changes its
    /// state.
    ArmingChecks(Vec<ArmingCheckRecord>),
    /// Searched parameters and progress of the study.
    Search(SearchStatus),
    /// Reasons of the sampler for its proposal; follows each of them.
    Insight(ProposalInsight),
    /// Statistics of all repeated points, whenever one of them changes.
    Points(Vec<PointRecord>),
}

/// An arming check and its result.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmingCheckRecord {
    /// The check.
    pub check: ArmingCheck,
    /// Measured value as text, with unit.
    pub found: String,
    /// Needed value as text, with unit.
    pub needed: String,
    /// Result.
    pub state: ArmingCheckState,
}

/// Facts of a session: written first into a recording, shown in the frame.
#[derive(Debug, Clone, PartialEq, Default)]
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
    /// Trials that are to count.
    pub budget: u32,
    /// The parameters with their bounds, in table order.
    pub parameters: Vec<ParameterInfo>,
    /// The study's file; empty where there is none.
    pub study: String,
    /// The recording's file; empty where there is none.
    pub recording: String,
    /// Start, UTC, ISO 8601.
    pub started: String,
    /// Whether the session only observes.
    pub observe: bool,
    /// The controller's gains with the ranges in which an operator may set them, in table order.
    pub gains: Vec<ParameterInfo>,
    /// The jumps that a person approves and judges.
    pub approve: Approval,
    /// Limits by which a console colours its values.
    pub limits: HealthLimits,
    /// Commit of the program's sources: `unknown` where it was built without git; empty in older recordings, as the next two.
    pub commit: String,
    /// Name of the machine.
    pub host: String,
    /// Name of the operator.
    pub operator: String,
    /// Value of each gain by the configuration, unit of [`SessionInfo::gains`]; empty in older recordings.
    pub configured_gains: ParameterValues,
}

impl SessionInfo {
    /// Returns the version of the program with the commit of its sources, where it is known: "0.1.0 (9fceb02d…)".
    pub fn program_version(&self) -> String {
        if self.commit.is_empty() { self.version.clone() } else { format!("{} ({})", self.version, self.commit) }
    }

    /// Returns the operator with the rule of approval, "operator Anna, --approve each"; none in older recordings.
    pub fn operator_in_words(&self) -> Option<String> {
        let words = || format!("operator {}, --approve {}", self.operator, self.approve.name());
        (!self.operator.is_empty()).then(words)
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

/// Limits by which a console colours the health of link, motors, battery and control loop. The default holds for recordings
/// without them.
#[derive(Debug, Clone, Copy, PartialEq)]
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
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    /// From this mode.
    pub from: Mode,
    /// To this one.
    pub to: Mode,
    /// Cause as text.
    pub cause: String,
}

impl Transition {
    /// Whether the operator's STOP caused it.
    pub fn is_stop(&self) -> bool {
        self.cause == TransitionCause::Stop.to_string()
    }
}

/// The experiment's stage and its trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StageRecord {
    /// The stage.
    pub stage: ExperimentStage,
    /// Trial of the stage; the last one when finished.
    pub trial: u32,
    /// Whether the last verdict can still be undone.
    pub can_undo: bool,
    /// Most jumps in a row of the running trial; 0 in other stages.
    pub jumps: u32,
}

/// An operator's request and its result.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RequestRecord {
    /// The request as text, for example `override Fx = 120`.
    pub request: String,
    /// Whether it was carried out.
    pub accepted: bool,
    /// Reason of the refusal, or result.
    pub answer: String,
}

/// Severity of a line of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// Normal operation.
    Info,
    /// Needs the operator's attention.
    Warning,
    /// Failure.
    Error,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogRecord {
    /// Severity.
    pub level: LogLevel,
    /// Part of the program that logged it.
    pub source: String,
    /// The line.
    pub message: String,
}
