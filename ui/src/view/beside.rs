//! Parameters, values and verdicts of two compared trials, in two columns.

use quadfrog::trial::TrialRecord;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;
use ratatui::widgets::Paragraph;

use super::draw::{columns, heading, measured_number, number, sign, span, truncate};
use crate::column::Column;
use crate::message::ComparedTrial;
use crate::model::Model;
use crate::model::comparison::Comparison;
use crate::model::trials::value_is_by_hand;
use crate::theme::{Role, Theme};
use crate::wrap::wrap;

/// Measured values with their labels.
const MEASURED: [(Column, &str); 5] = [
    (Column::Dx, "dx m"),
    (Column::Dy, "dy m"),
    (Column::Yaw, "yaw rad"),
    (Column::Rise, "rise m"),
    (Column::Air, "air s"),
];
/// Heading, numbers, value, verdict, measured values.
const FIXED_ROWS: usize = 4 + MEASURED.len();
const LABEL: usize = 8;

/// Rows that the panel needs at least: a line for each cause.
pub fn least_rows(comparison: &Comparison) -> u16 {
    let recording = usize::from(comparison.b.recording.is_some());
    (FIXED_ROWS + recording + parameters(comparison).len() + 2) as u16
}

/// Rows that the panel fills: two lines for each cause.
pub fn rows(comparison: &Comparison) -> u16 {
    least_rows(comparison) + 2
}

/// Names of the parameters of A, then the further ones of B.
fn parameters(comparison: &Comparison) -> Vec<&str> {
    let mut names = Vec::new();
    for (name, _) in [&comparison.a.row, &comparison.b.row].into_iter().flatten().flat_map(|row| row.parameters.iter())
    {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

pub fn render(frame: &mut Frame, area: Rect, comparison: &Comparison, model: &Model) {
    let (theme, Comparison { a, b, .. }) = (&model.theme, comparison);
    let body = heading(frame, area, theme, title(comparison, model, area.width), "");
    let width = (usize::from(body.width).saturating_sub(LABEL + 1) / 2).min(12);
    let line = |label: &str, cells: [(String, Role); 2]| {
        let mut spans = vec![span(theme, Role::Quiet, format!(" {label:<LABEL$}"))];
        spans.extend(cells.map(|(text, role)| span(theme, role, format!("{text:>width$}"))));
        Line::from(spans)
    };
    let both = |cell: &dyn Fn(&ComparedTrial, &TrialRecord) -> (String, Role)| {
        [a, b].map(|trial| match &trial.row {
            Some(row) => cell(trial, row),
            None => ("-".to_owned(), Role::Quiet),
        })
    };
    let value = |value: Option<f64>| (value.map_or("-".to_owned(), number), Role::Text);
    let mut lines = Vec::new();
    lines.push(line("", [format!("A #{}", a.trial), format!("B #{}", b.trial)].map(|text| (text, Role::Key))));
    if let Some(name) = &b.recording {
        // The end of a path names the study and the file.
        let room = usize::from(body.width).saturating_sub(7);
        let end = |skipped: usize| name.chars().skip(skipped).collect::<String>();
        let text = match name.chars().count().saturating_sub(room) {
            0 => format!(" B of {name}"),
            skipped => format!(" B of ..{}", end(skipped + 2)),
        };
        lines.push(Line::from(span(theme, Role::Quiet, text)));
    }
    let unit = if a.unit == b.unit { format!("J {}", a.unit) } else { format!("J {},{}", a.unit, b.unit) };
    let of_row = |_: &ComparedTrial, row: &TrialRecord| {
        // A trial without a verdict has what was measured; a void one has no value.
        let measured = || model.session.measured_objective(row).filter(|_| row.verdict.is_none());
        let (shown, role) = value(row.value.or_else(measured));
        // As in the table.
        (if value_is_by_hand(row) { format!("{shown} h") } else { shown }, role)
    };
    lines.push(line(&unit, both(&of_row)));
    lines.push(line("verdict", both(&|_, row| verdict(row))));
    for name in parameters(comparison) {
        let unit = model.session.parameter(name).map_or(String::new(), |info| info.unit);
        lines.push(line(&format!("{name} {unit}"), both(&|_, row| value(row.parameters.get(name)))));
    }
    for (column, label) in MEASURED {
        lines.push(line(label, both(&|_, row| (measured_number(row, column), Role::Text))));
    }
    let rows_of_values = lines.len();
    let room = usize::from(body.height).saturating_sub(rows_of_values);
    lines.extend(causes(comparison, theme, usize::from(body.width), room));
    if rows_of_values > usize::from(body.height) {
        lines.truncate(usize::from(body.height).saturating_sub(1));
        let left_out = rows_of_values - lines.len();
        lines.push(Line::from(span(theme, Role::Quiet, format!(" {left_out} more have no room"))));
    }
    frame.render_widget(Paragraph::new(lines), body);
}

/// The title; where a row is not that of the table at the playhead, with the time of the rows.
fn title(comparison: &Comparison, model: &Model, width: u16) -> &'static str {
    let Comparison { a, b, .. } = comparison;
    let differs = |trial: &ComparedTrial| trial.row.as_ref() != model.session.trials.records.get(&trial.trial);
    let titles = match differs(a) || b.recording.is_none() && differs(b) {
        true => ["Two trials, at the end of the recording", "Two trials, at the end"],
        false => ["Two trials"; 2],
    };
    if columns(titles[0]) <= usize::from(width) { titles[0] } else { titles[1] }
}

/// The causes of both verdicts in at most `room` lines: of one that is longer than its share the first line, with a sign at its end.
fn causes(comparison: &Comparison, theme: &Theme, width: usize, room: usize) -> Vec<Line<'static>> {
    let cause = |(name, trial): (&str, &ComparedTrial)| {
        let cause = trial.row.as_ref().map(|row| row.cause.clone()).filter(|cause| !cause.is_empty())?;
        let text = Line::from(span(theme, Role::Quiet, format!(" {name}: {cause}")));
        Some((text.to_string(), wrap(&text, width, 4)))
    };
    let all: Vec<_> = [("A", &comparison.a), ("B", &comparison.b)].into_iter().filter_map(cause).collect();
    let mut spare = room.saturating_sub(all.len());
    let mut lines = Vec::new();
    for (text, whole) in all.into_iter().take(room) {
        match spare.checked_sub(whole.len() - 1) {
            Some(left) => {
                spare = left;
                lines.extend(whole);
            }
            None => lines.push(Line::from(span(theme, Role::Quiet, truncate(&text, width)))),
        }
    }
    lines
}

/// The verdict, or else the suggested one with a question mark.
fn verdict(row: &TrialRecord) -> (String, Role) {
    let (symbol, role) = sign(row.verdict);
    let name = match (row.verdict, row.suggested) {
        (Some(verdict), _) => row.verdict_name().unwrap_or(verdict.name()).to_owned(),
        (None, Some(suggested)) => format!("{}?", suggested.name()),
        (None, None) => "none".to_owned(),
    };
    (format!("{symbol} {name}"), role)
}
