//! The help overlay, made of the active keymap.

use ratatui::text::Line;
use strum::VariantArray;

use crate::action::{ACTIONS, Action, ActionGroup, ActionInfo};
use crate::draw::span;
use crate::legal::{has_meaning, legal};
use crate::model::Model;
use crate::theme::Role;

/// Columns before the text of an action.
pub const INDENT: usize = 13;

/// The keys by group: in a replay those of the replay first and none that commands a robot, in the console of an observer STOP, and
/// while a trial waits for its verdict those of the verdict.
pub fn lines(model: &Model) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let mut lines = Vec::new();
    let mut groups = ActionGroup::VARIANTS.to_vec();
    let first = match (&model.replay, model.session.under_review()) {
        (Some(replay), _) if replay.observer.is_none() => Some(ActionGroup::Replay),
        (Some(_), _) => Some(ActionGroup::Robot),
        (None, Some(_)) => Some(ActionGroup::Verdict),
        (None, None) => None,
    };
    groups.sort_by_key(|group| first.is_some_and(|first| *group != first));
    for group in groups {
        let actions: Vec<_> =
            ACTIONS.iter().filter(|info| info.group == group && has_meaning(info.action, model)).collect();
        if actions.is_empty() {
            continue;
        }
        if !lines.is_empty() {
            lines.push(Line::default());
        }
        lines.push(Line::from(span(theme, Role::Heading, <&str>::from(group))));
        for info in actions {
            let legal = legal(info.action, model).is_ok();
            let (key, text) = if legal { (Role::Key, Role::Text) } else { (Role::Quiet, Role::Quiet) };
            lines.push(Line::from(vec![
                span(theme, key, format!("  {:<10} ", model.keymap.all_keys(info.action))),
                span(theme, text, text_of(info, model)),
            ]));
        }
    }
    lines
}

/// The text of an action; of the key that stops and quits, where nothing can be stopped, without STOP, and of those that arm and
/// approve a real robot with its confirmations.
pub fn text_of(info: &ActionInfo, model: &Model) -> &'static str {
    let hardware = model.session.info.is_hardware();
    match info.action {
        Action::Interrupt if !model.can_stop() => "twice within 2 s: quit",
        Action::Arm if hardware => "arm: type the letters that it asks for, the robot stands up",
        Action::Approve if hardware => "approve the jump; y: the area is clear; again after 0.8 s: countdown and jump",
        _ => info.help,
    }
}
