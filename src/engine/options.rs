//! Settings and errors of an engine's start.

use std::path::PathBuf;

use crate::config::{Config, ConfigError};
use crate::optimize::space::SpaceError;
use crate::optimize::study::{Storage, StudyError};
use crate::recording::RecordingError;
use crate::robot::description::RobotDescription;
use crate::robot::go1::Network;
use crate::robot::go1::link::LinkError;
use crate::sim::SimError;
use crate::trial::{Approval, Backend, Task};

/// Settings of an engine's start.
pub struct Options {
    /// The configuration.
    pub config: Config,
    /// The robot.
    pub robot: RobotDescription,
    /// Link settings of the robot; needed on hardware.
    pub network: Option<Network>,
    /// The robot behind the controller.
    pub backend: Backend,
    /// The task.
    pub task: Task,
    /// Seed of the study.
    pub seed: u32,
    /// Trials that are to count; none for the number of the configuration.
    pub trials: Option<u32>,
    /// The folder of the study, created if it does not exist: study.log, session.mcap, config/. None keeps nothing.
    pub folder: Option<PathBuf>,
    /// Whether the session only observes.
    pub observe: bool,
    /// The jumps that a person approves and judges.
    pub approve: Approval,
    /// The journal of a study that this engine joins as one more worker, instead of the study of the folder.
    pub join: Option<Storage>,
    /// The program that guards a real robot when it is run with [`GUARD`](super::GUARD): it damps the robot when this process
    /// sends no heartbeat. None: no guard.
    pub guard: Option<PathBuf>,
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
            join: None,
            guard: None,
        }
    }

    /// Returns the number of trials that are to count.
    pub fn budget(&self) -> u32 {
        self.trials.unwrap_or(self.config.optimize.trials)
    }
}

/// Error of an engine's start.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// A value of the configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The simulator's configuration.
    #[error(transparent)]
    Simulator(#[from] SimError),
    /// The link to the robot.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The robot's description has no network.
    #[error("{robot}: its robot.toml has no section [network]; only a robot with one can be driven or emulated")]
    NoNetwork {
        /// The robot's name.
        robot: String,
    },
    /// The search space.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Automatic approval on a robot.
    #[error(
        "--approve auto: only on the simulator; a jump of the robot is approved by a person: give each or falls-only"
    )]
    Unattended,
    /// A journal that does not exist.
    #[error("{}: there is no such journal; give a study's folder, its study.log, a journal file or redis://HOST:PORT/DB", file.display())]
    NoJournal {
        /// The file.
        file: PathBuf,
    },
    /// A journal with several studies.
    #[error("{journal}: several studies are in it; choose one with --name: {names}")]
    WhichStudy {
        /// The journal.
        journal: String,
        /// Their names.
        names: String,
    },
    /// A study that does not exist.
    #[error("{journal}: there is no such study in it{}", if names.is_empty() { String::new() } else { format!("; its studies: {names}") })]
    NoSuchStudy {
        /// The journal.
        journal: String,
        /// The names that there are.
        names: String,
    },
    /// A study that this program cannot use.
    #[error(
        "{journal}: study {name} has no real-valued parameter yet, or several objectives; this program supports neither"
    )]
    Unusable {
        /// The journal.
        journal: String,
        /// The study's name.
        name: String,
    },
    /// A journal without a study of this program.
    #[error("{}: holds no study that this program made", file.display())]
    NoStudy {
        /// The file.
        file: PathBuf,
    },
    /// Another session has the study.
    #[error("{}: another session is running in this folder; end it first, or view the study with optuna-dashboard", folder.display())]
    InUse {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder of the study, or a thread.
    #[error("{what}: {source}")]
    System {
        /// The attempted action.
        what: String,
        /// The system's error.
        source: std::io::Error,
    },
}
