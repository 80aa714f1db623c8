//! Settings and errors of an engine's start.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::config::{Config, ConfigError};
use crate::optimize::prior::PriorModel;
use crate::optimize::space::SpaceError;
use crate::optimize::study::{Storage, StudyError};
use crate::recording::RecordingError;
use crate::recording::live::LiveServer;
use crate::robot::description::RobotDescription;
use crate::robot::hardware::{HardwareError, Network};
use crate::session::prior::EnsembleError;
use crate::sim::SimError;
use crate::trial::{Approval, Backend, Task};

/// Settings of an engine's start.
#[expect(missing_docs, reason = "the types say the rest")]
pub struct Options {
    pub config: Config,
    pub robot: RobotDescription,
    /// Link settings of the robot; needed on hardware.
    pub network: Option<Network>,
    pub backend: Backend,
    pub task: Task,
    pub seed: u32,
    /// Trials that are to count; none for the number of the configuration.
    pub trials: Option<u32>,
    /// The folder of the study, created if it does not exist: study.log, session.mcap, config/. None keeps nothing.
    pub folder: Option<PathBuf>,
    pub observe: bool,
    pub approve: Approval,
    /// Name of the study that is continued, which must be there. None: the name of task and seed, made if it is not there.
    pub study: Option<String>,
    /// The journal of a study that this engine joins as one more worker, instead of the study of the folder.
    pub join: Option<Storage>,
    /// Results of simulated robots, for the sampler `sim`; the console's session finds or makes them itself.
    pub prior: Option<Arc<PriorModel>>,
    /// The program that guards a real robot when it is run with [`GUARD`](super::GUARD): it damps the robot when this process
    /// sends no heartbeat. None: no guard.
    pub guard: Option<PathBuf>,
    /// Whether hardware may continue a study that was made on another backend or robot.
    pub accept_backend_change: bool,
    /// Reason why the loss of the operator's connection cannot be detected; none if it can. An arming check on hardware.
    pub unseen_connection: Option<String>,
    /// Server of the live view, which receives the recording's messages; none without one.
    pub live: Option<LiveServer>,
    /// Origin of the session, for its recording.
    pub provenance: Provenance,
}

/// Origin of a session: program, machine and person.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// Commit of the program's sources; `unknown` where it was built without git.
    pub commit: String,
    /// Name of the machine.
    pub host: String,
    /// Name of the operator.
    pub operator: String,
}

impl Default for Provenance {
    fn default() -> Provenance {
        let unknown = || "unknown".to_owned();
        Provenance { commit: unknown(), host: unknown(), operator: unknown() }
    }
}

impl Options {
    /// Returns the settings of a study of `task` with seed 0 that keeps nothing and in which a person approves and judges.
    pub fn new(config: Config, robot: RobotDescription, backend: Backend, task: Task) -> Options {
        Options {
            config,
            robot,
            network: None,
            backend,
            task,
            seed: 0,
            trials: None,
            folder: None,
            observe: false,
            approve: Approval::Each,
            study: None,
            join: None,
            prior: None,
            guard: None,
            accept_backend_change: false,
            unseen_connection: None,
            live: None,
            provenance: Provenance::default(),
        }
    }

    /// Returns the unit of the objective.
    pub fn unit(&self) -> &'static str {
        self.config.task(self.task).unit(self.task)
    }

    /// Returns the number of trials that are to count.
    pub fn budget(&self) -> u32 {
        self.trials.unwrap_or(self.config.optimize.trials)
    }
}

/// Error of an engine's start.
#[expect(missing_docs, reason = "the messages name variants and fields")]
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Simulator(#[from] SimError),
    #[error(transparent)]
    Hardware(#[from] HardwareError),
    #[error(
        "{robot}: its robot.toml has no section [network] or [dds]; only a robot with one can be driven or emulated"
    )]
    NoNetwork { robot: String },
    #[error(transparent)]
    Space(#[from] SpaceError),
    #[error(transparent)]
    Study(#[from] StudyError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(
        "--approve auto: only on the simulator; a jump of the robot is approved by a person: give each or falls-only"
    )]
    Unattended,
    #[error("{}: there is no such journal; give a study's folder, its study.log, a journal file or redis://HOST:PORT/DB", file.display())]
    NoJournal { file: PathBuf },
    #[error("{}: this folder holds no study{}", folder.display(), in_folders(folder, *below))]
    NoStudyInFolder { folder: PathBuf, below: usize },
    #[error("{journal}: several studies are in it; choose one with --name: {names}")]
    WhichStudy { journal: String, names: String },
    #[error("{journal}: {}", no_such_study(names))]
    NoSuchStudy { journal: String, names: String },
    #[error("{journal}: study {name} cannot be used: {reason}")]
    Unusable { journal: String, name: String, reason: String },
    #[error("{}: holds no study that this program made; give the folder of another study, or begin a new one", file.display())]
    NoStudy { file: PathBuf },
    #[error("{}: another session is running in this folder ({owner}); end it first; a console can be watched with `quadfrog attach`", folder.display())]
    InUse { folder: PathBuf, owner: String },
    #[error(
        "{study}: it was made on {made}, this session runs on {asked}: its points and verdicts are those of another machine. Begin a new study, or give --accept-backend-change to continue it"
    )]
    OtherBackend { study: String, made: String, asked: String },
    #[error(
        "{study}: it was made with another robot of the name {robot}: its files have the hash {made}, those of this worker {own}; give --model with the files of the study's robot, which are in config/robot of the folder of every session and worker of the study"
    )]
    OtherRobot { study: String, robot: String, made: String, own: String },
    #[error(
        "{study}: its values are in {stored}, those of this session would be in {asked}, and the two cannot be compared. Set `rate` in [tasks.{task}] of control.toml as the study has it, or begin a new study"
    )]
    OtherUnit { study: String, task: &'static str, stored: String, asked: &'static str },
    #[error("--trials {budget}: {counted} trials of this study count already; give that number or more, or omit it")]
    BudgetBelowCounted { budget: u32, counted: u32 },
    #[error(transparent)]
    Prior(#[from] EnsembleError),
    #[error(
        "the sampler sim cannot use its prior: {0}. Choose another sampler, or other bounds or ranges of prior.toml"
    )]
    UnusablePrior(String),
    #[error("the sampler sim needs a prior: make it with `quadfrog prior`, or choose another sampler with --sampler")]
    NoPrior,
    #[error("{what}: {source}")]
    System { what: String, source: std::io::Error },
}

/// Returns the other studies of a journal, or the remedy where there is none.
fn no_such_study(names: &str) -> String {
    match names {
        "" => "there is no study in it; give the folder of a study, as `quadfrog study list` names it".to_owned(),
        names => format!("there is no such study in it; its studies: {names}"),
    }
}

/// Returns the way to a study from a folder that holds none itself; `below` counts those in its folders.
fn in_folders(folder: &Path, below: usize) -> String {
    let (found, list) = match below {
        0 => (String::new(), String::new()),
        _ => (format!(" itself (studies in its folders: {below})"), format!(" {}", folder.display())),
    };
    format!("{found}; give the folder of a study, as `quadfrog study list{list}` names it")
}

impl EngineError {
    /// Returns the conversion of the system's error at the start of `what`.
    pub(super) fn not_started(what: &'static str) -> impl Fn(std::io::Error) -> EngineError {
        move |source| EngineError::System { what: format!("the {what} could not be started"), source }
    }
}
