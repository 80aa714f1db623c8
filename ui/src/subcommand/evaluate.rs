//! `quadfrog evaluate`: one point of a task over several seeds and variants on the simulator, without a study.

use std::path::{Path, PathBuf};

use clap::Args;
use quadfrog::config::Config;
use quadfrog::engine::{EngineError, STUDY_FILE, open_stored};
use quadfrog::optimize::study::Storage;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::{EvaluatedRun, evaluate};
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{Backend, JumpParameters, ParameterValues, Task};
use quadfrog_console::output;
use serde_json::json;

use super::arguments::{self, Seeds, load_model, parse_seeds};
use super::failure::Failure;
use super::parallel::in_parallel;

#[derive(Debug, Args)]
pub struct EvaluateArguments {
    /// Task to evaluate
    #[arg(long, value_name = "TASK", default_value = "forward", value_parser = arguments::task())]
    task: Task,
    /// Folder whose TOML files replace those of the configuration, whole or key by key
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Robot model: go1, a1, or a folder with a URDF and a robot.toml
    #[arg(long, value_name = "MODEL", default_value = "go1")]
    model: String,
    /// Point as f0=1.3,Fx=40,Fz=210, or `best`: the best trial of the study whose folder holds --config
    /// [default: that of optimize.toml, [first.TASK]]
    #[arg(long, value_name = "POINT")]
    point: Option<String>,
    /// Seeds of sensor noise and terrain, as 0-49 or 0,3,7
    #[arg(long, value_name = "N", default_value = "0", value_parser = parse_seeds)]
    seeds: Seeds,
    /// Variants of Virtual Model Control: on, off or on,off [default: that of control.toml]
    #[arg(long, value_name = "WHICH", value_delimiter = ',', value_parser = vmc)]
    vmc: Vec<bool>,
    /// Length of the run, s: the last impulse begins before it [default: the number of jumps of control.toml]
    #[arg(long, value_name = "S", value_parser = duration)]
    duration: Option<f64>,
    /// Print one JSON object per run on standard output; the table goes to standard error
    #[arg(long)]
    json: bool,
}

fn vmc(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("give on, off or on,off".to_owned()),
    }
}

fn duration(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|s| *s > 0.0 && *s <= 600.0);
    value.ok_or_else(|| "give a number of seconds above 0 and at most 600".to_owned())
}

pub fn run(arguments: &EvaluateArguments) -> Result<(), Failure> {
    let config = Config::load(arguments.config.as_deref())?;
    let (_, robot) = load_model(&arguments.model)?;
    let task = arguments.task;
    let control = config.task(task);
    let point = point(arguments, &config)?;
    let jump = JumpParameters::from_values(&point, control.f1_hz);
    let mut spec = control.trial(task, jump);
    if let Some(duration_s) = arguments.duration {
        if jump.f1_hz <= 0.0 {
            let message = "--duration: jumps in a row need f1, the frequency between impulses; give it in --point or control.toml";
            return Err(Failure::input(message));
        }
        spec.jumps = jump.within(duration_s);
        spec.duration_s = duration_s;
    }
    let variants = if arguments.vmc.is_empty() { vec![spec.vmc] } else { arguments.vmc.clone() };
    let settings = config.settings(&robot, task, Backend::Simulator)?;
    let specs: Vec<TrialSpec> = variants
        .iter()
        .flat_map(|&vmc| arguments.seeds.0.iter().map(move |&seed| TrialSpec { vmc, seed: u64::from(seed), ..spec }))
        .collect();
    let rollout = || -> Result<_, Failure> {
        Ok(Rollout::new(Simulator::new(&robot, &config.simulator).map_err(EngineError::from)?, &settings))
    };
    let runs = in_parallel(arguments::cores(), &specs, rollout, |rollout, spec| Ok(evaluate(rollout, spec)))?;
    if arguments.json {
        for (spec, run) in specs.iter().zip(&runs) {
            output::line(&line(spec, run).to_string());
        }
    }
    print_table(arguments.json, task, &point, &robot, &variants, &specs, &runs);
    Ok(())
}

/// Returns the point of the arguments, else that of the configuration; parameters that the task does not optimize may be given.
fn point(arguments: &EvaluateArguments, config: &Config) -> Result<ParameterValues, Failure> {
    let task = arguments.task;
    match arguments.point.as_deref() {
        Some("best") => best(arguments.config.as_deref(), task, config),
        Some(text) => {
            let known: Vec<&String> = config.optimize.bounds.keys().collect();
            let mut values = Vec::new();
            for part in text.split(',') {
                let (name, value) = part.split_once('=').ok_or_else(|| {
                    Failure::input(format!("--point {text}: `{part}` is not NAME=VALUE; write it as f0=1.3,Fx=40"))
                })?;
                let name = name.trim();
                let number = value.trim().parse::<f64>().ok().filter(|number| number.is_finite());
                let number =
                    number.ok_or_else(|| Failure::input(format!("--point: {name} = {value} is not a number")))?;
                let Some([least, most]) = config.safety.parameters.get(name).copied() else {
                    return Err(Failure::input(format!("--point: there is no parameter {name}; there are {known:?}")));
                };
                if !(least..=most).contains(&number) || (name == "f0" && number <= 0.0) {
                    let message =
                        format!("--point: {name} = {number} is outside the limits {least} to {most} of safety.toml");
                    return Err(Failure::input(message));
                }
                values.push((name.to_owned(), number));
            }
            if !values.iter().any(|(name, _)| name == "f0") {
                return Err(Failure::input(format!("--point {text}: f0 is missing, the frequency of the impulse")));
            }
            Ok(values.into())
        }
        None => {
            let first = config.first(task);
            if first.is_empty() {
                let message = format!(
                    "there is no point: give --point f0=..,Fx=..,Fz=.. or a configuration with [first.{}] in optimize.toml",
                    task.name()
                );
                return Err(Failure::input(message));
            }
            Ok(first)
        }
    }
}

/// Returns the parameters of the best trial of the study in `config` or in the folder that holds it.
fn best(folder: Option<&Path>, task: Task, config: &Config) -> Result<ParameterValues, Failure> {
    let folders = folder.into_iter().flat_map(|folder| [Some(folder), folder.parent()]).flatten();
    let files: Vec<PathBuf> = folders.map(|folder| folder.join(STUDY_FILE)).collect();
    let Some(file) = files.iter().find(|file| file.is_file()) else {
        let message = "--point best: no study beside the configuration; give --config STUDY/config";
        return Err(Failure::input(message));
    };
    let opened = open_stored(&Storage::File(file.clone()), None, config)?;
    if opened.ours.as_ref().is_some_and(|study| study.task != task) {
        return Err(Failure::input(format!("--point best: {} is not a study of {}", file.display(), task.name())));
    }
    let best = opened
        .study
        .best()
        .ok_or_else(|| Failure::input(format!("--point best: {} has no trial that landed", file.display())))?;
    Ok(best.parameters.clone().into())
}

/// Returns one run as a line of JSON.
fn line(spec: &TrialSpec, run: &EvaluatedRun) -> serde_json::Value {
    let cause = (!run.stood() || run.bounced()).then_some(&run.cause);
    json!({
        "variant": { "vmc": on_off(spec.vmc) },
        "seed": run.seed,
        "fell": !run.stood(),
        "cause": cause,
        "fall_time_s": run.fall_time_s,
        "jumps": run.jumps,
        "value": run.value,
        "measured": run.measured,
        "tilt_at_impulse_rad": run.tilt_at_impulse_rad,
        "roll_range_rad": run.roll_range_rad,
        "pitch_range_rad": run.pitch_range_rad,
    })
}

fn on_off(vmc: bool) -> &'static str {
    if vmc { "on" } else { "off" }
}

/// Prints a row per variant and the causes of its falls.
fn print_table(
    to_error: bool,
    task: Task,
    point: &ParameterValues,
    robot: &RobotDescription,
    variants: &[bool],
    specs: &[TrialSpec],
    runs: &[EvaluatedRun],
) {
    let rate = specs.first().is_some_and(|spec| spec.rate);
    let mut text = format!("{} of the {}, ", task.name(), robot.name);
    let values: Vec<String> = point.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
    text += &format!("{}, {} jumps\n", values.join(", "), specs.first().map_or(0, |spec| spec.jumps));
    text += &format!(
        "vmc  runs falls  jumps  value{}, {:<5}    tilt  roll range  pitch range, rad\n",
        if rate { "         " } else { " per jump" },
        task.objective_unit(rate)
    );
    for &vmc in variants {
        let runs: Vec<&EvaluatedRun> =
            specs.iter().zip(runs).filter(|(spec, _)| spec.vmc == vmc).map(|(_, run)| run).collect();
        let stood: Vec<&&EvaluatedRun> = runs.iter().filter(|run| run.stood()).collect();
        let mean = |value: fn(&EvaluatedRun) -> f64| {
            stood.iter().map(|run| value(run)).sum::<f64>() / stood.len().max(1) as f64
        };
        let value = mean(|run| run.value);
        let spread = stood.iter().map(|run| (run.value - value).powi(2)).sum::<f64>();
        let spread = (spread / stood.len().saturating_sub(1).max(1) as f64).sqrt();
        let jumps = runs.iter().map(|run| f64::from(run.jumps)).sum::<f64>() / runs.len().max(1) as f64;
        let tilt = runs.iter().map(|run| run.tilt_at_impulse_rad).sum::<f64>() / runs.len().max(1) as f64;
        let counts = format!("{:<4} {:>4} {:>5}  {jumps:>5.1}", on_off(vmc), runs.len(), runs.len() - stood.len());
        let (roll, pitch) = (mean(|run| run.roll_range_rad), mean(|run| run.pitch_range_rad));
        text += &match stood.is_empty() {
            true => format!("{counts}  {:>7} {:>12}  {tilt:>7.3}  {:>10}  {:>11}\n", "-", "", "-", "-"),
            false => format!("{counts}  {value:>7.3} (std {spread:.3})  {tilt:>7.3}  {roll:>10.3}  {pitch:>11.3}\n"),
        };
        for run in runs.iter().filter(|run| !run.stood() || run.bounced()) {
            let time = run.fall_time_s.map_or(String::new(), |time| format!(" at {time:.2} s"));
            text += &format!("     seed {}: {}{time}\n", run.seed, run.cause);
        }
    }
    if to_error { output::message(&text) } else { output::text(&text) }
}
