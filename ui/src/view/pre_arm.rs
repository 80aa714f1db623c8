//! The pre-arm list: every item with what was found and what is needed, all failing ones at once.
//!
//! ```text
//! ok    upright                     0.02 rad              at most 0.2 rad
//! FAIL  battery                     21 %                  at least 30 %
//! >word area clear, remote in hand  x gives your word
//! ```

use quadfrog::recording::record::ArmingCheckRecord;
use quadfrog::session::operator_request::OperatorCheck;
use quadfrog::telemetry::ArmingCheckState;
use ratatui::text::{Line, Span};

use super::{cut, span};
use crate::model::Model;
use crate::theme::Role;

/// A word and a role for how a check stands.
fn mark(state: ArmingCheckState) -> (&'static str, Role) {
    match state {
        ArmingCheckState::Passed => ("ok", Role::Good),
        ArmingCheckState::Failed => ("FAIL", Role::Bad),
        ArmingCheckState::Waiting => ("you", Role::Warning),
        ArmingCheckState::NotNeeded => ("-", Role::Quiet),
    }
}

/// One line for each item, failing ones first where `few` lines are all that there is room for. `chosen` is the item that
/// the operator is about to give their word on.
pub fn lines(model: &Model, width: usize, few: usize, chosen: Option<OperatorCheck>) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let mut items: Vec<&ArmingCheckRecord> = model.pre_arm.iter().collect();
    if items.len() > few {
        items.sort_by_key(|item| item.state.allows());
        items.truncate(few);
    }
    // Half of a narrow terminal has room for what was found alone.
    let name_width = if width < 60 { 1 } else { 27 };
    let line = |item: &ArmingCheckRecord| {
        let (word, role) = mark(item.state);
        let selected = chosen.is_some_and(|check| check.check() == item.check);
        let name = item.check.name();
        let gap = name_width.max(name.chars().count() + 1) - name.chars().count();
        let text = match (item.found.as_str(), item.needed.as_str()) {
            (found, needed) if item.state == ArmingCheckState::NotNeeded || width < 60 || needed.is_empty() => {
                if found.is_empty() { needed.to_owned() } else { found.to_owned() }
            }
            (found, needed) => format!("{found:<20} {needed}"),
        };
        let text = cut(&text, width.saturating_sub(6 + name.chars().count() + gap));
        Line::from(vec![
            Span::raw(if selected { ">" } else { " " }),
            span(theme, role, format!("{word:<5}")),
            span(theme, if selected { Role::Selected } else { Role::Text }, name),
            Span::raw(" ".repeat(gap)),
            span(theme, Role::Quiet, text),
        ])
    };
    if items.is_empty() {
        let text = " not looked at yet: the list is made while the robot is disarmed";
        return vec![Line::from(span(theme, Role::Quiet, cut(text, width)))];
    }
    items.into_iter().map(line).collect()
}

/// How many items forbid arming, in words.
pub fn summary(model: &Model) -> String {
    match (model.pre_arm.is_empty(), model.pre_arm_failing().count()) {
        (true, _) => String::new(),
        (false, 0) => "all passed".to_owned(),
        (false, count) => format!("{count} of {} not yet", model.pre_arm.len()),
    }
}
