//! The trials of a replay judged again by another configuration.

use quadfrog::recording::record::LogLevel;

use super::request::{reply, say};
use crate::message::{Effect, RejudgeNews};
use crate::model::dialog::{Dialog, Purpose};
use crate::model::rejudged::RejudgedTable;
use crate::model::{Model, View};

/// Asks for the configuration; where the trials are judged again already, removes the new judgements.
pub(super) fn toggle(model: &mut Model) -> Vec<Effect> {
    if model.rejudged.take().is_some() {
        reply(model, LogLevel::Info, "the recorded judgements alone");
        return vec![Effect::EndRejudge];
    }
    model.dialog = Some(Dialog::field(Purpose::Rejudge, ""));
    Vec::new()
}

/// Carries out the choice of the configuration.
pub(super) fn chosen(model: &mut Model, folder: &str) -> Vec<Effect> {
    model.view = View::Trials;
    vec![Effect::Rejudge(folder.to_owned())]
}

pub(super) fn apply(model: &mut Model, news: RejudgeNews) {
    match (news, &mut model.rejudged) {
        (RejudgeNews::Begun { configuration, unit, trials }, _) => {
            model.rejudged =
                Some(RejudgedTable { configuration, unit, count: trials, trials: Default::default(), done: false });
        }
        (RejudgeNews::Trial(trial), Some(table)) => {
            table.trials.insert(trial.trial, *trial);
        }
        (RejudgeNews::Done, Some(table)) => {
            table.done = true;
            let text = format!("judged again by {}: {}", table.configuration, table.summary());
            reply(model, LogLevel::Info, text);
        }
        // The folder is asked again, with what was typed, unless something else was opened meanwhile.
        (RejudgeNews::Failed { folder, reason }, None) if model.dialog.is_none() => {
            model.dialog =
                Some(Dialog::refused_field(Purpose::Rejudge, &folder, format!("not judged again: {reason}")));
        }
        (RejudgeNews::Failed { reason, .. }, _) => {
            model.rejudged = None;
            say(model, LogLevel::Error, format!("not judged again: {reason}"));
        }
        // Ended by the operator meanwhile.
        (RejudgeNews::Trial(_) | RejudgeNews::Done, None) => {}
    }
}
