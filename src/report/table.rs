//! The trial table as text.

use std::collections::HashMap;
use std::fmt::Write;

use crate::optimize::study::ModelBest;
use crate::optimize::trial::Trial;
use crate::printable::printable;
use crate::trial::{
    JudgedBy, JumpRow, ParameterInfo, ParameterValues, ProposalSource, ProposedParameter, TrialRecord, Verdict,
    counted, four_digits, parameter_unit, six_digits,
};

/// One trial as a line: number, parameters with their units, value, verdict with its cause.
pub fn line(row: &TrialRecord, unit: &str, units: &HashMap<String, String>) -> String {
    format!("trial {:>3}{}", row.trial, after_number(row, unit, units))
}

/// The part of [`line()`] behind the number.
fn after_number(row: &TrialRecord, unit: &str, units: &HashMap<String, String>) -> String {
    let mut text = String::new();
    for (name, value) in &row.parameters {
        let of = units.get(name).map_or("", String::as_str);
        let _ = write!(text, "  {} {} {of}", printable(name), parameter_value(*value, of));
    }
    if let Some(value) = row.value.filter(|_| row.verdict == Some(Verdict::Accept)) {
        let _ = write!(text, "  {value:.3} {unit}");
    }
    text + "  " + &verdict(row)
}

/// The best trial as a line, with what the sampler's model says of it and its gains that differ from `configured`, the newest
/// configuration, or a line about its absence.
pub fn best_line(
    best: Option<&TrialRecord>,
    model: Option<ModelBest>,
    configured: &ParameterValues,
    unit: &str,
    units: &HashMap<String, String>,
) -> String {
    let Some(best) = best else { return "No trial was accepted.\n".to_owned() };
    let mut text = format!("Best: trial {}{}\n", best.trial, after_number(best, unit, units));
    if let Some(ModelBest { predicted, predicted_deviation, .. }) = model.filter(|model| model.trial == best.trial) {
        let _ = writeln!(
            text,
            "      best by the sampler's model, which averages over luck: mean {predicted:.3} {unit}, deviation {predicted_deviation:.3} {unit}"
        );
    }
    let other_gains = best.other_gains(configured);
    if !other_gains.is_empty() {
        let _ = writeln!(text, "      {other_gains}");
    }
    text
}

/// The trial from which the present bounds of a parameter hold, and the bounds before; none where they were not changed.
pub fn changed_bounds(parameter: &ParameterInfo, rows: &[TrialRecord]) -> Option<String> {
    let drawn = |row: &TrialRecord| {
        let range = row.ranges.iter().find(|range| range.name == parameter.name)?;
        Some((range.low, range.high))
    };
    let is_present = |range: &(f64, f64)| *range == (parameter.low, parameter.high);
    let last = rows.iter().rposition(|row| drawn(row).is_some_and(|range| !is_present(&range)))?;
    let (low, high) = drawn(&rows[last])?;
    let since = rows[last + 1..].iter().find(|row| drawn(row).is_some());
    let since = since.map_or("for the next trial".to_owned(), |row| format!("since trial {}", row.trial));
    Some(format!("{since}; before, {} to {}", six_digits(low), six_digits(high)))
}

/// Verdict of a trial, whether its value is by hand, and the cause of a verdict other than a suggested accept.
fn verdict(row: &TrialRecord) -> String {
    let Some(name) = row.verdict_name() else { return "not judged".to_owned() };
    let by_hand = if row.counts_by_hand() { ", J by hand" } else { "" };
    let explained = row.verdict != Some(Verdict::Accept) || row.is_overruled();
    let cause = if explained && !row.cause.is_empty() { format!(": {}", row.cause) } else { String::new() };
    format!("{name}{by_hand}{cause}")
}

/// The origins of the verdicts as a line, `Judged by the operator: trials 0 to 2, 4; by a rule of the program: trial 3`; empty where no
/// verdict has one.
pub fn origins(rows: &[TrialRecord]) -> String {
    let of = |by: JudgedBy, words: &str| {
        let trials: Vec<u32> = rows.iter().filter(|row| row.judged_by == Some(by)).map(|row| row.trial).collect();
        let plural = if trials.len() == 1 { "" } else { "s" };
        (!trials.is_empty()).then(|| format!("by {words}: trial{plural} {}", ranges(&trials)))
    };
    let origins = [of(JudgedBy::Operator, "the operator"), of(JudgedBy::Rule, "a rule of the program")];
    let origins: Vec<String> = origins.into_iter().flatten().collect();
    if origins.is_empty() { String::new() } else { format!("Judged {}\n", origins.join("; ")) }
}

/// The numbers of trials with parameters or gains that an operator has set, as [`overrides`] lists them, of re-runs and of queued
/// points, without those that did not run; empty without any.
pub fn interventions(rows: &[TrialRecord]) -> String {
    let count = |of: fn(&TrialRecord) -> bool| rows.iter().filter(|row| of(row) && !row.was_not_run()).count();
    // An older version did not keep what was proposed.
    let is_set = |row: &TrialRecord| row.source == ProposalSource::Operator || !row.overrides().is_empty();
    let changed = count(is_set);
    let reruns = count(|row| row.source == ProposalSource::Rerun);
    let queued = count(|row| row.source == ProposalSource::Queued && row.overrides().is_empty());
    if changed + reruns + queued == 0 {
        return String::new();
    }
    let (changed, reruns) = (counted(changed, "trial"), counted(reruns, "re-run"));
    let queued = if queued == 0 { String::new() } else { format!(", {}", counted(queued, "queued point")) };
    format!("{changed} with parameters or gains that an operator has set, {reruns}{queued}")
}

/// A line for each trial that ran with values in place of the proposed ones, `Trial 3 ran with Fx 100 N, proposed 63.55 N`.
pub fn overrides(rows: &[TrialRecord]) -> String {
    let mut text = String::new();
    for row in rows {
        let value = |p: &ProposedParameter| {
            let unit = parameter_unit(&p.name);
            format!("{} {} {unit}, proposed {} {unit}", p.name, four_digits(p.value), four_digits(p.proposed))
        };
        let values: Vec<String> = row.overrides().iter().map(value).collect();
        if !values.is_empty() {
            let ran = if row.was_not_run() { "was set to" } else { "ran with" };
            let _ = writeln!(text, "Trial {} {ran} {}", row.trial, values.join("; "));
        }
    }
    text
}

/// Ascending numbers in words, three or more in a row by the first and the last: `0 to 2, 4, 5`.
fn ranges(numbers: &[u32]) -> String {
    let runs = numbers.chunk_by(|a, b| *b == a + 1).map(|run| match run {
        [first, .., last] if run.len() > 2 => format!("{first} to {last}"),
        run => run.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
    });
    runs.collect::<Vec<_>>().join(", ")
}

/// The trials of a study of another program as an aligned table, with parameters of every kind; the trial of number `best`
/// has an asterisk.
pub fn other_program(trials: &[Trial], best: Option<u32>) -> String {
    let mut names: Vec<String> = Vec::new();
    for (name, _) in trials.iter().flat_map(Trial::external_parameters) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut lines = vec![[&["trial".to_owned()][..], &names, &["value", "state"].map(str::to_owned)].concat()];
    for trial in trials {
        let asterisk = if best == Some(trial.number) { "*" } else { "" };
        let mut cells = vec![format!("{asterisk}{}", trial.number)];
        let parameters = trial.external_parameters();
        cells.extend(names.iter().map(|name| {
            let value = parameters.iter().find(|(of, _)| of == name).map(|(_, value)| value);
            value
                .map_or_else(|| "-".to_owned(), |value| value.as_str().map_or_else(|| value.to_string(), str::to_owned))
        }));
        cells.push(trial.value.map_or_else(|| "-".to_owned(), |value| value.to_string()));
        cells.push(<&str>::from(trial.state).to_lowercase());
        lines.push(cells);
    }
    let columns = names.len() + 3;
    aligned(&lines, |column| column + 1 == columns)
}

/// All trials as an aligned table; the trial of number `best` has an asterisk.
pub fn table(rows: &[TrialRecord], best: Option<u32>, parameters: &[ParameterInfo], unit: &str) -> String {
    let mut header: Vec<String> = vec!["trial".into()];
    header.extend(parameters.iter().map(|p| format!("{} ({})", p.name, p.unit)));
    // A sampler without a model expects nothing.
    let expects = rows.iter().any(|row| row.expected.is_some());
    if expects {
        header.extend([format!("expected ({unit})"), "stands (%)".to_owned()]);
    }
    header.extend([format!("J ({unit})"), "rise (m)".into(), "air (s)".into(), "source".into(), "verdict".into()]);
    let columns = header.len();
    let mut lines = vec![header];
    for row in rows {
        let asterisk = if best == Some(row.trial) { "*" } else { "" };
        let mut cells = vec![format!("{asterisk}{}", row.trial)];
        for parameter in parameters {
            let value = row.parameters.get(&parameter.name);
            cells.push(value.map_or_else(String::new, |value| parameter_value(value, &parameter.unit)));
        }
        if expects {
            let cell = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
            cells.push(cell(row.expected.map(|expected| format!("{:.3}", expected.value))));
            cells.push(cell(row.expected.map(|expected| format!("{:.0}", 100.0 * expected.p_stand))));
        }
        let measured = row.measured.as_ref();
        let numbers = [row.value, measured.map(|measured| measured.apex_m), measured.map(|measured| measured.air_s)];
        cells.extend(numbers.map(|number| number.map_or_else(|| "-".into(), |number| format!("{number:.3}"))));
        cells.extend([row.origin(), verdict(row)]);
        lines.push(cells);
    }
    aligned(&lines, |column| column + 2 >= columns)
}

/// The jumps of a trial as an aligned table; `unit` is that of the task's displacement or turn.
pub fn jumps(rows: &[JumpRow], unit: &str) -> String {
    let header = ["jump", "start (s)", "x (m)", "y (m)", "yaw (rad)", "tilt (rad)", "rise (m)", "air (s)"];
    let mut lines = vec![header.map(str::to_owned).to_vec()];
    lines[0].push(format!("value ({unit})"));
    for (index, row) in rows.iter().enumerate() {
        let JumpRow { time_s, x_m, y_m, yaw_rad, tilt_rad, rise_m, air_s, value } = *row;
        let numbers = [time_s, x_m, y_m, yaw_rad, tilt_rad, rise_m, air_s, value];
        let mut cells = vec![(index + 1).to_string()];
        cells.extend(numbers.map(|number| format!("{number:.3}")));
        lines.push(cells);
    }
    aligned(&lines, |_| false)
}

/// Lines of equally many cells in columns; texts are left-aligned, numbers right-aligned.
pub fn aligned(lines: &[Vec<String>], is_text: impl Fn(usize) -> bool) -> String {
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..lines.first().map_or(0, Vec::len)).map(width).collect();
    let mut text = String::new();
    for line in lines {
        for (column, cell) in line.iter().enumerate() {
            let width = widths[column];
            text += &if is_text(column) { format!("{cell:<width$}  ") } else { format!("{cell:>width$}  ") };
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

/// A parameter's value as text, by its unit; of another program, without a unit, with six significant digits.
fn parameter_value(value: f64, unit: &str) -> String {
    match unit {
        "" => six_digits(value),
        "Hz" => format!("{value:.3}"),
        _ => format!("{value:.1}"),
    }
}
