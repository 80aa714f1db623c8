//! The mouse, where it is on: it chooses and scrolls. It never commands the robot: a click is too easily made by accident.

use super::navigate::move_by;
use super::{Effect, perform};
use crate::model::{Model, View};
use crate::view::{self, frame, trials};

/// Rows that one notch of the wheel moves by.
const NOTCH: isize = 3;

/// One use of the mouse; columns and rows count from 0 at the upper left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mouse {
    /// The left button was pressed.
    Click {
        /// Column.
        column: u16,
        /// Row.
        row: u16,
    },
    /// The wheel was turned away from the operator.
    WheelUp,
    /// The wheel was turned towards the operator.
    WheelDown,
}

/// What a use of the mouse does.
pub(super) fn take(model: &mut Model, event: Mouse) -> Vec<Effect> {
    if !model.mouse || model.dialog.is_some() {
        return Vec::new();
    }
    match event {
        Mouse::WheelUp => move_by(model, -NOTCH),
        Mouse::WheelDown => move_by(model, NOTCH),
        Mouse::Click { column, row } if row == view::TABS_ROW => match frame::tab_at(model, column) {
            Some(action) => perform(model, action),
            None => Vec::new(),
        },
        Mouse::Click { row, .. } if model.view == View::Trials => {
            if let Some(trial) = trials::trial_at(model, row) {
                model.trials_view.selected = Some(trial);
            }
            Vec::new()
        }
        Mouse::Click { .. } => Vec::new(),
    }
}
