//! The mouse: it selects and scrolls. It never commands the robot, since an accidental click is too easy.

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::layout::Size;

use super::dialog;
use super::navigate::move_by;
use super::perform::perform;
use crate::keymap::Key;
use crate::layout::{Areas, areas, first_row, tab_at, trial_rows};
use crate::message::{Effect, Mouse};
use crate::model::dialog::Dialog;
use crate::model::{Model, View};

/// Rows that one notch of the wheel moves by.
const NOTCH: isize = 3;

pub(super) fn handle(model: &mut Model, event: Mouse) -> Vec<Effect> {
    if !model.mouse {
        return Vec::new();
    }
    if model.dialog.is_some() {
        scroll_dialog(model, event);
        return Vec::new();
    }
    match event {
        Mouse::WheelUp => move_by(model, -NOTCH),
        Mouse::WheelDown => move_by(model, NOTCH),
        Mouse::Click { column, row } => {
            let Some(areas) = areas(Size::from(model.size), model) else { return Vec::new() };
            if row == areas.tabs.y {
                return tab_at(&model.keymap, column).map_or_else(Vec::new, |action| perform(model, action));
            }
            model.trial_table.selected = trial_at(model, &areas, row).or(model.trial_table.selected);
        }
    }
    Vec::new()
}

/// Scrolls a dialog that only shows something, with its keys; a question, a field and a form are left alone.
fn scroll_dialog(model: &mut Model, event: Mouse) {
    let pages = matches!(model.dialog, Some(Dialog::Details { .. } | Dialog::LogLine { .. }));
    let (code, times) = match event {
        // Up and Down show another trial or line there.
        Mouse::WheelUp if pages => (KeyCode::PageUp, 1),
        Mouse::WheelDown if pages => (KeyCode::PageDown, 1),
        Mouse::WheelUp => (KeyCode::Up, NOTCH),
        Mouse::WheelDown => (KeyCode::Down, NOTCH),
        Mouse::Click { .. } => return,
    };
    for _ in 0..times {
        if let Some(dialog) = model.dialog.take_if(|dialog| dialog.only_shows()) {
            dialog::key(model, dialog, Key::from_event(KeyEvent::from(code)));
        }
    }
}

/// The trial that the view Trials shows in a row of the terminal.
fn trial_at(model: &Model, areas: &Areas, row: u16) -> Option<u32> {
    let place = trial_rows(areas.body);
    if model.view != View::Trials || !(place.top()..place.bottom()).contains(&row) {
        return None;
    }
    let rows = model.trial_rows();
    let selected = model.selected_trial().and_then(|trial| rows.iter().position(|row| row.trial == trial.trial));
    let first = first_row(rows.len(), selected, usize::from(place.height));
    rows.get(first + usize::from(row - place.top())).map(|trial| trial.trial)
}
