//! Two trials of a replay, or of two recordings, beside each other.

use quadfrog::recording::record::LogLevel;

use super::navigate::keys_of_comparison;
use super::request::reply;
use crate::message::{Effect, ReplayCommand, ReplayStatus, SideBySide};
use crate::model::comparison::Comparison;
use crate::model::dialog::{Dialog, Purpose};
use crate::model::live::Panel;
use crate::model::{Model, View};

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
