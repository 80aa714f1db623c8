//! The message line, requests to the session, and STOP.

use std::time::Duration;

use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::OperatorRequest;

use crate::keymap::Key;
use crate::legal::{NO_ROBOT_TO_STOP, may_acknowledge, may_request};
use crate::message::Effect;
use crate::model::dialog::{Dialog, Purpose};
use crate::model::{Model, Notice};

/// A second Ctrl-C within this time quits.
const INTERRUPT_WINDOW: Duration = Duration::from_secs(2);

/// End of the message that offers to quit.
const AGAIN_QUITS: &str = "Ctrl-C again within 2 s quits";

/// Takes the offer to quit from the message line once it does not hold any more.
pub(super) fn expire_interrupt(model: &mut Model) {
    if model.interrupted_at.is_none_or(|at| model.clock.saturating_sub(at) < INTERRUPT_WINDOW) {
        return;
    }
    model.interrupted_at = None;
    if let Some(message) = &mut model.message
        && let Some(answer) = message.text.strip_suffix(AGAIN_QUITS)
    {
        message.text = answer.trim_end().to_owned();
    }
}

/// Reports something of the session to the operator.
pub fn say(model: &mut Model, level: LogLevel, text: impl Into<String>) {
    model.message = Some(Notice { level, text: text.into(), stop: false, answer: false, own: false, at: model.clock });
}

/// Answers a request or a key of the operator: until the next key that has an effect, at most for the time of an answer.
pub fn reply(model: &mut Model, level: LogLevel, text: impl Into<String>) {
    model.message = Some(Notice { level, text: text.into(), stop: false, answer: true, own: true, at: model.clock });
}

/// Shows an answer that the operator of a session has got whom this console replays or watches.
pub(super) fn quote(model: &mut Model, level: LogLevel, text: &str) {
    reply(model, level, format!("the operator: {text}"));
    model.message.iter_mut().for_each(|message| message.own = false);
}

/// Removes the answer to an earlier key.
pub(super) fn drop_answer(model: &mut Model) {
    model.message.take_if(|message| message.answer);
}

/// Removes an answer whose time is over.
pub(super) fn expire_answer(model: &mut Model) {
    let clock = model.clock;
    model.message.take_if(|message| message.answer && message.is_old(clock));
}

/// Answers the STOP key.
fn say_stop(model: &mut Model, text: &str) {
    let (level, text) = (LogLevel::Warning, text.to_owned());
    model.message = Some(Notice { level, text, stop: true, answer: false, own: true, at: model.clock });
}

/// Returns the answer to a key without a meaning; `keys` names those that work.
pub(super) fn does_nothing(key: Key, keys: &str) -> String {
    format!("{key} does nothing here; {keys}")
}

/// Answers a key without a meaning in a dialog that only shows something; `keys` are those that have one, before those that close.
pub(super) fn unknown_key(model: &mut Model, key: Key, keys: &str) {
    let all = format!("{keys} {}", model.keymap.closing_keys());
    reply(model, LogLevel::Info, does_nothing(key, &format!("{} do", all.trim_start())));
}

/// Reports that a dialog ended without effect.
pub(super) fn cancelled(model: &mut Model, text: &str) -> Vec<Effect> {
    reply(model, LogLevel::Info, format!("cancelled: {text}"));
    Vec::new()
}

/// Reports why something was not done.
pub(super) fn refused(model: &mut Model, subject: &str, reason: &str) -> Vec<Effect> {
    reply(model, LogLevel::Warning, format!("{subject}: {reason}"));
    Vec::new()
}

/// Sends a request to the session, except in a replay or from an observer.
pub(super) fn request(model: &mut Model, request: OperatorRequest) -> Vec<Effect> {
    if matches!(request, OperatorRequest::Arm | OperatorRequest::Approve { .. }) {
        // Charts of the past beside a robot that moves would be taken for the present, and an earlier row for the trial.
        model.live.frozen = None;
        model.trial_table.selected = None;
    }
    let allowed = if request == OperatorRequest::Acknowledge { may_acknowledge(model) } else { may_request(model) };
    match allowed {
        Ok(()) => vec![Effect::Request(request)],
        Err(reason) => refused(model, "refused", &reason),
    }
}

/// Stops the robot. The dialog closes, so that the robot is visible, and nothing of it is carried out; a half-written note, which
/// changes nothing, stays.
pub(super) fn stop(model: &mut Model) -> Vec<Effect> {
    match model.observer() {
        Some(observer) if observer.ended => {
            reply(model, LogLevel::Error, "the session has ended: its robot cannot be stopped from here");
            return Vec::new();
        }
        Some(_) => {
            say_stop(model, "STOP demanded from the session");
            return vec![Effect::Stop];
        }
        None => {}
    }
    if model.replay.is_some() {
        reply(model, LogLevel::Info, NO_ROBOT_TO_STOP);
        return Vec::new();
    }
    let dropped = match &model.dialog {
        Some(Dialog::Override(form)) if form.is_changed() => ". The form was closed, its values are not applied",
        Some(Dialog::Field { purpose, .. }) => match purpose {
            Purpose::HandValue(_)
            | Purpose::Continue
            | Purpose::Fix { .. }
            | Purpose::Bounds { .. }
            | Purpose::ConfirmBest => ". The form was closed, its values are not applied",
            Purpose::VoidReason { .. } | Purpose::ChangeVerdict { .. } => ". The form was closed, no verdict was given",
            Purpose::Note(_)
            | Purpose::TrialNumber
            | Purpose::LogSearch
            | Purpose::Seek
            | Purpose::Beside
            | Purpose::Rejudge => "",
        },
        _ => "",
    };
    if !matches!(model.dialog, Some(Dialog::Field { purpose: Purpose::Note(_), .. })) {
        model.dialog = None;
    }
    let text = match model.session.info.observe {
        true => "STOP requested: damping is sent, a console in control may go on commanding".to_owned(),
        false => format!("STOP: damping{dropped}"),
    };
    say_stop(model, &text);
    vec![Effect::Stop]
}

/// Stops the robot; a second time within the window quits.
pub(super) fn interrupt(model: &mut Model) -> Vec<Effect> {
    let again = model.interrupted_at.is_some_and(|at| model.clock.saturating_sub(at) < INTERRUPT_WINDOW);
    model.interrupted_at = Some(model.clock);
    if again {
        return vec![Effect::Quit];
    }
    let effects = stop(model);
    // The answer to STOP stays: it says what STOP has reached.
    if let Some(answer) = &mut model.message {
        answer.text += &format!(". {AGAIN_QUITS}");
    }
    effects
}
