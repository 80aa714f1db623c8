//! A trial under the charts of a jump, and two trials beside each other: of a session, of a replay or of two recordings.

use std::path::Path;

use quadfrog::printable::shell_word;
use quadfrog::recording::record::LogLevel;
use quadfrog::trial::TrialRecord;

use super::request::reply;
use crate::action::Action;
use crate::message::{ComparedTrial, Effect, ReplayCommand, ReplayStatus, ReplayTimeline, SideBySide};
use crate::model::comparison::Comparison;
use crate::model::dialog::{Dialog, Purpose};
use crate::model::live::Panel;
use crate::model::{Model, View};

/// Lays a trial under the charts of a jump: the selected one in Trials, else the best; a replay reads it first. In Trials a second
/// one compares the two; the same again, or the key in Live, ends it.
pub(super) fn ghost(model: &mut Model) -> Vec<Effect> {
    let (laid, compares) = (model.live.ghost, model.live.comparison.is_some());
    let trial = match model.view {
        View::Trials => model.selected_trial().map(|row| row.trial),
        _ => model.session.trials.best().map(|best| best.trial).or(model.timeline.as_ref().and_then(|all| all.best)),
    };
    let ends = match model.view {
        View::Trials => laid.is_some() && laid == trial && !compares,
        _ => laid.is_some() || compares,
    };
    match trial {
        _ if ends => {
            let text = no_ghost(model);
            reply(model, LogLevel::Info, text);
        }
        Some(trial) if model.timeline.as_ref().is_some_and(|timeline| timeline.has_ticks_of(trial)) => {
            return vec![Effect::Replay(ReplayCommand::Lay(trial))];
        }
        Some(trial) => return lay(model, trial),
        None => reply(model, LogLevel::Info, "no trial was accepted yet"),
    }
    ended(model)
}

/// Lays a trial under the charts, or compares it with the one that lies there.
pub(super) fn lay(model: &mut Model, trial: u32) -> Vec<Effect> {
    let first = model.live.ghost.filter(|first| *first != trial && model.live.comparison.is_none());
    model.live.comparison = None;
    let text = match first {
        Some(first) => second_ghost(model, first, trial),
        None => first_ghost(model, trial),
    };
    reply(model, LogLevel::Info, text);
    ended(model)
}

pub(super) fn no_ghost(model: &mut Model) -> String {
    model.live.ghost = None;
    model.live.comparison = None;
    "no trial is laid under the charts".to_owned()
}

fn first_ghost(model: &mut Model, trial: u32) -> String {
    model.live.ghost = model.history.jump(trial).map(|_| trial);
    if model.live.ghost.is_none() {
        return no_signals(model, trial);
    }
    model.live.panel = Panel::Charts;
    let recorded = |timeline: &ReplayTimeline| timeline.trials.iter().any(|run| run.trial != trial);
    let comparable =
        model.history.traces().any(|other| other != trial) || model.timeline.as_deref().is_some_and(recorded);
    let key = model.keymap.key(Action::Ghost);
    let second = if comparable { format!("; {key} on another row of Trials compares the two") } else { String::new() };
    format!("trial {trial} is laid under the charts of a jump{second}")
}

/// Returns the reason for which the signals of a trial are not here, and the place where they are.
fn no_signals(model: &Model, trial: u32) -> String {
    if model.trial(trial).is_some_and(TrialRecord::was_not_run) {
        return format!("trial {trial} was not run");
    }
    if model.history.whole(trial).is_some() {
        return format!("trial {trial} ended before its impulse: it has no jump for the charts");
    }
    if model.timeline.is_some() {
        return format!("the recording has no ticks of trial {trial}");
    }
    let study = shell_word(Path::new(&model.session.info.study).parent().unwrap_or(Path::new("")));
    match model.session.trials.ran.contains_key(&trial) {
        true => format!("the signals of trial {trial} are not kept any longer: quadfrog replay {study} shows them"),
        false => format!("trial {trial} was recorded in another session: quadfrog replay {study} shows it"),
    }
}

/// Returns the keys of two trials that are laid over each other, in words.
pub(super) fn keys_of_comparison(model: &Model) -> String {
    let [left, right, end] =
        [Action::Left, Action::Right, Action::EndComparison].map(|action| model.keymap.key(action));
    format!("{left} and {right} move the cursor, {end} ends it")
}

fn second_ghost(model: &mut Model, a: u32, b: u32) -> String {
    if model.history.jump(b).is_none() {
        return no_signals(model, b);
    }
    let compared = |trial: u32| ComparedTrial {
        trial,
        row: model.final_row(trial).cloned(),
        unit: model.session.info.unit.clone(),
        recording: None,
    };
    model.live.comparison = Comparison::new(&model.history, compared(a), compared(b));
    match model.live.comparison {
        Some(_) => {
            model.live.panel = Panel::Charts;
            let live = model.keymap.key(Action::LiveView);
            format!("A is trial {a}, B is trial {b}: {live} shows both in Live; there {}", keys_of_comparison(model))
        }
        None => no_signals(model, a),
    }
}

/// Lays the selected trial of Trials beside the one at the playhead; elsewhere, and with a second recording, asks for a number.
pub(super) fn begin(model: &mut Model) -> Vec<Effect> {
    let present = model.replay.as_ref().and_then(|replay| replay.present);
    let one_recording = model.timeline.as_ref().is_some_and(|timeline| timeline.second.is_none());
    let selected = model.selected_trial().map(|trial| trial.trial).filter(|trial| Some(*trial) != present);
    if let Some(trial) = selected.filter(|_| model.view == View::Trials && one_recording) {
        return chosen(model, trial).unwrap_or_else(|reason| {
            reply(model, LogLevel::Warning, reason);
            Vec::new()
        });
    }
    model.dialog = Some(Dialog::field(Purpose::Beside, ""));
    Vec::new()
}

/// Carries out the choice of the second trial.
///
/// # Errors
/// The reason when it cannot be laid beside the one at the playhead.
pub(super) fn chosen(model: &mut Model, trial: u32) -> Result<Vec<Effect>, String> {
    let Some(timeline) = &model.timeline else { return Ok(Vec::new()) };
    if !timeline.has_beside(trial) {
        let place = timeline.second.as_ref().map_or("this recording", |second| second.name.as_str());
        return Err(format!("trial {trial} is not in {place}"));
    }
    if timeline.second.is_none() && model.replay.as_ref().is_some_and(|replay| replay.present == Some(trial)) {
        return Err(format!("trial {trial} is the one at the playhead"));
    }
    model.view = View::Live;
    model.live.panel = Panel::Charts;
    Ok(vec![Effect::Replay(ReplayCommand::Beside(trial))])
}

/// Shows two trials; the cursor is at the playhead while A contains it, else where the impulses begin.
pub(super) fn show(model: &mut Model, both: &SideBySide) {
    let Some(mut comparison) = Comparison::side_by_side(both) else { return };
    if let Some(replay) = &model.replay {
        comparison.follow(replay.time_ns);
    }
    let before = model.live.comparison.as_ref().map(|shown| (shown.b.trial, shown.b.recording.clone()));
    if before != Some((both.b.trial, both.b.recording.clone())) {
        let place = if both.b.recording.is_some() { " of the second recording" } else { "" };
        let keys = keys_of_comparison(model);
        let text = format!("A is trial {}, B is trial {}{place}; {keys}", both.a.trial, both.b.trial);
        reply(model, LogLevel::Info, text);
    }
    model.live.ghost = None;
    model.live.comparison = Some(comparison);
}

/// Moves the cursor of a comparison with the playhead.
pub(super) fn follow(model: &mut Model, status: &ReplayStatus) {
    let moved = model.replay.as_ref().is_none_or(|before| before.time_ns != status.time_ns);
    if let Some(comparison) = model.live.comparison.as_mut().filter(|_| moved) {
        comparison.follow(status.time_ns);
    }
}

/// The effect on a replay of a comparison that has ended.
pub(super) fn ended(model: &Model) -> Vec<Effect> {
    match model.live.comparison {
        None if model.replay.is_some() => vec![Effect::Replay(ReplayCommand::EndBeside)],
        _ => Vec::new(),
    }
}
