//! The trial table as text.

use std::collections::HashMap;
use std::fmt::Write;

use crate::trial::{ParameterInfo, TrialRecord, Verdict};

/// One trial as a line: number, parameters with their units, value, verdict with its cause.
pub fn line(row: &TrialRecord, unit: &str, units: &HashMap<String, String>) -> String {
    let mut text = format!("trial {:>3}", row.trial);
    for (name, value) in &row.parameters {
        let of = units.get(name).map_or("", String::as_str);
        let _ = write!(text, "  {name} {value:.*} {of}", digits(of));
    }
    let _ = write!(text, "  {}", outcome(row, unit));
    text
}

/// Value and verdict of a trial as text.
fn outcome(row: &TrialRecord, unit: &str) -> String {
    match (row.verdict, row.value) {
        (Some(Verdict::Accept), Some(value)) => format!("{value:.3} {unit}  accept"),
        (Some(verdict), _) if row.cause.is_empty() => verdict.name().to_owned(),
        (Some(verdict), _) => format!("{}: {}", verdict.name(), row.cause),
        (None, _) => "not judged".to_owned(),
    }
}

/// All trials as an aligned table; the best has an asterisk.
pub fn table(rows: &[TrialRecord], parameters: &[ParameterInfo], unit: &str) -> String {
    let mut header: Vec<String> = vec!["trial".into()];
    header.extend(parameters.iter().map(|p| format!("{} ({})", p.name, p.unit)));
    header.extend([format!("J ({unit})"), "rise (m)".into(), "air (s)".into(), "source".into(), "verdict".into()]);
    let accepted = |row: &&TrialRecord| row.verdict == Some(Verdict::Accept);
    let best = rows.iter().filter(accepted).filter_map(|row| row.value).fold(f64::NEG_INFINITY, f64::max);
    let mut lines = vec![header];
    for row in rows {
        let asterisk = if row.verdict == Some(Verdict::Accept) && row.value == Some(best) { "*" } else { "" };
        let mut cells = vec![format!("{asterisk}{}", row.trial)];
        for parameter in parameters {
            let value = row.parameters.get(&parameter.name);
            cells.push(value.map_or_else(String::new, |v| format!("{v:.*}", digits(&parameter.unit))));
        }
        cells.push(row.value.map_or_else(|| "-".into(), |value| format!("{value:.3}")));
        cells.push(row.measured.map_or_else(|| "-".into(), |measured| format!("{:.3}", measured.apex_m)));
        cells.push(row.measured.map_or_else(|| "-".into(), |measured| format!("{:.3}", measured.air_s)));
        cells.push(row.source.name().into());
        cells.push(match row.verdict {
            Some(Verdict::Accept) => "accept".into(),
            Some(verdict) => format!("{}: {}", verdict.name(), row.cause),
            None => "not judged".into(),
        });
        lines.push(cells);
    }
    let columns = lines[0].len();
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..columns).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        for (column, cell) in line.iter().enumerate() {
            // Numbers right-aligned; the texts of the last two columns left-aligned.
            let is_text = column + 2 >= columns;
            let pad = " ".repeat(widths[column] - cell.chars().count());
            let cell = if is_text { format!("{cell}{pad}") } else { format!("{pad}{cell}") };
            text.push_str(&cell);
            text.push_str("  ");
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

/// Decimal places for a parameter of a unit.
fn digits(unit: &str) -> usize {
    if unit == "Hz" { 3 } else { 1 }
}
