//! Keys of the questions: approve, arm, the arming checks, quit.

use std::time::Duration;

use crossterm::event::KeyCode;
use quadfrog::session::operator_request::{OperatorCheck, OperatorRequest};

use crate::action::Action;
use crate::keymap::Key;
use crate::legal::legal;
use crate::message::Effect;
use crate::model::Model;
use crate::model::dialog::{APPROVAL_PAUSE, Dialog};
use crate::update::request::{cancelled, refused, request};

/// The second press of an approval. Only the approving key approves, and only after a pause: a bounced or held key starts
/// the pause again. Every other key, Enter included, cancels.
pub(super) fn approve_key(
    model: &mut Model,
    key: Key,
    (trial, revision, pressed_at): (u32, u32, Duration),
) -> Vec<Effect> {
    if model.keymap.action(key) != Some(Action::Approve) {
        return cancelled(model, "no jump");
    }
    if model.clock.saturating_sub(pressed_at) < APPROVAL_PAUSE {
        model.dialog = Some(Dialog::Approve { trial, revision, pressed_at: model.clock });
        return Vec::new();
    }
    request_if_legal(model, Action::Approve, OperatorRequest::Approve { trial, revision }, "not approved")
}

pub(super) fn arm_key(model: &mut Model, key: Key, typed: usize) -> Vec<Effect> {
    let letters = model.session.arming_confirmation();
    if key.typed() != letters.chars().nth(typed) {
        return cancelled(model, "not armed");
    }
    if typed + 1 < letters.len() {
        model.dialog = Some(Dialog::Arm { typed: typed + 1 });
        return Vec::new();
    }
    request_if_legal(model, Action::Arm, OperatorRequest::Arm, "not armed")
}

fn request_if_legal(model: &mut Model, action: Action, intent: OperatorRequest, text: &str) -> Vec<Effect> {
    match legal(action, model) {
        Ok(()) => request(model, intent),
        Err(reason) => refused(model, text, &reason),
    }
}

pub(super) fn quit_key(model: &mut Model, key: Key) -> Vec<Effect> {
    match key.typed() {
        Some('y' | 'Y') => vec![Effect::Quit],
        _ => cancelled(model, "not quit"),
    }
}

/// Arming, from the list that shows whether it is possible.
pub(super) fn action_over_checks(model: &Model, key: Key) -> Option<Action> {
    let taken = matches!(key.code(), KeyCode::Esc | KeyCode::Enter | KeyCode::Up | KeyCode::Down | KeyCode::Char('x'));
    let arms = !taken && model.keymap.action(key) == Some(Action::Arm) && legal(Action::Arm, model).is_ok();
    arms.then_some(Action::Arm)
}

pub(super) fn arming_checks_key(model: &mut Model, key: Key, mut selected: usize) -> Vec<Effect> {
    let last = OperatorCheck::ALL.len() - 1;
    let mut effects = Vec::new();
    match key.code() {
        KeyCode::Esc | KeyCode::Enter => return effects,
        KeyCode::Up => selected = selected.saturating_sub(1),
        KeyCode::Down => selected = (selected + 1).min(last),
        KeyCode::Char('x') => {
            effects = request(model, OperatorRequest::Confirm(OperatorCheck::ALL[selected.min(last)]))
        }
        _ => {}
    }
    model.dialog = Some(Dialog::ArmingChecks { selected });
    effects
}
