//! `quadfrog evaluate`: one point of a task over several seeds and variants on the simulator, without a study.

mod table;
mod variant;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::{notice, output};
use clap::Args;
use clap_complete::ArgValueCandidates;
use quadfrog::config::{Config, LEAST_F1_HZ};
use quadfrog::engine::{EngineError, STUDY_FILE, kept_robot, newest_config, open_stored, stored_study};
use quadfrog::optimize::study::Storage;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::{EvaluatedRun, evaluate};
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::{SimConfig, Simulator};
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{Backend, JumpParameters, ParameterValues, Task, other_gains};
use serde_json::json;

use super::arguments::{self, Seeds, each_once, load_config_for, load_model, parse_seeds, whole_number};
use super::completion;
use super::failure::Failure;
use super::progress::Progress;
use quadfrog::session::parallel::{cores, in_parallel};
use variant::{Variant, on_off};

#[derive(Debug, Args)]
pub struct EvaluateArguments {
    /// Task to evaluate [default: that of the study with --point best, else forward]
    #[arg(long, value_name = "TASK", value_parser = arguments::task())]
    task: Option<Task>,
    /// Folder whose TOML files replace those of the configuration, whole or key by key; or the folder of a study, for the
    /// configuration that it ran with last
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Robot model: go1, a1, go2, or a folder with a URDF and a robot.toml [default: that of the study in --config, else go1]
    #[arg(long, value_name = "MODEL", add = ArgValueCandidates::new(completion::robots))]
    model: Option<String>,
    /// Point as f0=1.3,Fx=40,Fz=210, or `best`: the best trial of the study in --config or whose configuration that is
    /// [default: that of optimize.toml, [first.TASK]]
    #[arg(long, value_name = "POINT")]
    point: Option<String>,
    /// Seeds of sensor noise and terrain, as 0-49 or 0,3,7
    #[arg(long, value_name = "N", default_value = "0", value_parser = parse_seeds)]
    seeds: Seeds,
    /// Variants of Virtual Model Control: on, off or on,off [default: that of control.toml]
    #[arg(long, value_name = "WHICH", value_delimiter = ',', value_parser = vmc)]
    vmc: Vec<bool>,
    /// Variants of the friction of ground and blocks, as 0.4,0.6,1.0 [default: that of simulator.toml]
    #[arg(long, value_name = "MU", value_delimiter = ',', value_parser = friction)]
    friction: Vec<f64>,
    /// Length of the run, s: the last impulse begins before it [default: the number of jumps of control.toml]
    #[arg(long, value_name = "S", value_parser = duration)]
    duration: Option<f64>,
    /// Print one JSON object per run on standard output; the table goes to standard error
    #[arg(long)]
    json: bool,
    /// Runs at the same time; the results do not depend on it [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = whole_number(1_u16..=u16::MAX))]
    jobs: Option<u16>,
}

/// One run to make.
#[derive(Debug, Clone, Copy)]
struct PlannedRun {
    variant: Variant,
    /// Index of the variant's simulator.
    simulator: usize,
    spec: TrialSpec,
}

fn vmc(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("give on, off or on,off".to_owned()),
    }
}

/// Parses a coefficient of friction; the simulator checks its range.
fn friction(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "give numbers, for example 0.4,0.6,1.0".to_owned())
}

fn duration(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|s| *s > 0.0 && *s <= 600.0);
    value.ok_or_else(|| "give a number of seconds above 0 and at most 600".to_owned())
}

pub fn run(arguments: &EvaluateArguments) -> Result<(), Failure> {
    let source = Source::open(arguments)?;
    let Source { config, robot, task, .. } = &source;
    let control = config.task(*task);
    let (point, gains) = point(arguments, &source)?;
    require_whole(&point, arguments.point.as_deref(), &source)?;
    let jump = JumpParameters::from_values(&point, control.f1_hz);
    let mut spec = TrialSpec { gains: control.gains().with(&gains).with(&point), ..control.trial(*task, jump) };
    if let Some(duration_s) = arguments.duration {
        if jump.f1_hz < LEAST_F1_HZ {
            let message = format!(
                "--duration: jumps in a row need f1, the frequency between impulses, of at least {LEAST_F1_HZ} Hz; give it in --point or control.toml"
            );
            return Err(Failure::input(message));
        }
        spec.jumps = jump.within(duration_s);
        spec.duration_s = duration_s;
    }
    let settings = config.settings(robot, *task, Backend::Simulator)?;
    let simulators = simulators(arguments, config)?;
    let vmc = if arguments.vmc.is_empty() { vec![spec.vmc] } else { each_once(&arguments.vmc) };
    let mut runs = Vec::new();
    for vmc in vmc {
        for (simulator, (friction, _)) in simulators.iter().enumerate() {
            let planned = |&seed: &u32| {
                let spec = TrialSpec { vmc, seed: u64::from(seed), ..spec };
                PlannedRun { variant: Variant { vmc, friction: *friction }, simulator, spec }
            };
            runs.extend(arguments.seeds.0.iter().map(planned));
        }
    }
    let (progress, falls) = (Progress::new("evaluation", runs.len() as u64, Some("runs")), AtomicUsize::new(0));
    // A simulator of each variant for each thread, made when the thread needs it.
    let none = || Ok::<_, Failure>(simulators.iter().map(|_| None).collect::<Vec<_>>());
    let evaluate_run = |rollouts: &mut Vec<Option<Rollout<Simulator>>>, run: &PlannedRun| {
        let rollout = match &mut rollouts[run.simulator] {
            Some(rollout) => rollout,
            empty => {
                let simulator = Simulator::new(robot, &simulators[run.simulator].1).map_err(EngineError::from)?;
                empty.insert(Rollout::new(simulator, &settings))
            }
        };
        let result = evaluate(rollout, &run.spec);
        let fell = usize::from(result.fell());
        let falls = falls.fetch_add(fell, Ordering::Relaxed) + fell;
        progress.add(1, &format!("{falls} falls"));
        Ok(result)
    };
    let jobs = arguments.jobs.map_or_else(cores, usize::from);
    let results = in_parallel(jobs, &runs, none, evaluate_run)?;
    drop(progress);
    if arguments.json {
        for (run, result) in runs.iter().zip(&results) {
            let friction = simulators[run.simulator].1.terrain.friction_of(run.spec.seed);
            output::line(&line(&run.variant, friction, result).to_string());
        }
    }
    let variants: Vec<(Variant, EvaluatedRun)> =
        runs.iter().zip(results).map(|(run, result)| (run.variant, result)).collect();
    let text = table::table(&spec, &robot.name, &point, &variants);
    if arguments.json {
        output::message(&text)
    } else {
        output::text(&text)
    }
    Ok(())
}

/// Configuration, robot and task of the runs, and the study that they may belong to.
struct Source {
    config: Config,
    robot: RobotDescription,
    task: Task,
    /// File of the study in or above the folder of the configuration.
    study: Option<PathBuf>,
}

impl Source {
    fn open(arguments: &EvaluateArguments) -> Result<Source, Failure> {
        let given = arguments.config.as_deref();
        let study_of = |folder: &Path| Some(folder.join(STUDY_FILE)).filter(|file| file.is_file());
        let own = given.and_then(study_of);
        let study = own.clone().or_else(|| study_of(given?.parent()?));
        let kept = if own.is_some() { given.and_then(newest_config).map(|(_, kept)| kept) } else { None };
        let folder = if own.is_some() { kept.as_deref() } else { given };
        let kept_robot = study.as_ref().and(folder).and_then(kept_robot);
        let model = match (&arguments.model, kept_robot) {
            (Some(model), _) => model.clone(),
            (None, Some(kept)) => kept.display().to_string(),
            (None, None) => "go1".to_owned(),
        };
        let best = arguments.point.as_deref() == Some("best");
        let task = match (arguments.task, &study) {
            (Some(task), _) => task,
            (None, Some(file)) if best => stored_study(file)?.task,
            (None, _) => Task::Forward,
        };
        let (files, robot) = load_model(&model)?;
        Ok(Source { config: load_config_for(&files, folder)?, robot, task, study })
    }
}

/// Returns the simulator's settings of each variant of friction.
fn simulators(arguments: &EvaluateArguments, config: &Config) -> Result<Vec<(Option<f64>, SimConfig)>, Failure> {
    if arguments.friction.is_empty() {
        return Ok(vec![(None, config.simulator.clone())]);
    }
    let with = |&friction: &f64| {
        let mut simulator = config.simulator.clone();
        let terrain = &mut simulator.terrain;
        (terrain.friction, terrain.friction_range) = (friction, None);
        (terrain.blocks.friction, terrain.blocks.friction_range) = (friction, None);
        simulator.check().map_err(|error| Failure::input(format!("--friction {friction}: {error}")))?;
        Ok((Some(friction), simulator))
    };
    each_once(&arguments.friction).iter().map(with).collect()
}

/// Returns the point of the arguments, else that of the configuration, and the gains with which it ran as the best trial of a study;
/// parameters that the task does not optimize may be given.
fn point(arguments: &EvaluateArguments, source: &Source) -> Result<(ParameterValues, ParameterValues), Failure> {
    let Source { config, task, .. } = source;
    match arguments.point.as_deref() {
        Some("best") => best(source),
        Some(text) => {
            let known: Vec<&str> = config.optimize.bounds.keys().map(String::as_str).collect();
            let known = known.join(", ");
            let mut values = Vec::new();
            for part in text.split(',') {
                let (name, value) = part.split_once('=').ok_or_else(|| {
                    Failure::input(format!("--point {text}: `{part}` is not NAME=VALUE; write it as f0=1.3,Fx=40"))
                })?;
                let name = name.trim();
                let number = value.trim().parse::<f64>().ok().filter(|number| number.is_finite());
                let number =
                    number.ok_or_else(|| Failure::input(format!("--point: {name} = {value} is not a number")))?;
                let Some([least, most]) = config.limits(*task, name) else {
                    return Err(Failure::input(format!("--point: there is no parameter {name}; there are {known}")));
                };
                if !(least..=most).contains(&number) || (name == "f0" && number <= 0.0) {
                    let message =
                        format!("--point: {name} = {number} is outside the limits {least} to {most} of safety.toml");
                    return Err(Failure::input(message));
                }
                if values.iter().any(|(given, _)| given == name) {
                    return Err(Failure::input(format!("--point: {name} is given twice")));
                }
                values.push((name.to_owned(), number));
            }
            Ok((values.into(), ParameterValues::default()))
        }
        None => {
            let first = config.first(*task);
            if first.is_empty() {
                let message = format!(
                    "there is no point: give --point f0=..,Fx=..,Fz=.. or a configuration with [first.{}] in optimize.toml",
                    task.name()
                );
                return Err(Failure::input(message));
            }
            Ok((first, ParameterValues::default()))
        }
    }
}

/// Refuses a point without the frequency of the impulse, which would have no end, or without a force that the task optimizes, which
/// would be 0. `given` is that of the command line.
fn require_whole(point: &ParameterValues, given: Option<&str>, source: &Source) -> Result<(), Failure> {
    let Source { config, task, .. } = source;
    let forces = ["Fx", "Fy", "Fz"].into_iter().filter(|force| config.optimizes(*task, force));
    let Some(missing) = std::iter::once("f0").chain(forces).find(|name| point.get(name).is_none()) else {
        return Ok(());
    };
    let place = match given {
        Some(text) => format!("--point {text}"),
        None => format!("[first.{}] in optimize.toml", task.name()),
    };
    let what =
        if missing == "f0" { "the frequency of the impulse".to_owned() } else { format!("a force of {}", task.name()) };
    Err(Failure::input(format!(
        "{place}: {missing} is missing, {what}; a run needs the frequency and every force, 0 for none: --point f0=..,Fx=..,Fz=.."
    )))
}

/// Returns the parameters and the gains of the best trial of the study. Says which gains are not those of the configuration.
fn best(source: &Source) -> Result<(ParameterValues, ParameterValues), Failure> {
    let Source { config, task, study, .. } = source;
    let Some(file) = study else {
        let message = "--point best: there is no study in or above the folder of --config; give --config STUDY";
        return Err(Failure::input(message));
    };
    let opened = open_stored(&Storage::File(file.clone()), None, config)?;
    if let Some(ours) = opened.ours.as_ref().filter(|ours| ours.task != *task) {
        let (file, holds, task) = (file.display(), ours.task.name(), task.name());
        let message = format!("--point best: {file} is a study of {holds}, not of {task}; omit --task");
        return Err(Failure::input(message));
    }
    let rows = opened.rows();
    let best = opened
        .best(&rows)
        .ok_or_else(|| Failure::input(format!("--point best: {} has no trial that landed", file.display())))?;
    let configured = config.task(*task).gains().values();
    let others = other_gains(&best.gains, ("configured", &configured), |name| config.optimizes(*task, name));
    if !others.is_empty() {
        notice!("trial {} ran with {others}: so do these runs", best.trial);
    }
    Ok((best.parameters.clone(), best.gains.clone()))
}

/// Returns one run as a line of JSON; `friction` is that of the ground.
fn line(variant: &Variant, friction: f64, run: &EvaluatedRun) -> serde_json::Value {
    let cause = (!run.stood() || run.bounced()).then_some(&run.cause);
    let mut named = json!({ "vmc": on_off(variant.vmc) });
    if let Some(friction) = variant.friction {
        named["friction"] = friction.into();
    }
    json!({
        "variant": named,
        "seed": run.seed,
        "begun": run.begun(),
        "fell": run.fell(),
        "cause": cause,
        "fall_time_s": run.fall_time_s,
        "jumps": run.jumps,
        "value": run.value,
        "measured": run.measured,
        "tilt_at_impulse_rad": run.tilt_at_impulse_rad,
        "roll_range_rad": run.roll_range_rad,
        "pitch_range_rad": run.pitch_range_rad,
        "friction": friction,
    })
}
