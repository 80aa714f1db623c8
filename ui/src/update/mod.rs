//! The only code that changes the [`Model`]: messages in, effects out.
//!
//! `perform` carries out an action, `navigate` moves within views, `dialog` handles keys while a dialog is open, `records`
//! folds the session's records, `beside` lays two trials over each other, `rejudged` judges trials again, `mouse` handles the mouse, `request` writes the message line and makes requests.

mod beside;
mod dialog;
mod mouse;
mod navigate;
mod perform;
mod records;
mod rejudged;
mod request;

use quadfrog::printable::is_unprintable;
use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use ratatui::layout::Size;

use crate::action::Action;
use crate::keymap::Key;
use crate::layout::{COMPACT_COLUMNS, COMPACT_ROWS, compact_areas};
use crate::legal::{may_request, view_keys_keep_countdown};
use crate::message::{Effect, Msg};
use crate::model::Model;
use crate::model::dialog::Dialog;
use crate::model::jump_series::JumpSeries;
use crate::model::session::SessionModel;
use crate::settings::BellCause;
use dialog::KeyOutcome;
use perform::perform;
use request::{does_nothing, drop_answer, expire_answer, expire_interrupt, interrupt, request, stop};

pub use request::{reply, say};

/// Folds one message into the model.
pub fn update(model: &mut Model, msg: Msg) -> Vec<Effect> {
    let was_open = model.dialog.is_some();
    let pressed = if let Msg::Key(key) = msg { Some(key) } else { None };
    let effects = fold(model, msg);
    let playing = model.replay.as_ref().is_some_and(|replay| replay.playing);
    // Frozen charts beside another place of the recording would be taken for those of that place.
    if effects.iter().any(|effect| matches!(effect, Effect::Replay(command) if command.leaves_the_place(playing))) {
        model.live.frozen = None;
    }
    if model.dialog.is_some() && !was_open {
        model.dialog_opened_at = model.clock;
        if let Some(key) = pressed {
            close_unseen_field(model, key);
        }
    }
    effects
}

/// Closes a field or a form that a key has opened where the terminal has no room to show it.
fn close_unseen_field(model: &mut Model, key: Key) {
    let drawn = compact_areas(Size::from(model.size)).is_some();
    if !drawn && model.dialog.take_if(|dialog| dialog.holds_values()).is_some() {
        let enlarge =
            format!("enlarge the terminal to {COMPACT_COLUMNS}x{COMPACT_ROWS}: what is typed must be visible");
        reply(model, LogLevel::Warning, format!("{key} is not possible: {enlarge}"));
    }
}

fn fold(model: &mut Model, msg: Msg) -> Vec<Effect> {
    match msg {
        Msg::Key(key) => return press(model, key),
        Msg::Mouse(event) => return mouse::handle(model, event),
        Msg::Record(stamped) => return records::apply_beside_answer(model, stamped),
        Msg::Suspend => return perform(model, Action::Suspend),
        Msg::Clock(now) => {
            model.clock = now;
            expire_interrupt(model);
            expire_answer(model);
            records::end_answer(model);
            records::show_reason_again(model);
        }
        Msg::Resize(columns, rows) => {
            model.size = (columns, rows);
            // The frame, the tabs, a heading and the two lines below are not part of a page.
            model.page = usize::from(rows.saturating_sub(7)).max(1);
        }
        Msg::Background(background) if model.follow_background => model.theme.background = background,
        Msg::Background(_) => {}
        Msg::Paste(text) => paste(model, &text),
        Msg::Snapshot(snapshot) => {
            // The newest tick is read again until there is another: only that is news.
            if snapshot.tick.number != model.snapshot.tick.number {
                model.snapshot_at = model.clock;
            }
            model.snapshot = *snapshot;
            model.health_history.see_lateness(&model.snapshot.lateness);
            records::close_stale_dialog(model);
            return count_down(model);
        }
        Msg::Recorder(status) => model.recorder = Some(status),
        Msg::Viewers(status) => model.viewers = Some(status),
        Msg::Observers(count) => model.observers = Some(count),
        Msg::Storage(wait) => model.storage = wait,
        Msg::Tick(tick) => {
            model.jump_series.push(&tick);
            model.history.push(&tick, model.runs_real_robot());
            model.health_history.push(&tick, &model.snapshot.counters, model.robot_is_silent());
        }
        Msg::Replay(status) => {
            beside::follow(model, &status);
            model.replay = Some(status);
        }
        Msg::EarlierJump { trial, ticks } if model.replay.is_some() => {
            model.history.read_trace(trial, &ticks);
            return beside::lay(model, trial);
        }
        Msg::EarlierJump { trial, ticks } => model.history.add_trace(trial, &ticks),
        Msg::Answer(text) => reply(model, LogLevel::Info, text),
        Msg::Rejudged(news) => rejudged::apply(model, news),
        Msg::SideBySide(both) => beside::show(model, &both),
        Msg::Timeline(timeline) => model.timeline = Some(timeline),
        Msg::Rewound => {
            model.session = SessionModel::default();
            // It was about a later time of the recording.
            model.message = None;
            model.message_after_answer = None;
            model.history.clear();
            model.jump_series = JumpSeries::default();
            model.health_history.clear();
            model.log_view.back = 0;
        }
        Msg::Resumed => model.session.arming_checks.clear(),
        Msg::Leaving => {
            // In an open field Space would type.
            model.dialog = None;
            model.leaving = true;
        }
    }
    Vec::new()
}

/// Rings the bell at the beginning of the countdown and of each of its seconds.
fn count_down(model: &mut Model) -> Vec<Effect> {
    let left_s = -model.snapshot.tick.trial_time_s;
    let left = (model.mode() == Mode::Countdown && left_s > 0.0).then(|| left_s.ceil() as u32);
    let rings = left.is_some() && left != model.countdown_s && model.replay.is_none();
    model.countdown_s = left;
    if rings && model.bell.contains(&BellCause::Countdown) { vec![Effect::Bell] } else { Vec::new() }
}

/// One key. STOP comes before everything else, on every screen.
fn press(model: &mut Model, key: Key) -> Vec<Effect> {
    let action = model.keymap.action(key);
    match action {
        Some(Action::Stop) if key.typed().is_some() && model.space_bar_is_text() => {}
        Some(Action::Stop) => return stop(model),
        Some(Action::Interrupt) => return interrupt(model),
        _ => {}
    }
    let looks = action.is_some_and(Action::opens_view) && view_keys_keep_countdown(model);
    if model.mode() == Mode::Countdown && may_request(model).is_ok() && !looks {
        return cancel_countdown(model, key);
    }
    if let Some(dialog) = model.dialog.take() {
        drop_answer(model);
        return match dialog::key(model, dialog, key) {
            KeyOutcome::Effects(effects) => effects,
            KeyOutcome::Perform(action) => perform(model, action),
        };
    }
    match action {
        Some(action) => perform(model, action),
        None => {
            let help = model.keymap.key(Action::Help);
            reply(model, LogLevel::Info, does_nothing(key, &format!("{help} shows the keys")));
            Vec::new()
        }
    }
}

/// Cancels a countdown with a key. A text that is half written stays open and takes the character of the key: the letters behind it
/// would be commands. No text is confirmed or dropped, and any other dialog closes.
fn cancel_countdown(model: &mut Model, key: Key) -> Vec<Effect> {
    drop_answer(model);
    let cancel = request(model, OperatorRequest::Cancel);
    match model.dialog.take().filter(Dialog::takes_text) {
        Some(dialog) if key.typed().is_some() => match dialog::key(model, dialog, key) {
            KeyOutcome::Effects(effects) => [cancel, effects].concat(),
            KeyOutcome::Perform(_) => cancel,
        },
        text => {
            model.dialog = text;
            cancel
        }
    }
}

/// Types pasted text where text is taken; control characters are dropped, and no character acts as a key.
fn paste(model: &mut Model, text: &str) {
    if !model.dialog.as_ref().is_some_and(Dialog::takes_text) {
        return;
    }
    for c in text.chars().filter(|c| !is_unprintable(*c)) {
        if let (Ok(key), Some(dialog)) = (c.to_string().parse::<Key>(), model.dialog.take()) {
            dialog::key(model, dialog, key);
        }
    }
}
