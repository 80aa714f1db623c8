//! The places of the screen's parts, for drawing and for the mouse.

use ratatui::layout::{Constraint, Layout, Rect, Size};
use ratatui::text::Line;
use strum::VariantArray;

use crate::action::Action;
use crate::keymap::Keymap;
use crate::model::dialog::MAX_WIDTH;
use crate::model::{Model, View};
use crate::wrap::wrap;

/// The smallest terminal with views.
pub const MIN_COLUMNS: u16 = 80;
pub const MIN_ROWS: u16 = 24;

/// The smallest terminal with which trials can be run: mode, STOP, the trial, the newest answer and the next step.
pub const COMPACT_COLUMNS: u16 = 60;
pub const COMPACT_ROWS: u16 = 20;

/// The parts of the screen of a terminal that is too small for the views, from the top.
#[derive(Debug, Clone, Copy)]
pub struct CompactAreas {
    pub frame: Rect,
    /// The proposal, or the trial that runs or waits for its verdict.
    pub trial: Rect,
    /// That larger terminals show more.
    pub hint: Rect,
    pub message: Rect,
    pub next_step: Rect,
}

/// The parts of a compact screen of that size; none if it is too small.
pub fn compact_areas(size: Size) -> Option<CompactAreas> {
    if size.width < COMPACT_COLUMNS || size.height < COMPACT_ROWS {
        return None;
    }
    let [frame, trial, hint, message, next_step] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Fill(1),
        Constraint::Length(1),
        Constraint::Length(2),
        Constraint::Length(2),
    ])
    .areas(Rect::from(((0, 0).into(), size)));
    Some(CompactAreas { frame, trial, hint, message, next_step })
}

/// Whether a terminal of that size shows a panel of the trial with so many rows whole.
pub fn shows_trial(size: Size, rows: u16) -> bool {
    let whole = size.width >= MIN_COLUMNS && size.height >= MIN_ROWS;
    whole || compact_areas(size).is_some_and(|areas| rows <= areas.trial.height)
}

/// The parts of the screen, from the top.
#[derive(Debug, Clone, Copy)]
pub struct Areas {
    pub frame: Rect,
    pub tabs: Rect,
    pub body: Rect,
    /// The trials of a replay over time; without height in a live session.
    pub timeline: Rect,
    /// The newest answer to the operator.
    pub message: Rect,
    pub next_step: Rect,
}

/// Most rows of the newest answer to the operator.
const MESSAGE_ROWS: usize = 3;

/// The newest answer to the operator in rows of a terminal, each with a space before it; an old one begins with its age.
pub fn message_rows(model: &Model, columns: u16) -> Vec<Line<'static>> {
    let text = model.shown_message().map(|message| match message.age_min(model.clock) {
        0 => Line::from(format!(" {}", message.text)),
        minutes => Line::from(format!(" {minutes} min ago: {}", message.text)),
    });
    text.map_or_else(Vec::new, |text| wrap(&text, usize::from(columns).saturating_sub(1), 1))
}

/// The parts of a screen of that size; none if it is too small.
pub fn areas(size: Size, model: &Model) -> Option<Areas> {
    if size.width < MIN_COLUMNS || size.height < MIN_ROWS {
        return None;
    }
    let message_rows = message_rows(model, size.width).len().clamp(1, MESSAGE_ROWS);
    let [frame, tabs, body, timeline, message, next_step] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(u16::from(model.replay.is_some())),
        Constraint::Length(message_rows as u16),
        Constraint::Length(1),
    ])
    .areas(Rect::from(((0, 0).into(), size)));
    Some(Areas { frame, tabs, body, timeline, message, next_step })
}

/// The columns within the borders and margins of the widest dialog.
pub fn dialog_columns(model: &Model) -> usize {
    usize::from(model.size.0.min(MAX_WIDTH).saturating_sub(4))
}

/// The rows within the borders of the highest dialog.
pub fn dialog_rows(model: &Model) -> usize {
    let size = Size::from(model.size);
    let body = areas(size, model).map(|areas| areas.body).or(compact_areas(size).map(|areas| areas.trial));
    body.map_or(1, |body| usize::from(body.height.saturating_sub(2)).max(1))
}

/// The rows of the trial table in view Trials: the body below its heading and the column titles.
pub fn trial_rows(body: Rect) -> Rect {
    Rect { y: body.y + 2, height: body.height.saturating_sub(2), ..body }
}

/// The index of the first row shown of a table, with the selected row (or else the last) near the middle.
pub fn first_row(rows: usize, selected: Option<usize>, space: usize) -> usize {
    let at = selected.unwrap_or(rows.saturating_sub(1));
    at.saturating_sub(space / 2).min(rows.saturating_sub(space))
}

pub fn tabs(keymap: &Keymap) -> impl Iterator<Item = (View, Action, String)> + '_ {
    View::VARIANTS.iter().map(move |view| {
        let action = match view {
            View::Live => Action::LiveView,
            View::Trials => Action::TrialsView,
            View::Optimizer => Action::OptimizerView,
            View::Override => Action::OverrideView,
            View::Health => Action::HealthView,
            View::Log => Action::LogView,
        };
        (*view, action, format!(" {} {} ", keymap.key(action), view.name()))
    })
}

/// The action of the tab in a column of the terminal.
pub fn tab_at(keymap: &Keymap, column: u16) -> Option<Action> {
    let mut end = 0;
    tabs(keymap).find_map(|(_, action, text)| {
        end += text.chars().count();
        (usize::from(column) < end).then_some(action)
    })
}
