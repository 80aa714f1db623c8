//! `quadfrog study export` and `import`: the trials as a table.

use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::Path;

use anyhow::Context;
use clap::ValueEnum;
use quadfrog::optimize::exchange::{self, TableTrial};
use quadfrog::optimize::study::{StudyError, WaitingPoint};
use quadfrog::optimize::trial::{GAINS, TrialState};
use quadfrog::report::columns::{TableFormat, TableWriter};
use quadfrog::report::trial_columns;
use quadfrog::session::experiment;
use quadfrog::trial::counted;

use super::selector::{StudySelector, until_continued};
use crate::subcommand::failure::Failure;
use crate::subcommand::output_file::write_file;
use crate::subcommand::table::{format_of_name, written_format};
use crate::{notice, output};

/// The rows of a table that are queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum QueuedRows {
    /// All
    All,
    /// Those that were queued when the table was written
    Waiting,
}

/// Writes the trials to a file, or to standard output.
pub fn export(selector: &StudySelector, format: Option<TableFormat>, output: Option<&Path>) -> Result<(), Failure> {
    let format = written_format(format, output)?;
    let opened = selector.open()?;
    let study = &opened.study;
    let columns = trial_columns::of(study.trials(), study.metric_name(), |number| study.note_of(number));
    if let Some(path) = output {
        write_file(path, format.into(), |file| {
            let mut table = TableWriter::new(format, file, &columns)?;
            table.write(&columns)?;
            table.finish()
        })?;
        let not_run = opened.rows().iter().filter(|row| row.was_not_run()).count();
        let not_run = if not_run > 0 { format!(", {not_run} of them not run") } else { String::new() };
        let queued = study.waiting().count();
        let and_queued = if queued > 0 { format!(" and {}", counted(queued, "queued point")) } else { String::new() };
        let begun = counted(study.trials().len() - queued, "trial");
        notice!("{begun}{not_run}{and_queued}: {}", path.display());
        return Ok(());
    }
    let mut bytes = Vec::new();
    let mut table = TableWriter::new(format, &mut bytes, &columns).context("the table")?;
    table.write(&columns).context("the table")?;
    table.finish().context("the table")?;
    output::data(&String::from_utf8_lossy(&bytes));
    Ok(())
}

/// Adds the finished trials of a table, or queues its points.
pub fn import(
    selector: &StudySelector,
    table: &Path,
    format: Option<TableFormat>,
    queue: Option<QueuedRows>,
) -> Result<(), Failure> {
    let refuse = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", table.display()));
    let format = format.or_else(|| format_of_name(table)).unwrap_or(TableFormat::Csv);
    if format == TableFormat::Parquet {
        return Err(refuse(&"a Parquet table is not imported; convert it: pandas.read_parquet(...).to_csv(...)"));
    }
    if table.metadata().is_ok_and(|about| !about.is_file()) {
        return Err(refuse(&"it is not a regular file; give a table, *.csv or *.json"));
    }
    let text = std::fs::read_to_string(table).map_err(|error| match error.kind() {
        ErrorKind::NotFound => refuse(&"there is no such file; give a table, *.csv or *.json"),
        _ => refuse(&format!("it cannot be read: {error}")),
    })?;
    let trials = match format {
        TableFormat::Json => exchange::from_json(&text),
        _ => exchange::from_csv(&text),
    }
    .map_err(|error| refuse(&error))?;
    let mut opened = selector.open()?;
    let then = until_continued(selector, &opened);
    let study = &mut opened.study;
    // All or none: every row is checked before the first is added.
    let is_asked = |trial: &TableTrial| match queue {
        None => trial.state.is_finished(),
        Some(QueuedRows::All) => true,
        Some(QueuedRows::Waiting) => trial.state == TrialState::Waiting,
    };
    for (row, trial) in (1..).zip(&trials).filter(|(_, trial)| is_asked(trial)) {
        study.check_point(&trial.parameters).map_err(|error| {
            let remedy = match error {
                StudyError::Outside { .. } => "; widen them with `B` in the console, or leave the row out",
                _ => "",
            };
            refuse(&format!("row {row}: {error}{remedy}"))
        })?;
    }
    // A point that was removed from the queue has never run: its row has no parameters.
    let (trials, without_parameters): (Vec<TableTrial>, Vec<TableTrial>) =
        trials.into_iter().partition(|trial| !trial.parameters.is_empty());
    let left_out = match without_parameters.len() {
        0 => String::new(),
        rows => format!("; {} without parameters left out", counted(rows, "row")),
    };
    let (finished, unfinished): (Vec<TableTrial>, Vec<TableTrial>) =
        trials.into_iter().partition(|trial| trial.state.is_finished());
    if queue.is_none() {
        let given = finished.len();
        let added = experiment::import(study, finished).map_err(|error| match error {
            // Not the table's: the journal cannot be read or written.
            StudyError::Journal(_) => error.into(),
            error => refuse(&error),
        })?;
        let added = added.len();
        let mut text = format!("{} imported", counted(added, "trial"));
        if given > added {
            let _ = write!(text, "; {} were there already (same parameters, value and times)", given - added);
        }
        if !unfinished.is_empty() {
            let waited = unfinished.iter().filter(|trial| trial.state == TrialState::Waiting).count();
            let queue = if waited > 0 { format!(", --queue=waiting queues {waited}") } else { String::new() };
            let _ = write!(text, "; {} ignored{queue}", counted(unfinished.len(), "unfinished trial"));
        }
        output::text(&(text + &left_out + "\n"));
        return Ok(());
    }
    let points: Vec<WaitingPoint> =
        finished.into_iter().chain(unfinished).filter(is_asked).map(waiting_point).collect();
    study.enqueue_all(&points)?;
    output::text(&format!("{} queued{left_out}{then}\n", counted(points.len(), "point")));
    Ok(())
}

/// Returns the point of a row to queue: its parameters, and its gains where it has some.
fn waiting_point(row: TableTrial) -> WaitingPoint {
    let gains = row.attributes.get(GAINS).filter(|gains| gains.is_object()).cloned();
    (row.parameters, gains.map(|gains| (GAINS.to_owned(), gains)).into_iter().collect())
}
