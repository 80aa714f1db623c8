//! Keys of the questions: approve, arm, the arming checks, quit.

use std::time::Duration;

use crossterm::event::KeyCode;
use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::{OperatorCheck, OperatorRequest};
use quadfrog::trial::Verdict;

use crate::action::Action;
use crate::arming;
use crate::keymap::Key;
use crate::layout::{dialog_columns, dialog_rows};
use crate::legal::legal;
use crate::message::{Effect, ExportedRows};
use crate::model::Model;
use crate::model::dialog::{APPROVAL_PAUSE, APPROVAL_TIME, ARMING_TIME, Dialog, Purpose, Question};
use crate::update::perform::queued_values;
use crate::update::request::{cancelled, refused, reply, request, unknown_key};

/// Lines that a page of the arming checks moves by.
const CHECKS_PAGE: usize = 8;

/// The second press of an approval. Only the approving key approves, and only after a pause: a bounced or held key starts
/// the pause again. On hardware `y` confirms before that the area is clear. Every other key, Enter included, cancels.
pub(super) fn approve_key(
    model: &mut Model,
    key: Key,
    (trial, revision, pressed_at): (u32, u32, Duration),
    area_clear: bool,
) -> Vec<Effect> {
    let waited = model.clock.saturating_sub(pressed_at);
    if waited > APPROVAL_TIME {
        return cancelled(model, &format!("no jump, the question was {} s old", waited.as_secs()));
    }
    let area_asked = model.session.info.is_hardware() && !area_clear;
    if area_asked && key.is(KeyCode::Char('y')) {
        model.dialog = Some(Dialog::Approve { trial, revision, pressed_at, area_clear: true });
        return Vec::new();
    }
    if model.keymap.action(key) != Some(Action::Approve) {
        return cancelled(model, "no jump");
    }
    if area_asked {
        reply(model, LogLevel::Warning, "not yet: type y first if the area is clear");
    }
    if area_asked || waited < APPROVAL_PAUSE {
        if !area_asked {
            let pause_s = APPROVAL_PAUSE.as_secs_f64();
            reply(model, LogLevel::Info, format!("that {key} came within {pause_s:.1} s and did not count"));
        }
        model.dialog = Some(Dialog::Approve { trial, revision, pressed_at: model.clock, area_clear });
        return Vec::new();
    }
    request_if_legal(model, Action::Approve, OperatorRequest::Approve { trial, revision }, "not approved")
}

pub(super) fn arm_key(model: &mut Model, key: Key, (typed, opened_at): (usize, Duration)) -> Vec<Effect> {
    let letters = model.session.arming_confirmation();
    if key.typed() != letters.chars().nth(typed) {
        return cancelled(model, "not armed");
    }
    if typed + 1 < letters.len() {
        model.dialog = Some(Dialog::Arm { typed: typed + 1, opened_at });
        return Vec::new();
    }
    let took = model.clock.saturating_sub(opened_at);
    if letters.len() > 1 && took < ARMING_TIME {
        let text =
            format!("the letters came within {} ms, a person needs {}", took.as_millis(), ARMING_TIME.as_millis());
        return refused(model, "not armed", &text);
    }
    request_if_legal(model, Action::Arm, OperatorRequest::Arm, "not armed")
}

fn request_if_legal(model: &mut Model, action: Action, wanted: OperatorRequest, text: &str) -> Vec<Effect> {
    match legal(action, model) {
        Ok(()) => request(model, wanted),
        Err(reason) => refused(model, text, &reason),
    }
}

pub(super) fn take_control_key(model: &mut Model, key: Key) -> Vec<Effect> {
    match key.typed() {
        Some('y' | 'Y') => request_if_legal(model, Action::TakeControl, OperatorRequest::TakeControl, "not taken"),
        _ => cancelled(model, "nothing was sent to the robot"),
    }
}

/// `y` carries the action out; every other key cancels.
pub(super) fn question_key(model: &mut Model, key: Key, question: &Question) -> Vec<Effect> {
    let yes = matches!(key.typed(), Some('y' | 'Y'));
    match question {
        Question::Skip { trial, revision } if yes => {
            let skip = OperatorRequest::Skip { trial: *trial, revision: *revision };
            request_if_legal(model, Action::Skip, skip, "not skipped")
        }
        Question::Skip { .. } => cancelled(model, "not skipped"),
        Question::JudgeAnyway { verdict, .. } if yes => {
            let action = if *verdict == Verdict::Fall { Action::Fall } else { Action::Accept };
            request_if_legal(model, action, OperatorRequest::Judge(*verdict), "not judged")
        }
        Question::JudgeAnyway { verdict: Verdict::Fall, .. } => cancelled(model, "not judged a fall"),
        Question::JudgeAnyway { .. } => cancelled(model, "not accepted"),
        Question::Rerun { trial } if yes => {
            request_if_legal(model, Action::Rerun, OperatorRequest::Rerun { trial: Some(*trial) }, "not queued")
        }
        Question::Rerun { .. } => cancelled(model, "not queued"),
        Question::QueueProposed { trial, revision } if yes => match model.session.open_proposal() {
            Some(proposal) if (proposal.trial, proposal.revision) == (*trial, *revision) => {
                let point = OperatorRequest::Enqueue(queued_values(proposal));
                request_if_legal(model, Action::QueuePoint, point, "not queued")
            }
            _ => refused(model, "not queued", "there is another proposal by now"),
        },
        Question::QueueProposed { .. } => cancelled(model, "not queued"),
        Question::RemoveQueued { trial } => {
            // Back to the list, which shows what the session answers.
            model.dialog = Some(Dialog::Queue { selected: Some(*trial) });
            match yes {
                true => request(model, OperatorRequest::RemoveQueued { trial: *trial }),
                false => cancelled(model, "not removed"),
            }
        }
        Question::FewRepeats { repeats } if yes => {
            let confirm = OperatorRequest::ConfirmBest { repeats: *repeats };
            request_if_legal(model, Action::ConfirmBest, confirm, "not repeated")
        }
        Question::FewRepeats { repeats } => {
            // Back to the field, where typing replaces the number.
            model.dialog = Some(Dialog::field(Purpose::ConfirmBest, &repeats.to_string()));
            Vec::new()
        }
        Question::EndRepeats if yes => {
            let end = OperatorRequest::ConfirmBest { repeats: 0 };
            request_if_legal(model, Action::ConfirmBest, end, "the repeats go on")
        }
        Question::EndRepeats => cancelled(model, "the repeats go on"),
        Question::Undo { trial } if yes && model.session.undoable() == Some(*trial) => {
            request_if_legal(model, Action::Undo, OperatorRequest::Undo, "not taken back")
        }
        Question::Undo { .. } => cancelled(model, "no verdict was taken back"),
        Question::HandValue { value, .. } if yes => {
            request_if_legal(model, Action::HandValue, OperatorRequest::HandValue(Some(*value)), "not used")
        }
        Question::HandValue { trial, value } => {
            // Back to the field, where typing replaces the number.
            model.dialog = Some(Dialog::field(Purpose::HandValue(*trial), &value.to_string()));
            Vec::new()
        }
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
    let taken = matches!(key.code(), KeyCode::Up | KeyCode::Down | KeyCode::Home | KeyCode::End | KeyCode::Char('x'));
    let arms = !taken && model.keymap.action(key) == Some(Action::Arm) && legal(Action::Arm, model).is_ok();
    arms.then_some(Action::Arm)
}

/// `a` writes all trials, `s` those of the table as shown; every other key cancels.
pub(super) fn export_key(model: &mut Model, key: Key) -> Vec<Effect> {
    match key.typed() {
        Some('a' | 'A') => vec![Effect::Export(ExportedRows::All)],
        Some('s' | 'S') => vec![Effect::Export(ExportedRows::Shown)],
        _ => cancelled(model, "nothing was written"),
    }
}

pub(super) fn arming_checks_key(
    model: &mut Model,
    key: Key,
    (mut selected, mut scroll): (usize, usize),
) -> Vec<Effect> {
    let last = OperatorCheck::ALL.len() - 1;
    let simulated = !model.session.info.is_hardware();
    let mut effects = Vec::new();
    let end = arming::whole(model, dialog_columns(model), None).0.len().saturating_sub(dialog_rows(model)) + 1;
    match key.code() {
        // In simulation nothing is confirmed, so that nothing is chosen.
        KeyCode::Up if simulated => scroll = scroll.saturating_sub(1).max(1),
        KeyCode::Down if simulated => scroll = (scroll.max(1) + 1).min(end),
        KeyCode::Char('x') if simulated => {
            reply(model, LogLevel::Info, "the simulator needs no confirmation");
        }
        // The list would not show it.
        KeyCode::Char('x') if model.arming_checks_are_past() => {
            let reason = "the list is of an earlier time; the checks run while the robot is disarmed";
            effects = refused(model, "not confirmed", reason);
        }
        KeyCode::Up => (selected, scroll) = (selected.saturating_sub(1), 0),
        KeyCode::Down => (selected, scroll) = ((selected + 1).min(last), 0),
        KeyCode::PageUp => scroll = scroll.saturating_sub(CHECKS_PAGE).max(1),
        KeyCode::Home => scroll = 1,
        KeyCode::End => scroll = end,
        // The first page begins at the top.
        KeyCode::PageDown if scroll == 0 => scroll = 1,
        KeyCode::PageDown => scroll = (scroll + CHECKS_PAGE).min(end),
        KeyCode::Char('x') => {
            effects = request(model, OperatorRequest::Confirm(OperatorCheck::ALL[selected.min(last)]))
        }
        // Only one that is refused comes here.
        _ if model.keymap.action(key) == Some(Action::Arm) => {
            if let Err(reason) = legal(Action::Arm, model) {
                effects = refused(model, "not armed", &reason);
            }
        }
        _ => {
            let keys = if simulated { "Up Down PgUp PgDn Home End" } else { "Up Down x PgUp PgDn Home End" };
            unknown_key(model, key, keys);
        }
    }
    model.dialog = Some(Dialog::ArmingChecks { selected, scroll });
    effects
}
