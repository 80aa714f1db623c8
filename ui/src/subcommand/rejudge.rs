//! `quadfrog rejudge`: objective and fall detection of another configuration on recorded ticks, old beside new.

use std::path::PathBuf;

use clap::Args;
use quadfrog::config::Config;
use quadfrog::recording::player::Played;
use quadfrog::recording::session_files::recordings_of;
use quadfrog::recording::timeline::Timeline;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::rejudge::{Judgement, rejudge};
use quadfrog::telemetry::Tick;
use quadfrog::trial::{JumpParameters, ObjectiveRule, TrialRecord, Verdict};
use quadfrog_console::put_line;
use serde_json::{Value, json};

use super::failure::Failure;

#[derive(Debug, Args)]
pub struct RejudgeArguments {
    /// Recordings (session.mcap) or the folder of a study; they are not changed
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Folder with the configuration to judge by, for example examples/hardware_like or a study's config; without: the defaults
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Print one JSON object per trial instead of the table
    #[arg(long)]
    json: bool,
}

/// A trial with its old and its new judgement.
struct Rejudged {
    trial: u32,
    old: Judgement,
    new: Judgement,
}

pub fn run(arguments: &RejudgeArguments) -> Result<(), Failure> {
    let config = Config::load(arguments.config.as_deref())?;
    let mut files = Vec::new();
    for path in &arguments.files {
        files.extend(recordings_of(path)?);
    }
    let mut recording = Timeline::open(&files)?;
    let info = recording.session().clone();
    let (Some(task), Some(backend)) = (info.task, info.backend) else {
        return Err(Failure::input("the recording names a task or a backend that this version does not know"));
    };
    let robot = RobotDescription::embedded(&info.robot).map_err(Failure::input)?;
    let settings = config.settings(&robot, task, backend)?;
    let control = config.task(task);
    let rows = recording.rows();
    let rule = |row: &TrialRecord| {
        let jump = JumpParameters::from_values(&row.parameters, control.f1_hz);
        ObjectiveRule { jumps: control.jumps(&jump), ..control.trial(task, jump).objective() }
    };
    let mut results: Vec<Rejudged> = Vec::new();
    let mut ticks: Vec<Tick> = Vec::new();
    let mut judge = |ticks: &mut Vec<Tick>| {
        if let Some(row) = ticks.first().and_then(|tick| rows.get(&tick.trial?)).filter(|row| row.suggested.is_some()) {
            let new = rejudge(row, ticks, &rule(row), &settings);
            // Of several runs of a trial the last one has the row.
            results.retain(|known| known.trial != row.trial);
            results.push(Rejudged { trial: row.trial, old: Judgement::of(row), new });
        }
        ticks.clear();
    };
    for played in recording.by_ref() {
        let Played::Tick(tick) = played else { continue };
        if ticks.first().is_some_and(|first| first.trial != tick.trial) {
            judge(&mut ticks);
        }
        if tick.trial.is_some() {
            ticks.push(tick);
        }
    }
    judge(&mut ticks);
    for result in &results {
        if arguments.json {
            put_line!("{}", json_of(result));
        }
    }
    if !arguments.json {
        print(&results, task.objective_unit(control.rate));
    }
    match recording.damage() {
        damage if damage.is_empty() => Ok(()),
        damage => Err(anyhow::anyhow!("{}; the trials in it are not complete", damage.join("\n")).into()),
    }
}

fn name(verdict: Option<Verdict>) -> &'static str {
    verdict.map_or("?", Verdict::name)
}

fn print(results: &[Rejudged], unit: &str) {
    put_line!(
        "{:>5}  {:>10}  {:<7}  {:>10}  {:<7}  {:>11}  cause",
        "trial",
        "old J",
        "old",
        "new J",
        "new",
        "difference"
    );
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    for result in results {
        let Rejudged { trial, old, new } = result;
        let difference =
            result.new.difference(&result.old).map_or("-".to_owned(), |difference| format!("{difference:+.4}"));
        let (old_value, new_value) = (number(old.value()), number(new.value()));
        let (old_name, new_name, cause) = (name(old.verdict), name(new.verdict), &new.cause);
        put_line!(
            "{trial:>5}  {old_value:>10}  {old_name:<7}  {new_value:>10}  {new_name:<7}  {difference:>11}  {cause}"
        );
    }
    let changed = results.iter().filter(|result| result.new.differs(&result.old)).count();
    put_line!(
        "{changed} of {} trials change. J in {unit}, as measured, before the verdict; a fall counts as 0.",
        results.len()
    );
}

fn json_of(result: &Rejudged) -> Value {
    let judgement = |judgement: &Judgement| {
        json!({
            "value": judgement.value(),
            "verdict": judgement.verdict.map(Verdict::name),
            "cause": judgement.cause,
            "measured": judgement.measured,
        })
    };
    let Rejudged { trial, old, new } = result;
    json!({ "trial": trial, "old": judgement(old), "new": judgement(new), "difference": result.new.difference(&result.old) })
}
