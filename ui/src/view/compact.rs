//! The screen of a terminal that is too small for the views: all that a jump and its verdict need.

use ratatui::Frame;
use ratatui::text::Line;
use ratatui::widgets::Paragraph;

use super::draw::span;
use super::{countdown, dialogs, last_line, proposal, status_bar};
use crate::layout::{CompactAreas, MIN_COLUMNS, MIN_ROWS};
use crate::model::Model;
use crate::theme::Role;
use crate::wrap::wrap;

/// Columns of the longest key with its text, which is not broken.
const LONGEST_KEY: usize = 16;

pub fn render(frame: &mut Frame, areas: CompactAreas, model: &Model) {
    let CompactAreas { frame: top, trial, hint, message, next_step } = areas;
    status_bar::render(frame, top, model);
    proposal::render(frame, trial, model);
    let text = format!(" the view {} needs {MIN_COLUMNS}x{MIN_ROWS}; all keys work", model.view.name());
    frame.render_widget(Line::from(span(&model.theme, Role::Quiet, text)), hint);
    dialogs::render(frame, trial, model);
    countdown::render(frame, trial, model);
    status_bar::render_message(frame, message, model);
    // Two rows, less the margin of the second and what is lost where the first one is broken between words.
    let columns = usize::from(next_step.width);
    let line = last_line::line_within(model, 2 * columns - 1 - LONGEST_KEY, false);
    frame.render_widget(Paragraph::new(wrap(&line, columns, 1)), next_step);
}
