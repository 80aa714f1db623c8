//! The prior of the sampler `sim` for a configuration: made once, kept as a file, reused where nothing has changed that it
//! depends on.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::folder::fnv1a;
use super::options::{EngineError, Options};
use super::study::space_of;
use crate::config::Config;
use crate::control::settings::ControlSettings;
use crate::optimize::prior::{Prior, PriorModel};
use crate::optimize::space::Space;
use crate::robot::description::{RobotDescription, read_text_within};
use crate::session::prior::{PriorPlan, PriorProgress, SIMULATION_VERSION, simulate};
use crate::trial::{Backend, ParameterInfo, Task};

/// Name of the prior in the folder of its study.
pub const PRIOR_FILE: &str = "prior.json";
/// Name of the folder of priors in the parent folder of studies, from which later studies take theirs.
const PRIORS_FOLDER: &str = "priors";
/// Value of `format` in the file.
const FORMAT: &str = "quadfrog prior";
/// Version of the file's format.
const VERSION: u32 = 1;
/// Largest file of a prior, bytes: ten times 64 robots with 4,096 points of ten parameters.
const LARGEST_PRIOR: u64 = 1 << 26;

/// A prior that is ready to be used and kept.
#[derive(Debug, Clone)]
pub struct ReadyPrior {
    /// The sampler's model of it.
    pub model: Arc<PriorModel>,
    /// File that it was read from; none if it was made.
    pub from: Option<PathBuf>,
    text: Arc<str>,
}

/// The first keys of the file, the same in every version.
#[derive(Deserialize)]
struct PriorHeader {
    format: String,
    version: u32,
}

/// The file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PriorFile {
    format: String,
    version: u32,
    /// Version of the program that made it.
    program: String,
    task: Task,
    /// [`PriorMaker::key`] of the robot, the configuration and the task.
    key: String,
    /// CRC-32 of the JSON text of `prior`.
    checksum: u32,
    prior: Prior,
}

/// Reason why a file is not the prior that is asked for.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum PriorFileError {
    #[error("{}: cannot be read: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: is no prior of this program: {reason}", path.display())]
    Foreign { path: PathBuf, reason: String },
    #[error("{}: is a prior of format version {version}, of a newer program", path.display())]
    Newer { path: PathBuf, version: u32 },
    #[error("{}: the prior is damaged: {reason}", path.display())]
    Damaged { path: PathBuf, reason: String },
    #[error("{}: the prior is of another robot, configuration, task or version of the simulation", path.display())]
    Other { path: PathBuf },
}

/// Returns the inputs of the prior of `task` for a configured robot that is driven on `backend`: the simulated robots are controlled and
/// judged by the same state, contact and limit of a fall in the air. By the estimate of hardware jumps fall that stand by the truth.
///
/// # Errors
/// When the task's settings do not fit robot and backend.
pub fn prior_plan(
    config: &Config,
    robot: &RobotDescription,
    task: Task,
    backend: Backend,
) -> Result<PriorPlan, EngineError> {
    let ControlSettings { objective, flight_tilt_rad, .. } = config.settings(robot, task, backend)?;
    let simulated = config.settings(robot, task, Backend::Simulator)?;
    Ok(PriorPlan {
        robot: robot.clone(),
        simulator: config.simulator.clone(),
        settings: ControlSettings { objective, flight_tilt_rad, ..simulated },
        control: *config.task(task),
        task,
        parameters: config.parameters(task),
        ensemble: config.prior.clone(),
    })
}

/// A prior to make or to find: its inputs, and the name of everything that it depends on.
pub struct PriorMaker {
    plan: PriorPlan,
    space: Space,
    key: String,
}

impl PriorMaker {
    /// The prior of `task` for a configured robot that is driven on `backend` ([`prior_plan`]).
    ///
    /// # Errors
    /// When the task's settings do not fit robot and backend.
    pub fn new(
        config: &Config,
        robot: &RobotDescription,
        task: Task,
        backend: Backend,
    ) -> Result<PriorMaker, EngineError> {
        let plan = prior_plan(config, robot, task, backend)?;
        let space = space_of(&plan.parameters)?;
        Ok(PriorMaker { plan, space, key: key(config, robot, task, backend) })
    }

    /// Inputs of the prior.
    pub fn plan(&self) -> &PriorPlan {
        &self.plan
    }

    /// Short name of everything that the prior depends on: the robot's files, the configuration without what belongs to screens
    /// and samplers, the task with the bounds of its parameters, the backend, the versions of program and simulation. FNV-1a, 64 bits.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Returns the file in `output`, the parent folder of studies, from which later studies take this prior.
    pub fn shared_file(&self, output: &Path) -> PathBuf {
        output.join(PRIORS_FOLDER).join(format!("{}-{}.json", self.plan.task.name(), self.key))
    }

    /// Returns the files in which a session looks for its prior and keeps it: in the folder of the study, and in that of the
    /// priors beside it. None for a session that keeps nothing.
    pub fn files(&self, options: &Options) -> Vec<PathBuf> {
        let Some(folder) = &options.folder else { return Vec::new() };
        let shared = folder.parent().map(|output| self.shared_file(output));
        [folder.join(PRIOR_FILE)].into_iter().chain(shared).collect()
    }

    /// Reads the prior from a file.
    ///
    /// # Errors
    /// When the file cannot be read, or is another prior, a damaged one or none at all.
    pub fn read(&self, path: &Path) -> Result<ReadyPrior, PriorFileError> {
        let text = read(path).map_err(|source| PriorFileError::Read { path: path.to_owned(), source })?;
        let foreign = |reason: String| PriorFileError::Foreign { path: path.to_owned(), reason };
        let damaged = |reason: String| PriorFileError::Damaged { path: path.to_owned(), reason };
        let header: PriorHeader = serde_json::from_str(&text).map_err(|error| foreign(error.to_string()))?;
        if header.format != FORMAT {
            return Err(foreign(format!("its format is \"{}\"", header.format)));
        }
        if header.version > VERSION {
            return Err(PriorFileError::Newer { path: path.to_owned(), version: header.version });
        }
        let file: PriorFile = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        let sum = checksum(&file.prior);
        if sum != file.checksum {
            return Err(damaged(format!("its checksum is {sum:08x}, not {:08x}", file.checksum)));
        }
        if file.key != self.key || file.task != self.plan.task {
            return Err(PriorFileError::Other { path: path.to_owned() });
        }
        let model = Arc::new(PriorModel::new(file.prior));
        model.covers(&self.space).map_err(|error| damaged(error.to_string()))?;
        Ok(ReadyPrior { model, from: Some(path.to_owned()), text: text.into() })
    }

    /// Returns the prior of the first of `files` that has it. A file that is there and is not this prior is reported to `notice`:
    /// nothing in it is lost, since a prior can be made again at any time.
    pub fn find(&self, files: &[PathBuf], notice: &mut dyn FnMut(String)) -> Option<ReadyPrior> {
        files.iter().find_map(|file| match self.read(file) {
            Ok(prior) => Some(prior),
            Err(PriorFileError::Read { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => {
                notice(format!("{error}; it is made again"));
                None
            }
        })
    }

    /// Returns the prior as [`PriorMaker::find`] or, where no file has it, as [`PriorMaker::make`].
    ///
    /// # Errors
    /// Those of [`PriorMaker::make`].
    pub fn find_or_make(
        &self,
        files: &[PathBuf],
        jobs: usize,
        progress: &(dyn Fn(PriorProgress) + Sync),
        interrupt: &AtomicBool,
        notice: &mut dyn FnMut(String),
    ) -> Result<ReadyPrior, EngineError> {
        match self.find(files, notice) {
            Some(prior) => Ok(prior),
            None => self.make(jobs, progress, interrupt),
        }
    }

    /// Simulates the prior on at most `jobs` threads.
    ///
    /// # Errors
    /// When it cannot be simulated, or the sampler cannot use it, or `interrupt` was set.
    pub fn make(
        &self,
        jobs: usize,
        progress: &(dyn Fn(PriorProgress) + Sync),
        interrupt: &AtomicBool,
    ) -> Result<ReadyPrior, EngineError> {
        let mut prior = simulate(&self.plan, jobs, progress, interrupt)?;
        // The file keeps what takes time to compute.
        prior.fit().map_err(|error| EngineError::UnusablePrior(error.to_string()))?;
        let file = PriorFile {
            format: FORMAT.to_owned(),
            version: VERSION,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            task: self.plan.task,
            key: self.key.clone(),
            checksum: checksum(&prior),
            prior,
        };
        let unwritten = |source: serde_json::Error| EngineError::System {
            what: "the prior cannot be written as JSON".to_owned(),
            source: source.into(),
        };
        let text = serde_json::to_string(&file).map_err(unwritten)? + "\n";
        let model = Arc::new(PriorModel::new(file.prior));
        model.covers(&self.space).map_err(|error| EngineError::UnusablePrior(error.to_string()))?;
        Ok(ReadyPrior { model, from: None, text: text.into() })
    }
}

impl ReadyPrior {
    /// Writes the prior to a file, with its folders, whole or not at all.
    ///
    /// # Errors
    /// When it cannot be written; a file of that name then has its old contents.
    pub fn write(&self, path: &Path) -> Result<(), EngineError> {
        let failed = |source| EngineError::System { what: format!("{}: cannot be written", path.display()), source };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = path.with_file_name(format!(".{name}.{}.part", uuid::Uuid::new_v4()));
        let written = File::create(&part)
            .and_then(|mut file| file.write_all(self.text.as_bytes()).and_then(|()| file.sync_all()))
            .and_then(|()| std::fs::rename(&part, path));
        if written.is_err() {
            // The error that is reported is that of the writing.
            let _ = std::fs::remove_file(&part);
        }
        written.map_err(failed)
    }

    /// Writes the prior to those of `files` that do not hold it.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn keep(&self, files: &[PathBuf]) -> Result<(), EngineError> {
        let held = |file: &&PathBuf| read(file).is_ok_and(|text| text == *self.text);
        files.iter().filter(|file| !held(file)).try_for_each(|file| self.write(file))
    }
}

fn read(path: &Path) -> std::io::Result<String> {
    read_text_within(path, LARGEST_PRIOR, "a prior")
}

fn checksum(prior: &Prior) -> u32 {
    // Numbers are written so that reading returns the same bits.
    crc32fast::hash(&serde_json::to_vec(prior).unwrap_or_default())
}

fn key(config: &Config, robot: &RobotDescription, task: Task, backend: Backend) -> String {
    let used = ["control.toml", "safety.toml", "simulator.toml", "prior.toml"];
    let files = config.as_run.iter().filter(|(name, _)| used.contains(&name.as_str())).chain(&robot.files);
    let bounds = |p: &ParameterInfo| format!("{} {:x} {:x};", p.name, p.low.to_bits(), p.high.to_bits());
    let parameters: String = config.parameters(task).iter().map(bounds).collect();
    // On hardware there is one source.
    let source = match backend {
        Backend::Simulator => config.optimize.objective.as_deref().unwrap_or_default(),
        Backend::Hardware => backend.name(),
    };
    let versions = format!("{} {SIMULATION_VERSION}", env!("CARGO_PKG_VERSION"));
    let rest = format!("{versions} {} {source} {parameters}", task.name());
    let texts = files.flat_map(|(name, text)| [name.as_bytes(), text.as_bytes()]);
    fnv1a(texts.chain([rest.as_bytes()]))
}
