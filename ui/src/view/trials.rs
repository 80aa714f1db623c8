//! View 2, Trials: the whole table; the same table, without sorting marks, is the lower part of Live.
//!
//! ```text
//! Trials ──────────────── 12 accept, 5 fall, 1 void; by number; all; F filter s sort
//!    #  f0 Hz   Fx N    Fz N    J m     verdict  source    cause and note
//!    6  1.102    91.2   301.4   0.000 x fall     sampler   roll 1.21 rad, allowed 1.00
//!    7  1.243   118.2   243.9   0.642 o accept * sampler   | slid on the mat
//! ```

use quadfrog::recording::record::{TrialRecord, Verdict};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::objective::sign;
use super::{cut, heading, number, proposal, span};
use crate::action::Action;
use crate::model::{Columns, Model, SortBy};
use crate::theme::Role;

/// Draws the view.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let body = heading(frame, area, &model.theme, "Trials", &summary(model));
    render_table(frame, body, model, true);
}

/// How many of each verdict, and what the table is sorted and filtered by.
fn summary(model: &Model) -> String {
    let count = |verdict| model.trials.values().filter(|trial| trial.verdict == Some(verdict)).count();
    let counts = Verdict::ALL.map(|verdict| format!("{} {}", count(verdict), verdict.name())).join(", ");
    let view = &model.trials_view;
    let shown = match (view.best_only, view.filter) {
        (true, _) => "best only".to_owned(),
        (false, Some(verdict)) => format!("only {}", verdict.name()),
        (false, None) => "all".to_owned(),
    };
    let sort = match view.sort {
        SortBy::Number => "by number",
        SortBy::Value => "by value",
        SortBy::Verdict => "by verdict",
    };
    let key = |action| model.keymap.key(action);
    format!(
        "{counts}; {sort} ({}), {shown} ({}), columns ({})",
        key(Action::Sort),
        key(Action::Filter),
        key(Action::Columns)
    )
}

/// Title of a column and its text for a trial.
type Column = (String, Box<dyn Fn(&TrialRecord) -> String>);

/// The columns between the number and the value: title and text of a trial.
fn middle_columns(model: &Model) -> Vec<Column> {
    let measured = |title: &str, of: fn(&quadfrog::recording::record::Measured) -> f64| {
        let text =
            move |trial: &TrialRecord| trial.measured.as_ref().map_or("-".to_owned(), |m| format!("{:+.3}", of(m)));
        (title.to_owned(), Box::new(text) as Box<dyn Fn(&TrialRecord) -> String>)
    };
    match model.trials_view.columns {
        Columns::Parameters => model
            .session
            .parameters
            .iter()
            .map(|info| {
                let name = info.name.clone();
                let text = move |trial: &TrialRecord| {
                    trial
                        .parameters
                        .iter()
                        .find(|(n, _)| *n == name)
                        .map_or("-".to_owned(), |(_, value)| number(*value))
                };
                (format!("{} {}", info.name, info.unit), Box::new(text) as Box<dyn Fn(&TrialRecord) -> String>)
            })
            .collect(),
        Columns::Measured => vec![
            measured("dx m", |m| m.dx_m),
            measured("dy m", |m| m.dy_m),
            measured("yaw rad", |m| m.dyaw_rad),
            measured("apex m", |m| m.apex_m),
            measured("air s", |m| m.air_s),
        ],
    }
}

/// The table, scrolled so that the chosen row is seen. `full` shows the choice; without it the newest rows are shown.
pub fn render_table(frame: &mut Frame, area: Rect, model: &Model, full: bool) {
    if area.height < 2 {
        return;
    }
    let theme = &model.theme;
    let columns = middle_columns(model);
    let mut title = format!("{:>4} ", "#");
    for (name, _) in &columns {
        title.push_str(&format!("{name:>8} "));
    }
    title.push_str(&format!(
        "{:>8}   {:<9} {:<9} cause, note",
        format!("J {}", model.session.unit),
        "verdict",
        "source"
    ));
    let width = usize::from(area.width);
    frame.render_widget(Line::from(span(theme, Role::Heading, cut(&title, width))), Rect { height: 1, ..area });
    let rows: Vec<&TrialRecord> = if full { model.table() } else { model.trials.values().collect() };
    let space = usize::from(area.height) - 1;
    if rows.is_empty() {
        let text = if model.trials.is_empty() { "     no trial yet" } else { "     no trial passes the filter" };
        let line = Rect { y: area.y + 1, height: 1, ..area };
        frame.render_widget(Line::from(span(theme, Role::Quiet, text)), line);
        return;
    }
    let chosen = if full { model.selected_trial().map(|trial| trial.trial) } else { None };
    let at = chosen.and_then(|number| rows.iter().position(|row| row.trial == number)).unwrap_or(rows.len() - 1);
    // The chosen row stands in the middle where there are rows on both sides.
    let first = at.saturating_sub(space / 2).min(rows.len().saturating_sub(space));
    let best = model.best().map(|trial| trial.trial);
    for (line, trial) in rows.iter().skip(first).take(space).enumerate() {
        let selected = chosen == Some(trial.trial);
        let style = if selected { theme.style(Role::Selected) } else { Style::new() };
        let area = Rect { y: area.y + 1 + line as u16, height: 1, ..area };
        let mut spans = vec![Span::raw(format!("{:>4} ", trial.trial))];
        spans.extend(columns.iter().map(|(_, text)| Span::raw(format!("{:>8} ", text(trial)))));
        spans.extend(outcome(model, trial, best == Some(trial.trial), width));
        frame.render_widget(Line::from(spans).style(style), area);
    }
}

/// Value, verdict, source, cause and note.
fn outcome(model: &Model, trial: &TrialRecord, best: bool, width: usize) -> Vec<Span<'static>> {
    let theme = &model.theme;
    let (mark, role) = sign(trial.verdict);
    let value = trial.value.map_or("-".to_owned(), number);
    let hand = if trial.hand_value.is_some() { "h" } else { " " };
    let verdict = match (trial.verdict, trial.suggested) {
        (Some(verdict), _) => verdict.name().to_owned(),
        (None, Some(suggested)) => format!("{}?", suggested.name()),
        (None, None) => "runs".to_owned(),
    };
    let star = if best { "*" } else { " " };
    let source = match trial.parent {
        Some(parent) => format!("{} #{parent}", trial.source.name()),
        None => trial.source.name().to_owned(),
    };
    vec![
        Span::raw(format!("{value:>8}{hand}")),
        span(theme, role, format!("{mark} {verdict:<7}{star}")),
        span(theme, Role::Quiet, format!(" {source:<10}")),
        span(theme, Role::Quiet, cut(&remark(trial), width.saturating_sub(60).max(10))),
    ]
}

/// Cause and note on one line.
fn remark(trial: &TrialRecord) -> String {
    match (trial.cause.as_str(), trial.note.as_str()) {
        (cause, "") => cause.to_owned(),
        ("", note) => format!("| {note}"),
        (cause, note) => format!("{cause} | {note}"),
    }
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
    for (name, value) in &trial.parameters {
        let info = model.parameter(name);
        let unit = info.map_or("", |info| info.unit.as_str());
        let bounds = info.map_or(String::new(), |info| format!("  ({} to {})", info.low, info.high));
        row(name, format!("{value:.5} {unit}{bounds}"));
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
    let rest = ["value", "hand_value", "verdict", "suggested", "cause", "source", "parent"];
    names.extend(rest.map(str::to_owned));
    names.extend(["dx_m", "dy_m", "dyaw_rad", "apex_m", "air_s", "note"].map(str::to_owned));
    let optional = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let row = |trial: &&TrialRecord| {
        let mut cells = vec![trial.trial.to_string()];
        for info in &model.session.parameters {
            cells.push(optional(trial.parameters.iter().find(|(name, _)| *name == info.name).map(|(_, value)| *value)));
        }
        cells.extend([
            optional(trial.value),
            optional(trial.hand_value),
            trial.verdict.map_or("", Verdict::name).to_owned(),
            trial.suggested.map_or("", Verdict::name).to_owned(),
            trial.cause.clone(),
            trial.source.name().to_owned(),
            trial.parent.map(|parent| parent.to_string()).unwrap_or_default(),
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
