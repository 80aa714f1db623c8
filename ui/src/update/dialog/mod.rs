//! Keys while a dialog is open.

mod confirm;
mod lists;
mod override_form;
mod text_field;

use crossterm::event::KeyCode;

use crate::action::Action;
use crate::keymap::Key;
use crate::message::Effect;
use crate::model::Model;
use crate::model::dialog::Dialog;

/// Outcome of a key in a dialog.
pub(super) enum KeyOutcome {
    /// Effects of the dialog itself.
    Effects(Vec<Effect>),
    /// An action to perform, as if its key had been pressed without the dialog.
    Perform(Action),
}

/// One key while `dialog`, which was taken out of the model, is open. STOP and Ctrl-C were handled before.
pub(super) fn key(model: &mut Model, dialog: Dialog, key: Key) -> KeyOutcome {
    if dialog.only_shows() && closes(model, key) {
        return KeyOutcome::Effects(Vec::new());
    }
    let action = match &dialog {
        Dialog::ArmingChecks { .. } => confirm::action_over_checks(model, key),
        Dialog::Palette { selected, .. } => lists::chosen_action(model, key, *selected),
        Dialog::Details { .. } => lists::action_over_details(model, key),
        _ => None,
    };
    if let Some(action) = action {
        if let Dialog::Details { trial, .. } = dialog {
            lists::act_on_shown(model, action, trial);
        }
        // Nothing that is read changes: the key that closes the details would end the program if they were gone.
        if action == Action::Acknowledge && matches!(dialog, Dialog::Details { .. }) {
            model.dialog = Some(dialog);
        }
        return KeyOutcome::Perform(action);
    }
    KeyOutcome::Effects(match dialog {
        Dialog::Approve { trial, revision, pressed_at, area_clear } => {
            confirm::approve_key(model, key, (trial, revision, pressed_at), area_clear)
        }
        Dialog::TakeControl => confirm::take_control_key(model, key),
        Dialog::Arm { typed, opened_at } => confirm::arm_key(model, key, (typed, opened_at)),
        Dialog::ArmingChecks { selected, scroll } => confirm::arming_checks_key(model, key, (selected, scroll)),
        Dialog::Confirm(question) => confirm::question_key(model, key, &question),
        Dialog::Quit => confirm::quit_key(model, key),
        Dialog::Override(form) => override_form::key(model, key, form),
        Dialog::Field { purpose, input, replaces, problem } => {
            text_field::key(model, key, purpose, (input, replaces, problem))
        }
        Dialog::Export { .. } => confirm::export_key(model, key),
        Dialog::Palette { input, selected } => lists::palette_key(model, key, input, selected),
        Dialog::Help { scroll } => lists::help_key(model, key, scroll),
        Dialog::Report { lines, scroll } => lists::report_key(model, key, lines, scroll),
        Dialog::Choose { subject, selected } => lists::choice_key(model, key, subject, selected),
        Dialog::Queue { selected } => lists::queue_key(model, key, selected),
        Dialog::Details { trial, scroll } => lists::details_key(model, key, trial, scroll),
        Dialog::LogLine { scroll } => lists::log_line_key(model, key, scroll),
    })
}

/// Whether a key closes a dialog that only shows something: Esc, Enter, and the key that quits elsewhere.
fn closes(model: &Model, key: Key) -> bool {
    matches!(key.code(), KeyCode::Esc | KeyCode::Enter) || model.keymap.action(key) == Some(Action::Quit)
}
