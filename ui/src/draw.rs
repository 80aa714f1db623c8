//! Parts that several panels draw, and the formats of numbers and times.

use std::time::Duration;

use jiff::Timestamp;
use jiff::tz::TimeZone;
use quadfrog::printable::is_unprintable;
pub use quadfrog::trial::four_digits as number;
use quadfrog::trial::{ExpectedResult, FallRisk, TrialRecord, Verdict};
use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use crate::column::Column;
use crate::model::Model;
use crate::model::trials::measured;
use crate::theme::{Role, Theme};
pub use crate::wrap::columns;
use crate::wrap::unbroken;

pub fn span(theme: &Theme, role: Role, text: impl Into<String>) -> Span<'static> {
    Span::styled(text.into(), theme.style(role))
}

/// In place of what is not known of a robot that sends no states.
pub const NO_STATE: &str = "no state from the robot";

/// Columns of a heading with both its texts.
pub fn heading_width(title: &str, aside: &str) -> usize {
    columns(title) + columns(aside) + 4
}

/// A heading with a line to the right edge; returns the area below it.
pub fn heading(frame: &mut Frame, area: Rect, theme: &Theme, title: &str, aside: &str) -> Rect {
    let [top, rest] = Layout::vertical([Constraint::Length(1), Constraint::Fill(1)]).areas(area);
    // Where there is no room for both, the title stays.
    let aside = if heading_width(title, aside) > usize::from(area.width) { "" } else { aside };
    let used = columns(title) + columns(aside) + 2 + usize::from(!aside.is_empty());
    let fill = theme.line().repeat(usize::from(area.width).saturating_sub(used));
    let mut spans = vec![span(theme, Role::Heading, title), Span::raw(" "), span(theme, Role::Quiet, fill)];
    if !aside.is_empty() {
        spans.extend([Span::raw(" "), span(theme, Role::Quiet, aside)]);
    }
    frame.render_widget(Line::from(spans), top);
    rest
}

/// The falls among the nearest judged trials, in words: `2 of the 5 nearest trials fell`.
pub fn falls_near(risk: &FallRisk) -> String {
    match (risk.falls, risk.neighbours) {
        (0, 1) => "the only judged trial stood".to_owned(),
        (_, 1) => "the only judged trial fell".to_owned(),
        (0, of) => format!("none of the {of} nearest trials fell"),
        (falls, of) if falls == of => format!("all {of} nearest trials fell"),
        (falls, of) => format!("{falls} of the {of} nearest trials fell"),
    }
}

/// A value with its standard deviation and its unit: `0.612 ±0.031 m`.
pub fn with_deviation(theme: &Theme, value: f64, deviation: f64, unit: &str) -> String {
    format!("{} {}{} {unit}", number(value), theme.plus_minus(), number(deviation))
}

/// Expectation of the sampler's model of a trial: `expected 0.612 ±0.031 m, stands with 93 %`.
pub fn expectation(theme: &Theme, expected: &ExpectedResult, unit: &str) -> String {
    let value = with_deviation(theme, expected.value, expected.deviation, unit);
    format!("expected {value}, {}", unbroken(&format!("stands with {:.0} %", 100.0 * expected.p_stand)))
}

/// Hours, minutes and seconds of a time in ns; hours only where there are any.
pub fn clock(time_ns: u64) -> String {
    let seconds = time_ns / 1_000_000_000;
    let (h, m, s) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if h > 0 { format!("{h}:{m:02}:{s:02}") } else { format!("{m:02}:{s:02}") }
}

/// The time of day, `14:03:12`, of a time in ns since the session began, in the time zone of the system; in a replay by the
/// clock of the session that recorded it. Without a known begin the time since then.
pub fn wall_clock(model: &Model, time_ns: u64) -> String {
    let recorded = model.timeline.as_ref().and_then(|timeline| timeline.utc_ns(time_ns));
    let recorded = recorded.and_then(|utc_ns| Timestamp::from_nanosecond(utc_ns.into()).ok());
    let begun = || model.session.info.started.parse::<Timestamp>().ok();
    let at = recorded.or_else(|| begun()?.checked_add(Duration::from_nanos(time_ns)).ok());
    at.map_or_else(|| clock(time_ns), |at| at.to_zoned(TimeZone::system()).strftime("%H:%M:%S").to_string())
}

pub fn clock_ms(time_ns: u64) -> String {
    format!("{}.{:03}", clock(time_ns), time_ns / 1_000_000 % 1000)
}

/// The text cut to a number of columns, ending in `..` where something is missing.
pub fn truncate(text: &str, width: usize) -> String {
    if columns(text) <= width {
        return text.to_owned();
    }
    let whole = Span::raw(text);
    let mut room = width.saturating_sub(2);
    let fits = |symbol: &&str| {
        let left = room.checked_sub(columns(symbol));
        room = left.unwrap_or(0);
        left.is_some()
    };
    let short: String = whole.styled_graphemes(Style::new()).map(|cell| cell.symbol).take_while(fits).collect();
    short + ".."
}

/// Removes the characters without a width that are not printed: a cell has them behind its own character.
pub fn remove_unprintable(buffer: &mut Buffer) {
    for cell in &mut buffer.content {
        if cell.symbol().len() > 1 && cell.symbol().contains(is_unprintable) {
            let printed = cell.symbol().replace(is_unprintable, "");
            cell.set_symbol(&printed);
        }
    }
}

/// The cell of a share, 0 to 1, of a row or column of `cells`.
pub fn cell_at(share: f64, cells: u16) -> u16 {
    (share.clamp(0.0, 1.0) * f64::from(cells - 1)).round() as u16
}

/// The sign of a verdict: on charts and in tables, with or without colours.
pub fn sign(verdict: Option<Verdict>) -> (&'static str, Role) {
    match verdict {
        Some(Verdict::Accept) => ("o", Role::Good),
        Some(Verdict::Fall) => ("x", Role::Bad),
        Some(Verdict::Void) => ("v", Role::Quiet),
        None => ("?", Role::Warning),
    }
}

/// A share of a limit as a bar; beyond nine tenths it warns.
pub fn bar(theme: &Theme, share: f64, width: usize) -> [Span<'static>; 2] {
    let size = if share.is_finite() { share.abs().min(1.0) } else { 1.0 };
    let filled = (size * width as f64).round() as usize;
    let (full, empty) = theme.fill();
    let role = if size >= 0.9 { Role::Warning } else { Role::SeriesA };
    [span(theme, role, full.repeat(filled)), span(theme, Role::Quiet, empty.repeat(width - filled))]
}

/// The place of a value between two bounds: `[---o------]`.
pub fn scale(theme: &Theme, value: f64, low: f64, high: f64, width: usize) -> String {
    let inner = width.saturating_sub(2).max(1);
    let share = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
    let at = (share * (inner - 1) as f64).round() as usize;
    format!("[{}o{}]", theme.line().repeat(at), theme.line().repeat(inner - 1 - at))
}

/// A measured displacement, angle or height with its sign, in three decimals; no -0.000 is shown.
pub fn signed(value: f64) -> String {
    format!("{:+.3}", if value.abs() < 0.0005 { 0.0 } else { value })
}

/// The measured quantity of a column, `-` without one: a time has no sign.
pub fn measured_number(trial: &TrialRecord, column: Column) -> String {
    match measured(trial, column) {
        Some(time_s) if column == Column::Air => format!("{time_s:.3}"),
        Some(value) => signed(value),
        None => "-".to_owned(),
    }
}

/// The value as one decimal shows it, never -0.0.
pub fn without_sign_of_zero(value: f64) -> f64 {
    if value.abs() < 0.05 { 0.0 } else { value }
}
