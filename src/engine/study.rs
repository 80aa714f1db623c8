//! The study of a session: opened as an experiment, described for the recording.

use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use super::folder::{STUDY_FILE, robot_fingerprint};
use super::options::{EngineError, Options};
use super::stored::has_journal;
use crate::optimize::ask::{Direction, SamplerConfig, SamplerKind};
use crate::optimize::journal::{Durability, StudyRecord};
use crate::optimize::space::{Range, Space, SpaceError};
use crate::optimize::study::{Storage, Study, StudyError, StudyOptions};
use crate::optimize::trial::Trial;
use crate::recording::record::SessionInfo;
use crate::session::experiment::attributes::{self, Origin};
use crate::session::experiment::study_attributes::{
    BackendAttribute, BudgetAttribute, NewStudyAttributes, SamplerAttribute, StudyAttributes,
};
use crate::session::experiment::{self, Experiment, ExperimentPlan};
use crate::trial::{Backend, ParameterInfo, Task};

/// Opens the study of `options` as an experiment, for the console and for `optimize`.
///
/// # Errors
/// When the study cannot be read, or is of another task.
pub fn open_experiment(options: &Options, durability: Durability, recording: &str) -> Result<Experiment, EngineError> {
    if options.config.optimize.sampler.kind == SamplerKind::Sim && options.prior.is_none() {
        return Err(EngineError::NoPrior);
    }
    open_without_prior(options, durability, recording)
}

/// [`open_experiment`] in which a study of the sampler `sim` waits for its prior, unless the options have it.
pub(super) fn open_without_prior(
    options: &Options,
    durability: Durability,
    recording: &str,
) -> Result<Experiment, EngineError> {
    check_backend(options)?;
    let mut study = open_study(options, durability)?;
    let budget = options.budget();
    let worker = if options.join.is_some() { study.join()? } else { 0 };
    let other_sampler = if worker == 0 { take_over(options, &mut study)? } else { None };
    let backend = options.backend.name();
    if made_on(&StudyAttributes::of(study.attributes())) != backend {
        study.annotate_study(&attributes::write(&BackendAttribute { backend }))?;
    }
    let plan = ExperimentPlan {
        task: options.task,
        control: *options.config.task(options.task),
        parameters: options.config.parameters(options.task),
        seed: u64::from(options.seed),
        budget,
        recording: recording.to_owned(),
        widest: options.config.widest(options.task),
        gains: options.config.gains(),
        contenders: options.config.optimize.confirm.contenders,
        confidence: options.config.optimize.confirm.confidence,
        worker,
        abandoned: Duration::from_secs_f64(options.config.optimize.workers.abandoned_s),
        backend: options.backend,
        terrain: (options.backend == Backend::Simulator).then_some(options.config.simulator.terrain),
        envelope: options.config.hop_envelope(options.backend),
        needs_prior: options.config.optimize.sampler.kind == SamplerKind::Sim && options.prior.is_none(),
    };
    let mut experiment = Experiment::open(plan, study)?;
    if let Some(before) = other_sampler {
        let name = options.config.optimize.sampler.kind.name();
        experiment.warn(format!("the sampler is {name} from now on; the study was continued with {before} before"));
    }
    Ok(experiment)
}

/// Keeps budget and sampler of the session that has the study's folder in the study. Returns the name of the sampler before, if it was
/// another.
///
/// # Errors
/// When more trials count already than are asked for, or the study cannot be written.
fn take_over(options: &Options, study: &mut Study) -> Result<Option<String>, EngineError> {
    let budget = options.budget();
    let kept = StudyAttributes::of(study.attributes()).budget;
    require_budget(budget, kept, study.trials())?;
    if kept != Some(budget) {
        study.annotate_study(&attributes::write(&BudgetAttribute { budget }))?;
    }
    let before = experiment::last_sampler(study);
    let sampler = attributes::write(&SamplerAttribute { sampler: &study.options().sampler });
    if sampler.iter().any(|(name, value)| study.attributes().get(name) != Some(value)) {
        study.annotate_study(&sampler)?;
    }
    Ok(before.filter(|before| before != options.config.optimize.sampler.kind.name()))
}

/// Opens the study of `options`, created if it does not exist, with the prior of the options and the first point of the
/// configuration.
///
/// # Errors
/// When the study cannot be read, is of another task, another unit of the objective or, to be joined, another robot, or is to be continued
/// and is not there.
pub fn open_study(options: &Options, durability: Durability) -> Result<Study, EngineError> {
    let parameters = options.config.parameters(options.task);
    let space = space_of(&parameters)?;
    let sampler = SamplerConfig { seed: options.seed, ..options.config.sampler(options.task) };
    let storage = storage(options);
    require_study(options)?;
    let mut study = Study::open(
        storage,
        StudyOptions {
            name: name(options),
            direction: Direction::Maximize,
            metric: format!("J_{} ({})", options.task.name(), options.unit()),
            space,
            sampler: sampler.clone(),
            attributes: attributes::write(&NewStudyAttributes {
                task: options.task,
                robot: &options.robot.name,
                robot_files: robot_fingerprint(&options.robot),
                seed: options.seed,
                sampler: &sampler,
                version: env!("CARGO_PKG_VERSION"),
                budget: options.budget(),
                backend: options.backend.name(),
                unit: Some(options.unit()).filter(|unit| *unit != options.task.unit()),
            }),
            durability,
        },
    )?;
    let stored = StudyAttributes::of(study.attributes());
    require_unit(options, &stored)?;
    if options.join.is_some() {
        require_robot(options, &stored)?;
    }
    if let Some(prior) = &options.prior {
        study.use_prior(Arc::clone(prior));
    }
    if options.join.is_none() && study.trials().is_empty() {
        enqueue_first(&mut study, &options.config.first(options.task))?;
    }
    Ok(study)
}

fn storage(options: &Options) -> Storage {
    match (&options.join, &options.folder) {
        (Some(storage), _) => storage.clone(),
        (None, Some(folder)) => Storage::File(folder.join(STUDY_FILE)),
        (None, None) => Storage::Memory,
    }
}

/// Returns the backend of a study. One of an earlier version, without the attribute, counts as simulated.
fn made_on(attributes: &StudyAttributes) -> &str {
    let made = attributes.backend.as_deref().unwrap_or(Backend::Simulator.name());
    Backend::from_str(made).map_or(made, |backend| backend.name())
}

/// Refuses to continue a study that was made or continued on another backend, or on hardware on another robot, unless the
/// options accept it: its points and its verdicts are those of another machine. Refuses a study with another unit of the objective,
/// and one that is to be continued and is not there, in any case.
///
/// # Errors
/// When it is one, or the study cannot be read.
pub fn check_backend(options: &Options) -> Result<(), EngineError> {
    require_study(options)?;
    check_stored(options, |study| {
        let attributes = StudyAttributes::of(&study.user_attributes);
        require_unit(options, &attributes)?;
        if options.accept_backend_change {
            return Ok(());
        }
        let (made, robot) = (made_on(&attributes), attributes.robot.as_deref().unwrap_or("unknown robot"));
        let same_robot = options.backend == Backend::Simulator || robot == options.robot.name;
        if made == options.backend.name() && same_robot {
            return Ok(());
        }
        Err(EngineError::OtherBackend {
            study: format!("{}, study {}", storage(options), study.name),
            made: format!("{made} ({robot})"),
            asked: format!("{} ({})", options.backend.name(), options.robot.name),
        })
    })
}

/// Refuses a study whose values have another unit than those of this session: a length and a speed cannot be compared. A study of
/// another program has no unit.
fn require_unit(options: &Options, study: &StudyAttributes) -> Result<(), EngineError> {
    let Some(task) = study.task else { return Ok(()) };
    let (stored, asked) = (study.unit.as_deref().unwrap_or(task.unit()), options.unit());
    if stored == asked {
        return Ok(());
    }
    let (study, stored) = (format!("{}, study {}", storage(options), name(options)), stored.to_owned());
    Err(EngineError::OtherUnit { study, task: task.name(), stored, asked })
}

/// Refuses to join a study whose robot has the same name and other files: there need be no folder with the study's own. Of another
/// version of this program the files of a built-in robot may differ.
fn require_robot(options: &Options, study: &StudyAttributes) -> Result<(), EngineError> {
    let same_version = study.version.as_deref() == Some(env!("CARGO_PKG_VERSION"));
    let own = robot_fingerprint(&options.robot);
    match &study.robot_files {
        Some(made) if *made != own && same_version => Err(EngineError::OtherRobot {
            study: format!("{}, study {}", storage(options), name(options)),
            robot: options.robot.name.clone(),
            made: made.clone(),
            own,
        }),
        _ => Ok(()),
    }
}

/// Refuses a study that is to be continued and is not there.
fn require_study(options: &Options) -> Result<(), EngineError> {
    let Some(continued) = &options.study else { return Ok(()) };
    let journal = storage(options).journal(Durability::Buffered).map_err(StudyError::from)?;
    if journal.state().find(continued).is_some() {
        return Ok(());
    }
    let living = journal.state().studies().iter().filter(|study| !study.deleted);
    let names = living.map(|study| study.name.as_str()).collect::<Vec<_>>().join(", ");
    Err(EngineError::NoSuchStudy { journal: storage(options).to_string(), names })
}

/// Refuses to continue a study in which more trials count already than are asked for; for a console, before it takes a robot over.
///
/// # Errors
/// When it is one, or the study cannot be read.
pub fn check_budget(options: &Options) -> Result<(), EngineError> {
    check_stored(options, |study| {
        require_budget(options.budget(), StudyAttributes::of(&study.user_attributes).budget, &study.trials)
    })
}

/// Refuses a budget below the trials that count, unless it is the one that the study has `kept`.
fn require_budget(budget: u32, kept: Option<u32>, trials: &[Trial]) -> Result<(), EngineError> {
    let counts = |trial: &&Trial| attributes::row_of(trial, String::new(), &[]).counts();
    let counted = trials.iter().filter(counts).count() as u32;
    if counted > budget && kept != Some(budget) {
        return Err(EngineError::BudgetBelowCounted { budget, counted });
    }
    Ok(())
}

/// Checks the study of `options` as it is stored; one that does not exist yet passes.
fn check_stored(
    options: &Options,
    check: impl FnOnce(&StudyRecord) -> Result<(), EngineError>,
) -> Result<(), EngineError> {
    let storage = storage(options);
    if !has_journal(&storage)? {
        return Ok(());
    }
    let journal = storage.journal(Durability::Buffered).map_err(StudyError::from)?;
    let found = journal.state().find(&name(options));
    found.map_or(Ok(()), |study| check(&journal.state().studies()[study]))
}

/// Queues the first point of the configuration.
fn enqueue_first(study: &mut Study, point: &[(String, f64)]) -> Result<(), StudyError> {
    if point.is_empty() {
        return Ok(());
    }
    study.enqueue_unless(point, &Origin::default().attributes(), &|trials| !trials.is_empty()).map(drop)
}

/// Returns the name of the study of `options` in its journal.
fn name(options: &Options) -> String {
    options.study.clone().unwrap_or_else(|| study_name(options.task, options.seed))
}

/// Returns the name of a new study in its journal.
pub fn study_name(task: Task, seed: u32) -> String {
    format!("{}-seed{seed}", task.name())
}

/// Returns the session record of the recording `recording`.
pub fn session_info(options: &Options, recording: &str) -> SessionInfo {
    SessionInfo {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        backend: Some(options.backend),
        robot: options.robot.name.clone(),
        task: Some(options.task),
        unit: options.unit().to_owned(),
        sampler: Some(options.config.optimize.sampler.kind),
        seed: u64::from(options.seed),
        budget: options.budget(),
        parameters: options.config.parameters(options.task),
        study: match (&options.join, &options.folder) {
            (Some(storage), _) => storage.to_string(),
            (None, Some(folder)) => folder.join(STUDY_FILE).display().to_string(),
            (None, None) => String::new(),
        },
        recording: recording.to_owned(),
        started: jiff::Timestamp::now().to_string(),
        observe: options.observe,
        gains: options.config.fixed_gains(options.task),
        approve: options.approve,
        limits: options.config.health_limits(),
        commit: options.provenance.commit.clone(),
        host: options.provenance.host.clone(),
        operator: options.provenance.operator.clone(),
        configured_gains: options.config.task(options.task).gains().values(),
    }
}

/// Returns the search space of a task's parameters.
pub(super) fn space_of(parameters: &[ParameterInfo]) -> Result<Space, SpaceError> {
    Space::new(parameters.iter().map(|p| (p.name.clone(), Range::linear(p.low, p.high))))
}
