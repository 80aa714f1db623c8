//! `quadfrog optimize`: whole studies on the simulator without a screen.

use std::collections::HashMap;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Args, ValueEnum};
use color_eyre::eyre::eyre;
use indicatif::{ProgressBar, ProgressStyle};
use quadfrog::config::{Backend, Config};
use quadfrog::engine::{self, EngineError, Options};
use quadfrog::optimize::journal::Durability;
use quadfrog::realtime::command::Task;
use quadfrog::realtime::telemetry::Tick;
use quadfrog::recording::record::{Measured, Record, Stamped, TrialRecord, Verdict};
use quadfrog::recording::writer::Writer;
use quadfrog::report::table;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::approval::Approval;
use quadfrog::session::automatic;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use serde::{Serialize, Serializer};

use super::study::{Chosen, continued};
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
    /// One JSON object per finished trial on standard output; table and messages go to standard error
    #[arg(long)]
    json: bool,
    /// What is recorded
    #[arg(long, value_name = "WHAT", default_value = "best")]
    record: Kept,
    /// Studies that run at the same time [default: the number of cores]
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
    let config = arguments.study.load_config(arguments.resume.as_deref())?;
    let robot = arguments.study.load_robot()?;
    let studies = choose(arguments, &config, &robot)?;
    let printer = Printer::new(arguments, &config, &studies);
    let failures = Mutex::new(Vec::new());
    let next = AtomicUsize::new(0);
    let jobs = match arguments.jobs {
        Some(jobs) => usize::from(jobs),
        None => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(studies.len()) {
            scope.spawn(|| {
                while let Some(study) = studies.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(failure) = run_one(arguments, &config, &robot, study, &printer) {
                        failures.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(failure);
                    }
                }
            });
        }
    });
    let failures = failures.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    match failures.into_iter().next() {
        Some(failure) => Err(failure),
        None => Ok(()),
    }
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
    Ok(once.map(|(task, seed)| Chosen { task, seed, folder: arguments.study.new_folder(task, seed) }).collect())
}

fn run_one(
    arguments: &OptimizeArguments,
    config: &Config,
    robot: &RobotDescription,
    study: &Chosen,
    printer: &Printer,
) -> Result<(), Failure> {
    let options = Options {
        config: config.clone(),
        robot: robot.clone(),
        backend: Backend::Simulator,
        task: study.task,
        seed: study.seed,
        trials: arguments.study.trials,
        folder: Some(study.folder.clone()),
        observe: false,
        approve: Approval::Each,
    };
    let settings = config.settings(robot, study.task, Backend::Simulator)?;
    let simulator = Simulator::new(robot, &config.simulator).map_err(EngineError::from)?;
    let mut rollout = Rollout::new(simulator, &settings);
    let prepared = engine::prepare_folder(&options)?;
    let recording = prepared.recording.clone().filter(|_| arguments.record != Kept::None);
    let name = recording.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned());
    // The trial is on its way to the disk when it is judged, and on it before the next one is proposed.
    let mut life = engine::open_life(&options, Durability::Synced, name.as_deref().unwrap_or_default())?;
    let mut recorder = match &recording {
        Some(path) => Some(StudyRecorder::create(path, &options)?),
        None => None,
    };
    let mut failed = None;
    let kept = arguments.record;
    let mut best: Option<(TrialRecord, Vec<Tick>)> = None;
    let ran = automatic::run(&mut life, &mut rollout, |row, ticks| {
        printer.trial(study, row);
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
    ran.map_err(|refusal| Failure::Other(eyre!("{}: {refusal}", study.folder.display())))?;
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
        let mut writer = Writer::create(path, &info, engine::utc_ns(), &engine::attachments(&options.config))?;
        writer.record(&Stamped { time_ns: 0, record: Record::Session(info) })?;
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

/// What the operator sees: a bar on a terminal, lines elsewhere, JSON if asked for.
struct Printer {
    json: bool,
    several: bool,
    bar: Option<ProgressBar>,
    units: HashMap<String, String>,
    output: Mutex<()>,
}

impl Printer {
    fn new(arguments: &OptimizeArguments, config: &Config, studies: &[Chosen]) -> Printer {
        let budget = arguments.study.trials.unwrap_or(config.optimize.trials);
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(u64::from(budget) * studies.len() as u64);
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} trials  {msg}");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        let units = Task::ALL.iter().flat_map(|task| config.parameters(*task)).map(|p| (p.name, p.unit)).collect();
        Printer { json: arguments.json, several: studies.len() > 1, bar, units, output: Mutex::new(()) }
    }

    fn trial(&self, study: &Chosen, row: &TrialRecord) {
        let _alone = self.output.lock();
        if self.json {
            let line = JsonLine {
                task: self.several.then(|| study.task.name()),
                seed: self.several.then_some(study.seed),
                trial: row.trial,
                params: &row.parameters,
                value: row.value,
                verdict: row.verdict,
                measured: row.measured,
            };
            // Numbers and names: there is nothing in it that JSON cannot say.
            say(&serde_json::to_string(&line).unwrap_or_default());
        }
        let line = table::line(row, study.task.unit(), &self.units);
        match &self.bar {
            Some(bar) => {
                bar.inc(1);
                bar.set_message(line);
            }
            None if self.json => {}
            None if self.several => say(&format!("{} seed {}: {line}", study.task.name(), study.seed)),
            None => say(&line),
        }
    }

    fn finished(&self, study: &Chosen, rows: &[TrialRecord], best: Option<&TrialRecord>, options: &Options) {
        let _alone = self.output.lock();
        let mut text = String::new();
        if self.several {
            text += &format!("{} seed {}\n", study.task.name(), study.seed);
        }
        text += &table::table(rows, &options.config.parameters(study.task), study.task.unit());
        text += &match best {
            Some(best) => format!("Best: {}\n", table::line(best, study.task.unit(), &self.units)),
            None => "No trial was accepted.\n".to_owned(),
        };
        text += &format!("The study is in {}\n", study.folder.display());
        let print = || if self.json { eprint!("{text}") } else { say(text.trim_end()) };
        match &self.bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }
}

impl Drop for Printer {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// One line on standard output; a reader that has gone away (`| head`) wants no more.
fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// A finished trial as the JSON line says it; task and seed only where several studies run at once.
#[derive(Serialize)]
struct JsonLine<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    task: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u32>,
    trial: u32,
    #[serde(serialize_with = "in_table_order")]
    params: &'a [(String, f64)],
    value: Option<f64>,
    verdict: Option<Verdict>,
    measured: Option<Measured>,
}

fn in_table_order<S: Serializer>(parameters: &&[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(parameters.iter().map(|(name, value)| (name, value)))
}
