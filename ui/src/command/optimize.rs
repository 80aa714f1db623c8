//! `quadfrog optimize`: whole studies on the simulator without a screen, alone or as one more worker on a shared one.

mod printer;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use clap::{Args, ValueEnum};
use color_eyre::eyre::eyre;
use quadfrog::config::Config;
use quadfrog::engine::{self, EngineError, Options, StoredStudy};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::Storage;
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::recording::writer::Writer;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::automatic;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::Tick;
use quadfrog::trial::{Approval, Backend, Task, TrialRecord, Verdict};

use printer::Printer;

use super::chosen::{Chosen, continued, joined, journal};
use super::{Failure, StudyArguments, TaskName};

/// What is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kept {
    /// Nothing
    None,
    /// The best trial
    Best,
    /// Every trial
    All,
}

#[derive(Debug, Args)]
pub struct OptimizeArguments {
    /// What the robot is to learn; several with commas, each a study of its own [default: forward]
    #[arg(long, value_name = "TASK", value_delimiter = ',')]
    task: Vec<TaskName>,
    /// Seed of the study; several as 0-4 or 0,3,7, each a study of its own [default: that of optimize.toml]
    #[arg(long, value_name = "N", value_parser = parse_seeds)]
    seed: Option<Seeds>,
    #[command(flatten)]
    study: StudyArguments,
    /// Continue the study in this folder
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    resume: Option<PathBuf>,
    /// Take part in the study of this folder, journal file or redis://HOST:PORT/DB as one more worker; --trials is the
    /// budget of all workers together
    #[arg(long, value_name = "JOURNAL", conflicts_with = "resume")]
    join: Option<String>,
    /// One JSON object per finished trial on standard output; table and messages go to standard error
    #[arg(long)]
    json: bool,
    /// What is recorded
    #[arg(long, value_name = "WHAT", default_value = "best")]
    record: Kept,
    /// Studies that run at the same time [default: the number of cores]; with --join: workers [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
}

/// Seeds as on the command line.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Seeds(Vec<u32>);

fn parse_seeds(text: &str) -> Result<Seeds, String> {
    let number = |text: &str| {
        text.trim().parse::<u32>().map_err(|_| format!("`{text}` is not a whole number from 0 to 4294967295"))
    };
    let mut seeds = Vec::new();
    for part in text.split(',') {
        match part.split_once('-') {
            Some((first, last)) => {
                let (first, last) = (number(first)?, number(last)?);
                if last < first || last - first >= 10_000 {
                    return Err(format!("`{part}` is no range of at most 10000 seeds; write it as 0-4"));
                }
                seeds.extend(first..=last);
            }
            None => seeds.push(number(part)?),
        }
    }
    Ok(Seeds(seeds))
}

pub fn run(arguments: &OptimizeArguments) -> Result<(), Failure> {
    let joined = arguments.join.as_deref().map(journal);
    let beside = match &joined {
        Some(Storage::File(file)) => file.parent(),
        _ => arguments.resume.as_deref(),
    };
    let config = arguments.study.load_config(beside)?;
    let robot = arguments.study.load_robot()?;
    let studies = match &joined {
        Some(storage) => workers(arguments, storage, &robot)?,
        None => choose(arguments, &config, &robot)?,
    };
    let printer = Printer::new(arguments, &config, &studies);
    let failures = Mutex::new(Vec::new());
    let next = AtomicUsize::new(0);
    let jobs = match arguments.jobs {
        Some(jobs) => usize::from(jobs),
        None if joined.is_some() => 1,
        None => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(studies.len()) {
            scope.spawn(|| {
                while let Some(study) = studies.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(failure) = run_one(arguments, joined.as_ref(), &config, &robot, study, &printer) {
                        failures.lock().unwrap_or_else(PoisonError::into_inner).push(failure);
                    }
                }
            });
        }
    });
    if joined.is_none() {
        printer.summary();
    }
    let mut failures = failures.into_inner().unwrap_or_else(PoisonError::into_inner);
    drop(printer);
    // Every one of them is said; the last decides the exit status, unless an earlier one is graver than bad input.
    failures.sort_by_key(|failure| matches!(failure, Failure::Other(_)));
    let last = failures.pop();
    for failure in failures {
        match failure {
            Failure::Input(message) => eprintln!("quadfrog: {message}"),
            Failure::Other(report) => eprintln!("quadfrog: {report:?}"),
        }
    }
    last.map_or(Ok(()), Err)
}

/// As many workers on the study of `storage` as `--jobs` says, each with a folder of its own.
fn workers(arguments: &OptimizeArguments, storage: &Storage, robot: &RobotDescription) -> Result<Vec<Chosen>, Failure> {
    let several = || Failure::input("--join: a worker takes part in one study; give one --task and one --seed");
    let task = match arguments.task.as_slice() {
        [] => None,
        [task] => Some(Task::from(*task)),
        _ => return Err(several()),
    };
    let seed = match arguments.seed.as_ref().map(|seeds| seeds.0.as_slice()) {
        None => None,
        Some([seed]) => Some(*seed),
        Some(_) => return Err(several()),
    };
    let StoredStudy { task, seed, budget, .. } = joined(storage, task, seed, robot)?;
    let name = arguments.study.new_folder(task, seed);
    // Many may begin in the same second.
    let folder = |worker| PathBuf::from(format!("{}-joined-{}-{worker}", name.display(), std::process::id()));
    let worker = |worker: u16| Chosen { task, seed, folder: folder(worker), budget };
    Ok((0..arguments.jobs.unwrap_or(1)).map(worker).collect())
}

/// The studies that the arguments ask for: every task with every seed.
fn choose(arguments: &OptimizeArguments, config: &Config, robot: &RobotDescription) -> Result<Vec<Chosen>, Failure> {
    let one = |task: &TaskName| Task::from(*task);
    if let Some(folder) = &arguments.resume {
        let seed = match arguments.seed.as_ref().map(|seeds| seeds.0.as_slice()) {
            None => None,
            Some([seed]) => Some(*seed),
            Some(_) => return Err(Failure::input("--seed: a study that is continued has one seed")),
        };
        return Ok(vec![continued(folder, arguments.task.first().map(one), seed, robot)?]);
    }
    let tasks: Vec<Task> =
        if arguments.task.is_empty() { vec![Task::Forward] } else { arguments.task.iter().map(one).collect() };
    let seeds = arguments.seed.as_ref().map_or_else(|| vec![config.optimize.sampler.seed], |seeds| seeds.0.clone());
    let distinct = |(place, item): (usize, &(Task, u32)), all: &[(Task, u32)]| !all[..place].contains(item);
    let every: Vec<_> = tasks.iter().flat_map(|task| seeds.iter().map(|seed| (*task, *seed))).collect();
    let once =
        every.iter().enumerate().filter(|(place, item)| distinct((*place, *item), &every)).map(|(_, item)| *item);
    let new = |(task, seed)| Chosen { task, seed, folder: arguments.study.new_folder(task, seed), budget: None };
    Ok(once.map(new).collect())
}

fn run_one(
    arguments: &OptimizeArguments,
    join: Option<&Storage>,
    config: &Config,
    robot: &RobotDescription,
    study: &Chosen,
    printer: &Printer,
) -> Result<(), Failure> {
    let options = Options {
        seed: study.seed,
        trials: arguments.study.trials.or(study.budget),
        folder: Some(study.folder.clone()),
        approve: Approval::Auto,
        join: join.cloned(),
        ..Options::new(config.clone(), robot.clone(), Backend::Simulator, study.task)
    };
    let settings = config.settings(robot, study.task, Backend::Simulator)?;
    let simulator = Simulator::new(robot, &config.simulator).map_err(EngineError::from)?;
    let mut rollout = Rollout::new(simulator, &settings);
    let prepared = engine::prepare_folder(&options)?;
    let recording = prepared.recording.clone().filter(|_| arguments.record != Kept::None);
    let name = match &recording {
        // Beside other workers' recordings the name alone says nothing.
        Some(path) if join.is_some() => Some(path.display().to_string()),
        Some(path) => path.file_name().map(|name| name.to_string_lossy().into_owned()),
        None => None,
    };
    // The trial is on its way to the disk when it is judged, and on it before the next one is proposed.
    let mut life = engine::open_experiment(&options, Durability::Synced, name.as_deref().unwrap_or_default())?;
    let mut recorder = match &recording {
        Some(path) => Some(StudyRecorder::create(path, &options)?),
        None => None,
    };
    let mut failed = None;
    let kept = arguments.record;
    let mut best: Option<(TrialRecord, Vec<Tick>)> = None;
    let ran = automatic::run_watched(&mut life, &mut rollout, |life, row, ticks| {
        printer.trial(study, row, life.counted());
        let accepted = row.verdict == Some(Verdict::Accept);
        let better = |best: &(TrialRecord, Vec<Tick>)| row.value > best.0.value;
        match kept {
            Kept::All => {
                if let Some(recorder) = &mut recorder
                    && let Err(error) = recorder.trial(row, ticks)
                {
                    failed.get_or_insert(error);
                }
            }
            Kept::Best if accepted && best.as_ref().is_none_or(better) => best = Some((row.clone(), ticks.to_vec())),
            Kept::Best | Kept::None => {}
        }
    });
    if let Some(mut recorder) = recorder {
        if let Some((row, ticks)) = &best {
            recorder.trial(row, ticks).map_err(EngineError::from)?;
        }
        for row in life.rows() {
            recorder.row(row).map_err(EngineError::from)?;
        }
        recorder.finish().map_err(EngineError::from)?;
    }
    if let Some(error) = failed {
        return Err(EngineError::from(error).into());
    }
    if let Err(refusal) = ran {
        let place = join.map_or_else(|| study.folder.display().to_string(), ToString::to_string);
        return Err(Failure::Other(eyre!("{place}: {refusal}")));
    }
    printer.finished(study, &life.rows().cloned().collect::<Vec<_>>(), life.best(), &options);
    Ok(())
}

/// A recording of trials that ran in simulated time: each follows the last one.
struct StudyRecorder {
    writer: Writer,
    time_ns: u64,
}

impl StudyRecorder {
    fn create(path: &Path, options: &Options) -> Result<StudyRecorder, EngineError> {
        let info = engine::session_info(options, &path.display().to_string());
        let writer = Writer::create(path, &info, engine::utc_ns(), &engine::attachments(&options.config))?;
        Ok(StudyRecorder { writer, time_ns: 0 })
    }

    fn trial(&mut self, row: &TrialRecord, ticks: &[Tick]) -> Result<(), quadfrog::recording::RecordingError> {
        let start_ns = self.time_ns;
        for tick in ticks {
            let time_ns = start_ns + tick.time_ns;
            self.writer.tick(&Tick { time_ns, ..*tick })?;
            self.time_ns = time_ns + 1_000_000;
        }
        self.row(row)
    }

    fn row(&mut self, row: &TrialRecord) -> Result<(), quadfrog::recording::RecordingError> {
        self.writer.record(&Stamped { time_ns: self.time_ns, record: Record::Trial(row.clone()) })
    }

    fn finish(self) -> Result<(), quadfrog::recording::RecordingError> {
        self.writer.finish().map(|_| ())
    }
}
