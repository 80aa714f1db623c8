//! The keys of the selected row of Trials, and those of two trials that are laid over each other, for the last line.

use quadfrog::telemetry::Mode;

use crate::action::Action;
use crate::legal::legal;
use crate::model::live::Panel;
use crate::model::{Model, View};

/// Keys and their effects, as far as they are accepted now; none in other views.
pub fn keys(model: &Model) -> Vec<(String, String)> {
    // Any of them would cancel it.
    if model.mode() == Mode::Countdown && model.replay.is_none() {
        return Vec::new();
    }
    match model.view {
        View::Trials => of_row(model),
        View::Live if model.live.comparison.is_some() => of_comparison(model),
        _ => Vec::new(),
    }
}

fn of_comparison(model: &Model) -> Vec<(String, String)> {
    let key = |action| model.keymap.key(action);
    // The charts have the cursor; joints and robot in their place do not.
    let cursor = (format!("{} {}", key(Action::Left), key(Action::Right)), "cursor".to_owned());
    let mut keys = if model.live.panel == Panel::Charts { vec![cursor] } else { Vec::new() };
    // The last line of a replay names it already.
    if model.replay.is_none() {
        keys.insert(0, (key(Action::EndComparison), "end comparison".to_owned()));
    }
    keys
}

fn of_row(model: &Model) -> Vec<(String, String)> {
    let Some(trial) = model.selected_trial().map(|row| row.trial) else { return Vec::new() };
    let key = |action| model.keymap.key(action);
    let recorded = model.timeline.as_ref().is_some_and(|timeline| timeline.has_ticks_of(trial));
    let goes_there = recorded && model.snapshot.tick.trial != Some(trial);
    let open = if goes_there { "go to it" } else { "open" };
    let mut keys = vec![(key(Action::Open), open.to_owned())];
    if recorded || model.history.jump(trial).is_some() {
        let text = match model.live.ghost {
            _ if model.live.comparison.is_some() => "compare anew",
            Some(laid) if laid == trial => "clear",
            _ => "compare",
        };
        keys.push((key(Action::Ghost), text.to_owned()));
    }
    // The step itself names the verdicts of a trial that waits.
    if model.session.under_review().is_some() {
        return keys;
    }
    let accepted = |action: &Action| legal(*action, model).is_ok();
    // Undo takes the place of the verdicts of the last judged row.
    if model.session.undoable() == Some(trial) && accepted(&Action::Undo) {
        keys.push((key(Action::Undo), format!("undo #{trial}")));
    }
    let verdicts: Vec<String> =
        [Action::Accept, Action::Fall, Action::Void].into_iter().filter(accepted).map(key).collect();
    if !verdicts.is_empty() {
        keys.push((verdicts.join(" "), "judge".to_owned()));
    }
    if accepted(&Action::Rerun) {
        keys.push((key(Action::Rerun), "re-run".to_owned()));
    }
    keys
}
