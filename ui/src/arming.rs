//! The arming checks: each with the found value and the limit, all failing ones at once.

use std::ops::Range;

use quadfrog::recording::record::ArmingCheckRecord;
use quadfrog::session::operator_request::OperatorCheck;
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState};
use ratatui::text::{Line, Span};

use crate::action::Action;
use crate::draw::{span, truncate, wall_clock};
use crate::model::Model;
use crate::theme::Role;
use crate::wrap::wrap;

/// Columns of the longest name.
const NAME_WIDTH: usize = 27;
/// Columns from which found value and limit stand side by side.
const WIDE: usize = 60;

fn label(state: ArmingCheckState) -> (&'static str, Role) {
    match state {
        ArmingCheckState::Passed => ("ok", Role::Good),
        ArmingCheckState::Failed => ("FAIL", Role::Bad),
        ArmingCheckState::Waiting => ("you", Role::Warning),
        ArmingCheckState::NotNeeded => ("n/a", Role::Quiet),
    }
}

/// The items in the order in which they matter: failing ones, those that the operator fulfils, the others, and last those that
/// are not needed. A confirmation moves no item.
fn ordered(model: &Model) -> Vec<&ArmingCheckRecord> {
    let of_operator = |item: &ArmingCheckRecord| {
        item.check == ArmingCheck::StopTested || OperatorCheck::ALL.iter().any(|check| check.check() == item.check)
    };
    let rank = |item: &&ArmingCheckRecord| match item.state {
        ArmingCheckState::Failed => 0,
        ArmingCheckState::NotNeeded => 3,
        _ if of_operator(item) => 1,
        _ => 2,
    };
    let mut items: Vec<&ArmingCheckRecord> = model.session.arming_checks.iter().collect();
    items.sort_by_key(rank);
    items
}

/// One line for each item, cut at `width`, in `few` lines: the last one counts those without room.
pub fn lines(model: &Model, width: usize, few: usize) -> Vec<Line<'static>> {
    let mut items = ordered(model);
    let mut without_room = 0;
    if items.len() > few {
        without_room = items.len() + 1 - few;
        items.truncate(few.saturating_sub(1));
    }
    if items.is_empty() {
        let text = match model.session.info.observe {
            true => " not checked: a session that only observes does not arm",
            false => " not checked yet: the checks run while the robot is disarmed",
        };
        return wrap(&Line::from(span(&model.theme, Role::Quiet, text)), width, 1);
    }
    // Half of a narrow terminal has room for the found value alone.
    let name_width = if width >= WIDE { NAME_WIDTH } else { 1 };
    let mut lines: Vec<Line> =
        items.into_iter().map(|item| line(model, item, (name_width, Some(width)), false)).collect();
    if without_room > 0 {
        let text = format!(" {without_room} more: {} shows all", model.keymap.key(Action::ArmingChecks));
        lines.push(Line::from(span(&model.theme, Role::Quiet, truncate(&text, width))));
    }
    lines
}

/// All items, whole: each continues on further lines where `width` is too small. Returns also the lines of `selected`, the
/// item that the operator can confirm.
pub fn whole(model: &Model, width: usize, selected: Option<OperatorCheck>) -> (Vec<Line<'static>>, Range<usize>) {
    if model.session.arming_checks.is_empty() {
        return (lines(model, width, 1), 0..1);
    }
    let (mut all, mut of_selected) = (Vec::new(), 0..0);
    for item in ordered(model) {
        let chosen = selected.is_some_and(|check| check.check() == item.check);
        let pieces = wrap(&line(model, item, (NAME_WIDTH, None), chosen), width, 6 + NAME_WIDTH);
        if chosen {
            of_selected = all.len()..all.len() + pieces.len();
        }
        all.extend(pieces);
    }
    (all, of_selected)
}

/// State, name, found value and limit of an item. Once the robot is armed they are those of an earlier time: grey.
fn line(
    model: &Model,
    item: &ArmingCheckRecord,
    (name_width, width): (usize, Option<usize>),
    selected: bool,
) -> Line<'static> {
    let theme = &model.theme;
    let past = model.arming_checks_are_past();
    let (state, role) = label(item.state);
    let role = if past { Role::Quiet } else { role };
    let name = item.check.name();
    let gap = name_width.max(name.chars().count() + 1) - name.chars().count();
    let wide = width.is_none_or(|width| width >= WIDE);
    let text = match (item.found.as_str(), item.needed.as_str()) {
        // A value of an earlier time that decided nothing.
        (found, _) if past && item.state == ArmingCheckState::NotNeeded && !found.is_empty() => String::new(),
        (found, needed) if wide && item.state == ArmingCheckState::NotNeeded && !found.is_empty() => {
            format!("{found} ({needed})")
        }
        (found, needed) if wide && !needed.is_empty() => {
            format!("{found} (needed: {needed})")
        }
        ("", text) | (text, _) => text.to_owned(),
    };
    let room = width.map_or(usize::MAX, |width| width.saturating_sub(6 + name.chars().count() + gap));
    let name_role = match (selected, past) {
        (true, _) => Role::Selected,
        (false, true) => Role::Quiet,
        (false, false) => Role::Text,
    };
    Line::from(vec![
        Span::raw(if selected { ">" } else { " " }),
        span(theme, role, format!("{state:<5}")),
        span(theme, name_role, name),
        Span::raw(" ".repeat(gap)),
        span(theme, Role::Quiet, truncate(&text, room)),
    ])
}

/// The number of items that forbid arming, in words, with the time of the checks once the robot is armed.
pub fn summary(model: &Model) -> String {
    match checked_at(model) {
        Some(at) => format!("at {at}: {}", result(model)),
        None => result(model),
    }
}

/// The title of the list of all items; `short` for a narrow terminal.
pub fn title(model: &Model, short: bool) -> String {
    match checked_at(model) {
        Some(at) if short => format!("Checks at {at}: {}", result(model)),
        Some(at) => format!("Arming checks at {at}: {}", result(model)),
        None => format!("Arming checks: {}", result(model)),
    }
}

fn result(model: &Model) -> String {
    let session = &model.session;
    let needed = session.arming_checks.iter().filter(|item| item.state != ArmingCheckState::NotNeeded).count();
    match (session.arming_checks.is_empty(), session.failing_checks()) {
        (true, _) if session.info.observe => "none of an observer".to_owned(),
        (true, _) => "not yet".to_owned(),
        (false, 0) => format!("{needed} passed"),
        (false, count) => format!("{count} of {needed} not yet"),
    }
}

/// The time of the checks once the robot is armed; none of checks that have not been.
pub fn checked_at(model: &Model) -> Option<String> {
    model.arming_checks_are_past().then(|| wall_clock(model, model.session.arming_checked_ns))
}
