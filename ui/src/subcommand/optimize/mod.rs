//! `quadfrog optimize`: complete studies on the simulator without a screen, or a worker on a shared study.

mod printer;
mod recorder;
mod stop;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::anyhow;
use clap::{Args, ValueEnum};
use quadfrog::config::Config;
use quadfrog::engine::{self, EngineError, Options, PRIOR_FILE, ReadyPrior, StoredStudy};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::Storage;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::automatic::{self, JudgedTrial};
use quadfrog::session::parallel;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::trial::{Approval, Backend, Task, Verdict};

use printer::Printer;
use recorder::{RecordedRollout, StudyRecorder};
use stop::StudiesStop;

use super::arguments::{self, Seeds, StudyArguments, each_once, parse_seeds, whole_number};
use super::failure::Failure;
use super::prior;
use super::selection::{SelectedStudy, parse_storage, study_to_continue, study_to_join};

/// The trials whose ticks are recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RecordChoice {
    /// Nothing
    None,
    /// The best trial
    Best,
    /// Every trial
    All,
}

#[derive(Debug, Args)]
pub struct OptimizeArguments {
    /// Task of the study; several with commas, a study each [default: forward]
    #[arg(long, value_name = "TASK", value_delimiter = ',', value_parser = arguments::task())]
    task: Vec<Task>,
    /// Seed of the study; several as 0-4 or 0,3,7, a study each, on all cores [default: from optimize.toml]
    #[arg(long, value_name = "N", visible_alias = "seeds", value_parser = parse_seeds)]
    seed: Option<Seeds>,
    #[command(flatten)]
    study: StudyArguments,
    /// Continue the study in this folder
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    resume: Option<PathBuf>,
    /// Join the study of this folder, journal file or redis://HOST:PORT/DB as another worker; --trials is the budget of all
    /// workers together
    #[arg(long, value_name = "JOURNAL", conflicts_with = "resume")]
    join: Option<String>,
    /// Continue on the simulator a study that was made on a robot
    #[arg(long)]
    accept_backend_change: bool,
    /// Print one JSON object per finished trial on standard output; table and messages go to standard error
    #[arg(long)]
    json: bool,
    /// Trials to record
    #[arg(long, value_name = "WHAT", default_value = "best")]
    record: RecordChoice,
    /// Studies that run at the same time [default: the number of cores]; with --join: workers [default: 1]
    #[arg(long, value_name = "N", value_parser = whole_number(1_u16..=u16::MAX))]
    jobs: Option<u16>,
}

impl OptimizeArguments {
    /// Returns the only seed, if one is given; more than one is refused with `message`.
    fn only_seed(&self, message: &str) -> Result<Option<u32>, Failure> {
        let seeds = self.seed.as_ref().map_or(&[][..], |seeds| &seeds.0);
        if seeds.len() > 1 { Err(Failure::input(message)) } else { Ok(seeds.first().copied()) }
    }
}

pub fn run(arguments: &OptimizeArguments) -> Result<(), Failure> {
    let joined = arguments.join.as_deref().map(parse_storage);
    let existing = match &joined {
        Some(Storage::File(file)) => file.parent(),
        _ => arguments.resume.as_deref(),
    };
    let (_, files, robot) = arguments.study.load_robot(arguments::DEFAULT_MODEL, existing)?;
    let (config, continued) = arguments.study.load_config(&files, existing)?;
    let studies = match &joined {
        Some(storage) => workers(arguments, storage, &robot)?,
        None => select(arguments, &config, &robot)?,
    };
    let priors = priors(arguments, existing, &config, &robot, &studies)?;
    let budgets = studies.iter().map(|study| arguments.study.trials.or(study.budget).unwrap_or(config.optimize.trials));
    let printer = Printer::new(arguments.json, joined.is_some(), &config, &budgets.collect::<Vec<_>>(), continued);
    let stop = StudiesStop::at_signal(printer.printer_of_notices());
    let failures = Mutex::new(Vec::new());
    let next = AtomicUsize::new(0);
    let cores = if joined.is_some() { 1 } else { parallel::cores() };
    let jobs = arguments.jobs.map_or(cores, usize::from);
    let fail = |failure| failures.lock().unwrap_or_else(PoisonError::into_inner).push(failure);
    let runner = StudyRunner {
        arguments,
        join: joined.as_ref(),
        config: &config,
        robot: &robot,
        printer: &printer,
        stop: &stop,
    };
    let work = || {
        while stop.signal().is_none()
            && let Some(study) = studies.get(next.fetch_add(1, Ordering::Relaxed))
        {
            if let Err(failure) = runner.run(study, priors.get(&study.task)) {
                fail(failure);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(studies.len()) {
            if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, work) {
                let what =
                    "a worker's thread could not be started; allow more threads (`ulimit -u`) or give fewer --jobs";
                fail(EngineError::System { what: what.to_owned(), source: error }.into());
            }
        }
    });
    if joined.is_none() {
        printer.summary();
    }
    let mut failures = failures.into_inner().unwrap_or_else(PoisonError::into_inner);
    drop(printer);
    // All failures are printed. The last one decides the exit status, so other errors come after unusable input.
    failures.sort_by_key(|failure| matches!(failure, Failure::Other(_)));
    failures.extend(stop.signal().map(Failure::Interrupted));
    let last = failures.pop();
    failures.iter().for_each(Failure::print);
    last.map_or(Ok(()), Err)
}

/// Returns the `--jobs` workers on the study of `storage`, each with its own folder.
fn workers(
    arguments: &OptimizeArguments,
    storage: &Storage,
    robot: &RobotDescription,
) -> Result<Vec<SelectedStudy>, Failure> {
    const SEVERAL: &str = "--join: a worker takes part in one study; give one --task and one --seed";
    if arguments.task.len() > 1 {
        return Err(Failure::input(SEVERAL));
    }
    let task = arguments.task.first().copied();
    let seed = arguments.only_seed(SEVERAL)?;
    let StoredStudy { name: stored, task, seed, budget, .. } = study_to_join(storage, task, seed, robot)?;
    let name = arguments.study.new_folder(task, seed);
    let folder = |worker| PathBuf::from(format!("{}-joined-{worker}", name.display()));
    let worker =
        |worker: u16| SelectedStudy { name: stored.clone(), task, seed, folder: folder(worker), new: true, budget };
    Ok((0..arguments.jobs.unwrap_or(1)).map(worker).collect())
}

/// Returns the continued study, or a new study for each pair of task and seed.
fn select(
    arguments: &OptimizeArguments,
    config: &Config,
    robot: &RobotDescription,
) -> Result<Vec<SelectedStudy>, Failure> {
    if let Some(folder) = &arguments.resume {
        let seed = arguments.only_seed("--seed: a study that is continued has one seed")?;
        return Ok(vec![study_to_continue(folder, arguments.task.first().copied(), seed, robot)?]);
    }
    let tasks = if arguments.task.is_empty() { vec![Task::Forward] } else { each_once(&arguments.task) };
    let seeds = arguments.seed.as_ref().map_or_else(|| vec![config.optimize.sampler.seed], |seeds| seeds.0.clone());
    let pairs = tasks.iter().flat_map(|task| seeds.iter().map(|seed| (*task, *seed)));
    let new = |(task, seed)| {
        let folder = arguments.study.new_folder(task, seed);
        SelectedStudy { name: None, task, seed, folder, new: true, budget: None }
    };
    Ok(pairs.map(new).collect())
}

/// Returns the prior of each task of the studies, if the sampler is `sim`. Made before the first study, once, on all cores;
/// `existing` is the folder of a study that is continued or joined.
fn priors(
    arguments: &OptimizeArguments,
    existing: Option<&Path>,
    config: &Config,
    robot: &RobotDescription,
    studies: &[SelectedStudy],
) -> Result<HashMap<Task, ReadyPrior>, Failure> {
    let mut priors = HashMap::new();
    if config.optimize.sampler.kind != SamplerKind::Sim {
        return Ok(priors);
    }
    let own: Vec<PathBuf> = existing.map(|folder| folder.join(PRIOR_FILE)).into_iter().collect();
    let output = arguments.resume.as_deref().and_then(Path::parent).unwrap_or(&arguments.study.output);
    for study in studies {
        if let Entry::Vacant(empty) = priors.entry(study.task) {
            empty.insert(prior::obtain(config, robot, study.task, &own, output)?);
        }
    }
    Ok(priors)
}

/// All that the studies have in common.
struct StudyRunner<'a> {
    arguments: &'a OptimizeArguments,
    join: Option<&'a Storage>,
    config: &'a Config,
    robot: &'a RobotDescription,
    printer: &'a Printer,
    stop: &'a StudiesStop,
}

impl StudyRunner<'_> {
    /// Runs a study to its end, or until the stop is set.
    fn run(&self, study: &SelectedStudy, prior: Option<&ReadyPrior>) -> Result<(), Failure> {
        let StudyRunner { arguments, join, config, robot, printer, stop } = *self;
        let settings = config.settings(robot, study.task, Backend::Simulator)?;
        let simulator = Simulator::new(robot, &config.simulator).map_err(EngineError::from)?;
        let mut rollout = Rollout::new(simulator, &settings);
        let study = &study.with_folder()?;
        let options = Options {
            seed: study.seed,
            trials: arguments.study.trials.or(study.budget),
            folder: Some(study.folder.clone()),
            study: study.name.clone(),
            approve: Approval::Auto,
            join: join.cloned(),
            accept_backend_change: arguments.accept_backend_change,
            prior: prior.map(|prior| Arc::clone(&prior.model)),
            provenance: arguments.study.provenance(),
            ..Options::new(config.clone(), robot.clone(), Backend::Simulator, study.task)
        };
        let prepared = engine::prepare_folder(&options)?;
        if let Some(prior) = prior {
            prior.keep(&[study.folder.join(PRIOR_FILE)])?;
        }
        let recording = prepared.recording.clone().filter(|_| arguments.record != RecordChoice::None);
        // Workers of a shared study have their own folders: the file name alone is ambiguous.
        let name = |path: &PathBuf| {
            if join.is_some() { Some(path.clone().into()) } else { path.file_name().map(ToOwned::to_owned) }
        };
        let name = recording.as_ref().and_then(name).unwrap_or_default();
        // Synced: a judged trial is on disk before the next one is proposed.
        let mut experiment = engine::open_experiment(&options, Durability::Synced, &name.to_string_lossy())?;
        let _running = stop.enter(experiment.journal_wait());
        printer.opened();
        let mut recorder = recording.as_ref().map(|path| StudyRecorder::create(path, &options)).transpose()?;
        let (mut failed, mut spare) = (None, Vec::new());
        // The rollouts of the best trial, and the earlier ones of the present trial.
        let mut best: Option<(u32, f64, Vec<RecordedRollout>)> = None;
        let mut present = Vec::new();
        // The records of the newest verdict, with which a recording of one trial ends.
        let mut newest = Vec::new();
        let each = |trial: JudgedTrial| {
            let JudgedTrial { experiment, row, warning, .. } = trial;
            if row.verdict.is_some() {
                printer.trial(study, row, experiment.counted());
                stop.end_with_reader(printer.printer_of_notices());
            }
            if let Some(warning) = warning {
                printer.warn(study, warning);
            }
            match arguments.record {
                RecordChoice::None => {}
                RecordChoice::All => {
                    let rollout = RecordedRollout::of(trial, std::mem::take(&mut spare));
                    if let Some(Err(error)) = recorder.as_mut().map(|recorder| recorder.rollout(&rollout)) {
                        failed.get_or_insert(error);
                    }
                    spare = rollout.into_ticks();
                }
                RecordChoice::Best => match row.verdict {
                    None => present.push(RecordedRollout::of(trial, Vec::new())),
                    Some(verdict) => {
                        newest = trial.after.to_vec();
                        let mut rollouts = std::mem::take(&mut present);
                        let value = row.value.filter(|_| verdict == Verdict::Accept);
                        if let Some(value) = value.filter(|value| best.as_ref().is_none_or(|(_, best, _)| value > best))
                        {
                            let replaced = best.take().and_then(|(_, _, mut rollouts)| rollouts.pop());
                            let spare = replaced.map(RecordedRollout::into_ticks).unwrap_or_default();
                            rollouts.push(RecordedRollout::of(trial, spare));
                            best = Some((row.trial, value, rollouts));
                        }
                    }
                },
            }
        };
        let ran = automatic::run_watched(&mut experiment, &mut rollout, each, || stop.signal().is_some());
        if let Some(mut recorder) = recorder {
            let recorded = match (failed, &best) {
                (Some(error), _) => Err(error),
                (None, Some((trial, _, rollouts))) => {
                    let earlier = experiment.rows().filter(|row| row.trial < *trial);
                    recorder
                        .rows(earlier)
                        .and_then(|()| rollouts.iter().try_for_each(|rollout| recorder.rollout(rollout)))
                }
                (None, None) => Ok(()),
            };
            newest.extend(experiment.take_records());
            failed = recorded.and_then(|()| recorder.finish(&newest, experiment.rows())).err();
        }
        // A full disk fails the journal and the recording: the journal, with every verdict, is named first.
        if let Err(refusal) = ran {
            let place = join.map_or_else(|| study.folder.display().to_string(), ToString::to_string);
            let recording =
                failed.map_or_else(String::new, |error| format!("; and the recording is not complete: {error}"));
            return Err(Failure::Other(anyhow!("{place}: {refusal}{recording}")));
        }
        // Also a finished file that another program put in its place: what was judged is there, the recording is not complete.
        if let Some(error) = failed {
            return Err(Failure::Other(anyhow!("the recording is not complete: {error}")));
        }
        match stop.signal() {
            Some(_) if experiment.proposal().is_some() => printer.interrupted(study, experiment.counted(), &options),
            _ => printer.finished(study, &experiment, &options),
        }
        Ok(())
    }
}
