//! A trial in words and numbers: the details dialog, the row for the clipboard, the exported tables.
//!
//! ```text
//! verdict        accept
//! objective told 0.6420 m
//! f0             1.24300 Hz  (0.75 to 1.75)
//! ```

use quadfrog::trial::{TrialRecord, Verdict};

use super::{clock, points, proposal};
use crate::model::Model;

/// Cause and note on one line.
pub fn remark(trial: &TrialRecord) -> String {
    match (trial.cause.as_str(), trial.note.as_str()) {
        (cause, "") => cause.to_owned(),
        ("", note) => format!("| {note}"),
        (cause, note) => format!("{cause} | {note}"),
    }
}

/// Which attempt at the same parameters a trial is: 1, or one more than the trial that it repeats.
pub fn attempt(model: &Model, trial: &TrialRecord) -> usize {
    // Parents are older than their children, so the walk ends.
    let parent = |t: &&TrialRecord| t.parent.filter(|parent| *parent < t.trial).and_then(|p| model.trials.get(&p));
    std::iter::successors(Some(trial), parent).count()
}

/// All about one trial, one thing in a line.
pub fn details(model: &Model, trial: &TrialRecord) -> Vec<(String, String)> {
    let unit = &model.session.unit;
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    let verdict = trial.verdict.map_or("not judged".to_owned(), |verdict| verdict.name().to_owned());
    row("verdict", verdict);
    if let Some(suggested) = trial.suggested {
        let cause = if trial.cause.is_empty() { String::new() } else { format!(": {}", trial.cause) };
        row("the rules said", format!("{}{cause}", suggested.name()));
    }
    row("objective told", trial.value.map_or("none".to_owned(), |value| format!("{value:.4} {unit}")));
    if let Some(value) = trial.hand_value {
        row("by hand", format!("{value:.4} {unit}"));
    }
    if let Some(value) = proposal::objective(model, &TrialRecord { value: None, ..trial.clone() }) {
        row("measured", format!("{value:.4} {unit}"));
    }
    let source = trial.parent.map_or(String::new(), |parent| format!(" of trial {parent}"));
    row("source", format!("{}{source}", trial.source.name()));
    row("attempt", attempt(model, trial).to_string());
    if let Some(repeats) = points::repeats_of(model, trial.trial) {
        row("repeats", repeats);
    }
    if let Some(ran) = model.ran.get(&trial.trial) {
        let took = ran.ended_ns.map_or("still runs".to_owned(), |ended| {
            format!("took {:.1} s", ended.saturating_sub(ran.begun_ns) as f64 / 1e9)
        });
        row("ran", format!("at {} of the session, {took}", clock(ran.begun_ns)));
    }
    for (name, value) in &trial.parameters {
        let info = model.parameter(name);
        let unit = info.as_ref().map_or("", |info| info.unit.as_str());
        let bounds = info.as_ref().map_or(String::new(), |info| format!("  ({} to {})", info.low, info.high));
        row(name, format!("{value:.5} {unit}{bounds}"));
    }
    if !trial.gains.is_empty() {
        let gain = |(name, value): &(String, f64)| format!("{name} {value}");
        row("gains", trial.gains.iter().map(gain).collect::<Vec<_>>().join(", "));
    }
    if let Some(m) = trial.measured {
        row("displacement", format!("{:+.4} m forward, {:+.4} m left", m.dx_m, m.dy_m));
        row("turn", format!("{:+.4} rad", m.dyaw_rad));
        row("apex, air", format!("{:.4} m, {:.3} s", m.apex_m, m.air_s));
    }
    if let Some(risk) = trial.risk.filter(|risk| risk.neighbours > 0) {
        let nearest = match (risk.nearest_fall_trial, risk.nearest_fall) {
            (Some(trial), Some(distance)) => format!("; nearest fall #{trial} at {distance:.3}"),
            _ => String::new(),
        };
        row("risk before", format!("{} of the {} nearest fell{nearest}", risk.falls, risk.neighbours));
    }
    if !trial.note.is_empty() {
        row("note", trial.note.clone());
    }
    rows
}

/// A trial as one line of text, for the clipboard.
pub fn as_text(trial: &TrialRecord, model: &Model) -> String {
    let mut text = format!("trial {}", trial.trial);
    for (name, value) in &trial.parameters {
        text.push_str(&format!("\t{name}={value}"));
    }
    let value = trial.value.map_or("-".to_owned(), |value| value.to_string());
    let verdict = trial.verdict.map_or("-", Verdict::name);
    text.push_str(&format!(
        "\tJ={value} {}\t{verdict}\t{}\t{}",
        model.session.unit,
        trial.source.name(),
        remark(trial)
    ));
    text
}

/// The names of the exported columns and the rows of the table as shown.
fn export_cells(model: &Model) -> (Vec<String>, Vec<Vec<String>>) {
    let mut names = vec!["trial".to_owned()];
    names.extend(model.session.parameters.iter().map(|info| info.name.clone()));
    let rest = ["value", "hand_value", "verdict", "suggested", "cause", "source", "parent", "attempt"];
    names.extend(rest.map(str::to_owned));
    names.extend(["dx_m", "dy_m", "dyaw_rad", "apex_m", "air_s", "note"].map(str::to_owned));
    let optional = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let row = |trial: &&TrialRecord| {
        let mut cells = vec![trial.trial.to_string()];
        for info in &model.session.parameters {
            cells.push(optional(trial.parameters.get(&info.name)));
        }
        cells.extend([
            optional(trial.value),
            optional(trial.hand_value),
            trial.verdict.map_or("", Verdict::name).to_owned(),
            trial.suggested.map_or("", Verdict::name).to_owned(),
            trial.cause.clone(),
            trial.source.name().to_owned(),
            trial.parent.map(|parent| parent.to_string()).unwrap_or_default(),
            attempt(model, trial).to_string(),
        ]);
        let m = trial.measured;
        cells.extend([
            optional(m.map(|m| m.dx_m)),
            optional(m.map(|m| m.dy_m)),
            optional(m.map(|m| m.dyaw_rad)),
            optional(m.map(|m| m.apex_m)),
            optional(m.map(|m| m.air_s)),
            trial.note.clone(),
        ]);
        cells
    };
    (names, model.table().iter().map(row).collect())
}

/// The table as shown, as comma-separated values (RFC 4180).
pub fn as_csv(model: &Model) -> String {
    let (names, rows) = export_cells(model);
    let quote = |cell: &String| {
        if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.clone() }
    };
    let line = |cells: &Vec<String>| cells.iter().map(quote).collect::<Vec<_>>().join(",") + "\r\n";
    std::iter::once(&names).chain(&rows).map(line).collect()
}

/// The table as shown, as a Markdown table.
pub fn as_markdown(model: &Model) -> String {
    let (names, rows) = export_cells(model);
    let line = |cells: &Vec<String>| {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|").replace('\n', " ")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let ruler = format!("|{}\n", " --- |".repeat(names.len()));
    line(&names) + &ruler + &rows.iter().map(line).collect::<String>()
}
