//! The arming checks: each with the found value and the limit, all failing ones at once.

use quadfrog::recording::record::ArmingCheckRecord;
use quadfrog::session::operator_request::OperatorCheck;
use quadfrog::telemetry::ArmingCheckState;
use ratatui::text::{Line, Span};

use super::draw::{span, truncate};
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};

fn label(state: ArmingCheckState) -> (&'static str, Role) {
    match state {
        ArmingCheckState::Passed => ("ok", Role::Good),
        ArmingCheckState::Failed => ("FAIL", Role::Bad),
        ArmingCheckState::Waiting => ("you", Role::Warning),
        ArmingCheckState::NotNeeded => ("-", Role::Quiet),
    }
}

/// One line for each item; with room for `few` lines only, failing ones first. `selected` is the item that the operator
/// can confirm.
pub fn lines(
    session: &SessionModel,
    theme: &Theme,
    width: usize,
    few: usize,
    selected: Option<OperatorCheck>,
) -> Vec<Line<'static>> {
    let mut items: Vec<&ArmingCheckRecord> = session.arming_checks.iter().collect();
    if items.len() > few {
        items.sort_by_key(|item| item.state.allows());
        items.truncate(few);
    }
    // Half of a narrow terminal has room for the found value alone.
    let wide = width >= 60;
    let name_width = if wide { 27 } else { 1 };
    let line = |item: &ArmingCheckRecord| {
        let (state, role) = label(item.state);
        let selected = selected.is_some_and(|check| check.check() == item.check);
        let name = item.check.name();
        let gap = name_width.max(name.chars().count() + 1) - name.chars().count();
        let text = match (item.found.as_str(), item.needed.as_str()) {
            (found, needed) if wide && item.state != ArmingCheckState::NotNeeded && !needed.is_empty() => {
                format!("{found:<20} {needed}")
            }
            ("", text) | (text, _) => text.to_owned(),
        };
        let text = truncate(&text, width.saturating_sub(6 + name.chars().count() + gap));
        Line::from(vec![
            Span::raw(if selected { ">" } else { " " }),
            span(theme, role, format!("{state:<5}")),
            span(theme, if selected { Role::Selected } else { Role::Text }, name),
            Span::raw(" ".repeat(gap)),
            span(theme, Role::Quiet, text),
        ])
    };
    if items.is_empty() {
        let text = " not checked yet: the checks run while the robot is disarmed";
        return vec![Line::from(span(theme, Role::Quiet, truncate(text, width)))];
    }
    items.into_iter().map(line).collect()
}

/// The number of items that forbid arming, in words.
pub fn summary(session: &SessionModel) -> String {
    match (session.arming_checks.is_empty(), session.failing_checks()) {
        (true, _) => String::new(),
        (false, 0) => "all passed".to_owned(),
        (false, count) => format!("{count} of {} not yet", session.arming_checks.len()),
    }
}
