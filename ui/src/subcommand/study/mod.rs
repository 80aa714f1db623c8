//! `quadfrog study`: stored studies, of this program and of other Optuna programs.

mod selector;
mod tables;

use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::{notice, output};
use clap::{Args, Subcommand};
use quadfrog::config::Config;
use quadfrog::engine::{Opened, STUDY_FILE, StoredStudy, named_studies, running_session, study_files};
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::{CHANGED_VERDICT, Trial};
use quadfrog::printable::shell_word;
use quadfrog::report::columns::TableFormat;
use quadfrog::report::table;
use quadfrog::session::experiment::{self, CHANGED_PREFIX, fixed_in_words, rows_of};
use quadfrog::trial::{ParameterInfo, ParameterValues, TrialRecord, Verdict, counted, six_digits};
use serde_json::Value;

use super::failure::Failure;
use super::selection::parse_storage;
use super::table::{read_table_format, table_format};

use selector::{StudySelector, until_continued};
use tables::{QueuedRows, export, import};

#[derive(Debug, Args)]
pub struct StudyCommand {
    #[command(subcommand)]
    command: StudySubcommand,
}

#[derive(Debug, Subcommand)]
enum StudySubcommand {
    /// List the studies in a folder and directly below it: task, trials, those that count, their falls, best
    List {
        /// The folder
        #[arg(value_name = "DIR", default_value = "recordings")]
        folder: PathBuf,
    },
    /// Show a study: its attributes, parameters and trials
    Show {
        #[command(flatten)]
        study: StudySelector,
    },
    /// Export all trials as a table with the columns of Optuna's trials_dataframe
    ///
    /// A trial is complete once its verdict cannot be taken back: with the approval of the next one, or at the end of the session. The
    /// column `duration` is the time from its approval to then, with the operator's pauses. Times are UTC.
    Export {
        #[command(flatten)]
        study: StudySelector,
        /// Format of the table [default: by the file's name; csv on standard output]
        #[arg(long, value_name = "FORM", value_parser = table_format())]
        format: Option<TableFormat>,
        /// Output file, *.csv, *.json or *.parquet [default: standard output]
        #[arg(long, short, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Add the trials of a table, written by `study export` or Optuna's trials_dataframe, as finished trials
    ///
    /// The study must exist. A console that is quit without a jump (key `q`) leaves an empty one.
    Import {
        #[command(flatten)]
        study: StudySelector,
        /// The table
        #[arg(value_name = "FILE")]
        table: PathBuf,
        /// Format of the table [default: by the file's name, else csv]
        #[arg(long, value_name = "FORM", value_parser = read_table_format())]
        format: Option<TableFormat>,
        /// Queue the points to be run instead: those of all rows, whose results are ignored, or of those that waited in a queue
        #[arg(long, value_name = "WHICH", num_args = 0..=1, require_equals = true, default_missing_value = "all")]
        queue: Option<QueuedRows>,
    },
    /// Show the best trial
    Best {
        #[command(flatten)]
        study: StudySelector,
        /// Write a configuration into this folder with which the next study starts at the best: quadfrog --config DIR
        #[arg(long, value_name = "DIR")]
        config: Option<PathBuf>,
    },
    /// Queue a point: it is proposed after those that are queued already, also by a running session
    Enqueue {
        #[command(flatten)]
        study: StudySelector,
        /// Parameters; omitted ones are proposed when the point is run
        #[arg(value_name = "PARAM=VALUE", required = true, value_parser = parse_setting)]
        point: Vec<(String, f64)>,
    },
}

fn parse_setting(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write it as NAME=NUMBER, for example Fx=120")?;
    let number = value.trim().parse::<f64>().map_err(|_| format!("`{value}` is not a number: {name}=NUMBER"))?;
    Ok((name.trim().to_owned(), number))
}

pub fn run(command: &StudyCommand) -> Result<(), Failure> {
    match &command.command {
        StudySubcommand::List { folder } => list(folder),
        StudySubcommand::Show { study } => show(study),
        StudySubcommand::Export { study, format, output } => export(study, *format, output.as_deref()),
        StudySubcommand::Import { study, table, format, queue } => import(study, table, *format, *queue),
        StudySubcommand::Best { study, config } => best(study, config.as_deref()),
        StudySubcommand::Enqueue { study, point } => enqueue(study, point),
    }
}

fn list(folder: &Path) -> Result<(), Failure> {
    let files = study_files(folder).map_err(|error| {
        let (cause, remedy) = match error.kind() {
            ErrorKind::NotFound => ("there is no such folder".to_owned(), "; the first session makes recordings"),
            _ => (error.to_string(), ""),
        };
        Failure::input(format!("{}: {cause}; give a folder that holds studies{remedy}", folder.display()))
    })?;
    if files.is_empty() {
        let folders = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let deeper = folders.filter(|folder| study_files(folder).is_ok_and(|files| !files.is_empty())).min();
        let hint = deeper
            .map_or(String::new(), |deeper| format!("; `quadfrog study list {}` finds some", shell_word(&deeper)));
        output::text(&format!("There is no study in {0} or directly below it{hint}\n", folder.display()));
        return Ok(());
    }
    let mut rows = vec![["study", "task", "seed", "trials", "counted", "falls", "best"].map(str::to_owned).to_vec()];
    let mut unlisted = 0;
    for file in &files {
        // A study that cannot be read is reported, and the others are listed.
        let studies = named_studies(&Storage::File(file.clone()));
        unlisted += usize::from(studies.is_err());
        for (name, ours) in studies.inspect_err(|error| notice!("{error}")).unwrap_or_default() {
            match list_row(file, name, ours.as_ref()) {
                Err(failure @ Failure::Input(_)) => {
                    failure.print();
                    unlisted += 1;
                }
                row => rows.push(row?),
            }
        }
    }
    // The console's folders name task and seed: the table fits a terminal of 80 columns without them.
    let named = |row: &Vec<String>| row[0].ends_with(&format!("-{}-seed{}", row[1], row[2]));
    let are_named = rows.iter().skip(1).all(named);
    if are_named {
        rows.iter_mut().for_each(|row| drop(row.drain(1..3)));
    }
    output::text(&table::aligned(&rows, |column| column == 0 || column == 1 && !are_named));
    match unlisted {
        0 => Ok(()),
        unlisted => Err(Failure::input(format!("studies that cannot be read and are not listed: {unlisted}"))),
    }
}

/// Returns the row of a study; `ours` is the description of one of this program.
fn list_row(file: &Path, name: String, ours: Option<&StoredStudy>) -> Result<Vec<String>, Failure> {
    let none = || "-".to_owned();
    let folder = file.parent().unwrap_or(file).display().to_string();
    let opened = match (StudySelector { place: file.display().to_string(), name: Some(name) }.open(), ours) {
        // With several objectives, or without a real number among its parameters.
        (Err(Failure::Input(_)), None) => return Ok([vec![folder], vec![none(); 6]].concat()),
        (opened, _) => opened?,
    };
    let all = opened.rows();
    let ran = all.iter().filter(|row| !row.was_not_run()).count();
    let counted = || all.iter().filter(|row| row.counts());
    let falls = counted().filter(|row| row.verdict == Some(Verdict::Fall)).count();
    let best = opened.best(&all).and_then(|row| row.value);
    Ok(vec![
        folder,
        ours.map_or_else(none, |ours| ours.task.name().to_owned()),
        ours.map_or_else(none, |ours| ours.seed.to_string()),
        ran.to_string(),
        counted().count().to_string(),
        ours.map_or_else(none, |_| falls.to_string()),
        best.map_or_else(none, |best| format!("{best:.3} {}", opened.unit()).trim_end().to_owned()),
    ])
}

/// Attributes that `show` writes as sentences, or that the table says: values of the sampler's model, confirmations, fixed
/// parameters.
const OWN_SENTENCES: [&str; 4] = ["confirm", "confirmed", "fixed", "model_best"];

/// Spaces before the rest of a line of `show` that is longer than a line of the terminal: the column behind the trial's number.
const CONTINUED_INDENT: usize = 7;

/// Returns the value of an attribute without the syntax of JSON; `between` separates the elements of a list.
fn in_words(value: &Value, between: &str) -> String {
    let join = |parts: &mut dyn Iterator<Item = String>, between: &str| parts.collect::<Vec<_>>().join(between);
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Object(members) if members.is_empty() => "none".to_owned(),
        Value::Array(list) => join(&mut list.iter().map(|value| in_words(value, between)), between),
        Value::Object(members) => {
            let given = members.iter().filter(|(_, value)| !value.is_null());
            join(&mut given.map(|(name, value)| format!("{name} {}", in_words(value, between))), ", ")
        }
        value => value.to_string(),
    }
}

fn show(selector: &StudySelector) -> Result<(), Failure> {
    let opened = selector.open()?;
    let Opened { study, ours, parameters, .. } = &opened;
    output::unbroken(&format!("{} in", study.options().name), &parse_storage(&selector.place).to_string());
    let mut text = String::new();
    // The causes of changed verdicts stand in the table; the values that are changed for the next trial are the console's.
    let own = |name: &str| ours.is_some() && (OWN_SENTENCES.contains(&name) || name.starts_with(CHANGED_PREFIX));
    let left_out = |name: &str, value: &Value| name.starts_with(CHANGED_VERDICT) || value.is_null() || own(name);
    for (name, value) in study.attributes().iter().filter(|(name, value)| !left_out(name, value)) {
        let (name, between) =
            if name == "bounds" { ("bounds changed by the operator", " to ") } else { (&name[..], " ") };
        let _ = writeln!(text, "  {name}: {}", in_words(value, between));
    }
    if ours.is_some() {
        for fixed in fixed_in_words(study) {
            let _ = writeln!(text, "  {fixed}");
        }
        if let Some(samplers) = experiment::samplers_in_words(study) {
            let _ = writeln!(text, "  proposed: {samplers}");
        }
        if let Some(confirmation) = opened.confirmation_in_words() {
            let _ = writeln!(text, "  confirmation of the best: {confirmation}");
        }
    }
    let rows = opened.rows();
    for parameter in parameters {
        let changed = table::changed_bounds(parameter, &rows).map_or(String::new(), |changed| format!(" ({changed})"));
        let ParameterInfo { name, low, high, unit, .. } = parameter;
        let _ = writeln!(text, "  {name} from {low} to {high} {unit}{changed}");
    }
    text.push('\n');
    let unit = if ours.is_some() { opened.unit() } else { "value" };
    let best = opened.best(&rows).map(|best| best.trial);
    text += &match ours {
        Some(_) => table::table(&rows, best, parameters, unit),
        None => table::other_program(study.trials(), best),
    };
    text += &table::origins(&rows);
    let interventions = table::interventions(&rows);
    if !interventions.is_empty() {
        let _ = writeln!(text, "{interventions}");
    }
    text += &table::overrides(&rows);
    let not_run = rows.iter().filter(|row| row.was_not_run()).count();
    if not_run > 0 {
        let proposals = counted(not_run, "proposal");
        let without_jump = rows.iter().filter(|row| !row.was_not_run() && row.did_not_jump()).count();
        let without_jump = if without_jump > 0 { format!(" ({without_jump} without a jump)") } else { String::new() };
        let ran = counted(rows.len() - not_run, "trial");
        let _ = writeln!(text, "{ran} that ran{without_jump}, {proposals} that did not");
    }
    for row in rows.iter().filter(|row| !row.note.is_empty()) {
        let _ = writeln!(text, "Note on trial {}: {}", row.trial, row.note);
    }
    for point in experiment::points_of_rows(rows.iter()).iter().filter(|point| point.repeats() > 1) {
        let trials = point.trials.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        let (stood, repeats, mean, std) =
            (point.without_fall, point.repeats(), point.mean(), point.deviation().unwrap_or(0.0));
        let line = format!("landed {stood}/{repeats}, mean {mean:.3} {unit}, std {std:.3}");
        let _ = writeln!(text, "Trials {trials} are one point: {line}");
    }
    let ended = session_has_ended(&parse_storage(&selector.place));
    // A void suggestion waits only as long as its session is there: without it the trial runs again.
    let suggested = |trial: &Trial| {
        rows.iter().any(|row| row.trial == trial.number && row.verdict.is_none() && row.suggested.is_some())
    };
    let unjudged = |trial: &&Trial| experiment::waits_for_verdict(trial) || !ended && suggested(trial);
    for trial in study.running().filter(unjudged) {
        let row = rows.iter().find(|row| row.trial == trial.number);
        let by_hand = row.and_then(|row| row.hand_value).map(|value| format!(", by hand {value:.3} {unit}"));
        let _ = writeln!(text, "Trial {} waits for its verdict{}", trial.number, by_hand.unwrap_or_default());
    }
    let undecided = |row: &&TrialRecord| row.verdict.is_none() && study.trial(row.trial).is_ok_and(|t| !unjudged(&t));
    let (interrupted, running): (Vec<&TrialRecord>, Vec<&TrialRecord>) = rows
        .iter()
        .filter(undecided)
        .partition(|row| ended && study.trial(row.trial).is_ok_and(experiment::is_of_folders_session));
    for row in &interrupted {
        let _ = writeln!(text, "Trial {} was interrupted: its session ended within it", row.trial);
    }
    let waiting = study.waiting().count();
    if running.len() + waiting > 0 {
        let _ = writeln!(text, "{} running, {waiting} queued", running.len());
        for queued in study.waiting() {
            let given = ParameterValues::from(queued.fixed());
            let value = |p: &ParameterInfo| Some(format!("{} {}", p.name, six_digits(given.get(&p.name)?)));
            let values: Vec<_> = parameters.iter().filter_map(value).collect();
            let _ = writeln!(text, "  #{} {}", queued.number, values.join(", "));
        }
    }
    text += &best_line(&selector.config()?, &opened, &rows);
    let jumps = opened.best(&rows).and_then(|best| best.measured.as_ref()).map(|measured| &measured.jumps);
    if let (Some(jumps), Some(ours)) = (jumps.filter(|jumps| jumps.len() > 1), ours) {
        text += &table::jumps(jumps, ours.task.unit());
    }
    output::wrapped_text(&text, CONTINUED_INDENT);
    Ok(())
}

/// Whether the storage is that of a study's folder in which no session runs.
fn session_has_ended(storage: &Storage) -> bool {
    let Storage::File(file) = storage else { return false };
    // Another file may be the journal of workers without a folder.
    let folder = file.parent().filter(|_| file.ends_with(STUDY_FILE));
    folder.is_some_and(|folder| running_session(folder).is_ok_and(|owner| owner.is_none()))
}

fn best_line(config: &Config, opened: &Opened, rows: &[TrialRecord]) -> String {
    let configured = opened.ours.as_ref().map(|ours| config.task(ours.task).gains().values()).unwrap_or_default();
    let units = opened.parameters.iter().map(|parameter| (parameter.name.clone(), parameter.unit.clone())).collect();
    table::best_line(opened.best(rows), opened.model_best(), &configured, opened.unit(), &units)
}

fn best(selector: &StudySelector, config: Option<&Path>) -> Result<(), Failure> {
    let opened = selector.open()?;
    let rows = rows_of(&opened.study, &opened.parameters);
    let Some(folder) = config else {
        output::text(&best_line(&selector.config()?, &opened, &rows));
        return Ok(());
    };
    let (Some(best), Some(ours)) = (opened.best(&rows), &opened.ours) else {
        return Err(Failure::input(format!("{}: no accepted trial of this program to export", selector.place)));
    };
    let config = selector.config()?;
    config.export(folder, ours.task, &best.parameters, &best.gains, &opened.parameters)?;
    let (text, task, folder) = (best_line(&config, &opened, &rows), ours.task.name(), shell_word(folder));
    output::text(&format!("{text}Start a new study with it:  quadfrog --task {task} --config {folder}\n"));
    Ok(())
}

fn enqueue(selector: &StudySelector, point: &[(String, f64)]) -> Result<(), Failure> {
    if let Some((name, _)) = point.iter().find(|(name, _)| point.iter().filter(|(n, _)| n == name).count() > 1) {
        return Err(Failure::input(format!("{name} is given twice")));
    }
    let mut opened = selector.open()?;
    let then = until_continued(selector, &opened);
    opened.study.check_point(point)?;
    let number = opened.study.enqueue(point, &[])?;
    output::text(&format!("Queued as trial {number}{then}\n"));
    Ok(())
}
