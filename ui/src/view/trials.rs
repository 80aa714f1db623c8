//! View 2, Trials: the whole table; the same table, without sorting marks, is the lower part of Live.
//!
//! ```text
//! Trials ──────────────── 12 accept, 5 fall, 1 void; by number; all; F filter s sort
//!    #  f0 Hz   Fx N    Fz N    J m     verdict  source    cause and note
//!    6  1.102    91.2   301.4   0.000 x fall     sampler   roll 1.21 rad, allowed 1.00
//!    7  1.243   118.2   243.9   0.642 o accept * sampler   | slid on the mat
//! ```

use quadfrog::trial::{TrialRecord, Verdict};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::objective::sign;
use super::trial_text::remark;
use super::{clock, cut, heading, number, span};
use crate::action::Action;
use crate::column::{Column, SortBy, measured};
use crate::model::Model;
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
        SortBy::Number => "number",
        SortBy::Parameter(index) => model.session.parameters.get(index).map_or("number", |info| info.name.as_str()),
        SortBy::Column(column) => column.name(),
    };
    let turned = if view.reversed { " reversed" } else { "" };
    let key = |action| model.keymap.key(action);
    format!(
        "{counts}; by {sort}{turned} ({}), {shown} ({}), columns ({})",
        key(Action::Sort),
        key(Action::Filter),
        key(Action::Columns)
    )
}

/// One column as drawn.
struct Shown {
    title: String,
    width: usize,
    cell: Cell,
}

/// Where a cell's text comes from.
enum Cell {
    Parameter(String),
    Of(Column),
}

/// The columns as the operator has chosen them, as far as `width` characters take them.
fn shown_columns(model: &Model, width: usize) -> Vec<Shown> {
    let mut shown = Vec::new();
    for column in &model.trials_view.columns {
        let (title, width) = match column {
            Column::Parameters => {
                shown.extend(model.session.parameters.iter().map(|info| Shown {
                    title: format!("{:>7}", format!("{} {}", info.name, info.unit)),
                    width: 7,
                    cell: Cell::Parameter(info.name.clone()),
                }));
                continue;
            }
            Column::Dx | Column::Dy => (format!("{:>7}", format!("{} m", column.name())), 7),
            Column::Yaw => (format!("{:>7}", "yaw rad"), 7),
            Column::Apex => (format!("{:>7}", "apex m"), 7),
            Column::Air => (format!("{:>7}", "air s"), 7),
            Column::Value => (format!("{:>8}", format!("J {}", model.session.unit)), 9),
            Column::Verdict => ("  verdict".to_owned(), 10),
            Column::Source => ("source".to_owned(), 9),
            Column::Risk => ("fell".to_owned(), 4),
            Column::Time => ("   ran".to_owned(), 7),
            Column::Cause => ("cause, note".to_owned(), usize::MAX),
        };
        shown.push(Shown { title, width, cell: Cell::Of(*column) });
    }
    let mut left = width.saturating_sub(NUMBER_WIDTH);
    for column in &mut shown {
        column.width = column.width.min(left);
        left = left.saturating_sub(column.width + 1);
    }
    shown.retain(|column| column.width >= column.title.trim().len().min(4));
    shown
}

/// Width of the trial's number and the space behind it.
const NUMBER_WIDTH: usize = 5;

/// The table, scrolled so that the chosen row is seen. `full` shows the choice; without it the newest rows are shown.
pub fn render_table(frame: &mut Frame, area: Rect, model: &Model, full: bool) {
    if area.height < 2 {
        return;
    }
    let theme = &model.theme;
    let width = usize::from(area.width);
    let columns = shown_columns(model, width);
    let titles: Vec<String> = columns.iter().map(|column| padded(&column.title, column.width)).collect();
    let title = format!("{:>4} {}", "#", titles.join(" "));
    frame.render_widget(Line::from(span(theme, Role::Heading, cut(&title, width))), Rect { height: 1, ..area });
    let rows: Vec<&TrialRecord> = if full { model.table() } else { model.trials.values().collect() };
    if rows.is_empty() {
        let below = Rect { y: area.y + 1, height: area.height - 1, ..area };
        return render_empty(frame, below, model);
    }
    let chosen = if full { model.selected_trial().map(|trial| trial.trial) } else { None };
    let first = first_row(&rows, chosen, usize::from(area.height) - 1);
    let best = model.best().map(|trial| trial.trial);
    for (line, trial) in rows.iter().skip(first).take(usize::from(area.height) - 1).enumerate() {
        let selected = chosen == Some(trial.trial);
        let style = if selected { theme.style(Role::Selected) } else { Style::new() };
        let area = Rect { y: area.y + 1 + line as u16, height: 1, ..area };
        let ghost = [model.live.ghost, model.live.comparison.as_ref().map(|c| c.b)].contains(&Some(trial.trial));
        let mut spans = vec![Span::raw(format!(
            "{}{:>3}{}",
            if selected { ">" } else { " " },
            trial.trial,
            if ghost { "~" } else { " " }
        ))];
        for column in &columns {
            let (text, role) = cell(model, trial, column, best == Some(trial.trial));
            spans.push(span(theme, role, padded(&text, column.width)));
            spans.push(Span::raw(" "));
        }
        frame.render_widget(Line::from(spans).style(style), area);
    }
}

/// The row that stands first: the chosen one, or else the newest, is seen, in the middle where it can be.
fn first_row(rows: &[&TrialRecord], chosen: Option<u32>, space: usize) -> usize {
    let last = rows.len().saturating_sub(1);
    let at = chosen.and_then(|number| rows.iter().position(|row| row.trial == number)).unwrap_or(last);
    at.saturating_sub(space / 2).min(rows.len().saturating_sub(space))
}

/// The trial that the view Trials shows in a row of the terminal.
pub fn trial_at(model: &Model, row: u16) -> Option<u32> {
    // Below the frame, the tabs, the heading and the titles; above the answer and the next step.
    let (top, bottom) = (super::TABS_ROW + 3, model.size.1.checked_sub(2)?);
    let line = row.checked_sub(top).filter(|_| row < bottom)?;
    let rows = model.table();
    let chosen = model.selected_trial().map(|trial| trial.trial);
    let first = first_row(&rows, chosen, usize::from(bottom - top));
    rows.get(first + usize::from(line)).map(|trial| trial.trial)
}

/// Text as wide as its column.
fn padded(text: &str, width: usize) -> String {
    let text = cut(text, width);
    // The last column takes all that is left and needs no filling.
    if width > 40 { text } else { format!("{text:<width$}") }
}

/// What stands in place of the rows while there are none: before the first trial, how one goes.
fn render_empty(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    if !model.trials.is_empty() {
        return frame.render_widget(Line::from(span(theme, Role::Quiet, "     no trial passes the filter")), area);
    }
    if model.replay.is_some() || model.session.observe {
        return frame.render_widget(Line::from(span(theme, Role::Quiet, "     no trial yet")), area);
    }
    let step = |number: &str, words: &[(Action, &'static str)]| {
        let mut spans = vec![span(theme, Role::Quiet, format!("   {number} "))];
        for (action, text) in words {
            spans.push(span(theme, Role::Key, model.keymap.all_keys(*action)));
            spans.push(span(theme, Role::Quiet, format!(" {text}   ")));
        }
        Line::from(spans)
    };
    let stop = Line::from(vec![
        span(theme, Role::Quiet, "   always "),
        span(theme, Role::Key, model.keymap.all_keys(Action::Stop)),
        span(theme, Role::Quiet, " STOP: damp all motors at once   "),
        span(theme, Role::Key, model.keymap.key(Action::Quit)),
        span(theme, Role::Quiet, " quit   "),
        span(theme, Role::Key, model.keymap.key(Action::Help)),
        span(theme, Role::Quiet, " all keys"),
    ]);
    let lines = vec![
        step("before", &[(Action::Arm, "arm: it stands up"), (Action::Override, "override"), (Action::Skip, "skip")]),
        step("jump  ", &[(Action::Approve, "approve; again after 0.8 s: the robot jumps")]),
        step(
            "after ",
            &[
                (Action::Accept, "accept"),
                (Action::Fall, "fall"),
                (Action::Void, "void"),
                (Action::Rerun, "re-run"),
                (Action::Undo, "undo"),
            ],
        ),
        stop,
    ];
    frame.render_widget(Paragraph::new(lines), area);
}

/// A cell's text and how it is drawn.
fn cell(model: &Model, trial: &TrialRecord, column: &Shown, best: bool) -> (String, Role) {
    let (mark, role) = sign(trial.verdict);
    let column = match &column.cell {
        Cell::Parameter(name) => {
            let value = trial.parameters.iter().find(|(known, _)| known == name);
            return (format!("{:>7}", value.map_or("-".to_owned(), |(_, value)| number(*value))), Role::Text);
        }
        Cell::Of(column) => *column,
    };
    match column {
        Column::Parameters => (String::new(), Role::Text),
        Column::Dx | Column::Dy | Column::Yaw | Column::Apex | Column::Air => {
            let value = measured(trial, column).map_or("-".to_owned(), |value| format!("{value:+.3}"));
            (format!("{value:>7}"), Role::Text)
        }
        Column::Value => {
            let hand = if trial.hand_value.is_some() { "h" } else { " " };
            (format!("{:>8}{hand}", trial.value.map_or("-".to_owned(), number)), Role::Text)
        }
        Column::Verdict => {
            let verdict = match (trial.verdict, trial.suggested) {
                (Some(verdict), _) => verdict.name().to_owned(),
                (None, Some(suggested)) => format!("{}?", suggested.name()),
                (None, None) => "runs".to_owned(),
            };
            (format!("{mark} {verdict:<7}{}", if best { "*" } else { " " }), role)
        }
        Column::Source => {
            let parent = trial.parent.map_or(String::new(), |parent| format!(" {parent}"));
            (format!("{}{parent}", trial.source.name()), Role::Quiet)
        }
        Column::Risk => {
            let risk = trial.risk.filter(|risk| risk.neighbours > 0);
            (risk.map_or("-".to_owned(), |risk| format!("{}/{}", risk.falls, risk.neighbours)), Role::Quiet)
        }
        Column::Time => {
            let begun = model.ran.get(&trial.trial).map(|ran| clock(ran.begun_ns));
            (format!("{:>6}", begun.unwrap_or("-".to_owned())), Role::Quiet)
        }
        Column::Cause => (remark(trial), Role::Quiet),
    }
}
