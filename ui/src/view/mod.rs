//! Drawing. Every panel is a free function of the model; nothing here changes it.
//!
//! ```text
//!  READY      SIM  forward   trial #8   7 of 20 judged   best 0.642 m (#3)     REC 03:12  <- frame, never covered
//!  STOP Space F12    loop 0 late, worst 0.1 ms    link 0 ms    motors 31 C
//!  1 Live   2 Trials   3 Optimizer   4 Override   5 Health   6 Log        ? help : actions
//! ┌─────────────────────────────────────────────────────────────────────────────────────┐
//! │ the open view, with dialogs over it                                                  │
//! └─────────────────────────────────────────────────────────────────────────────────────┘
//!  override Fx = 120 N: done                                                  <- the newest answer
//!  Press g twice to jump  ·  o override  ·  n skip  ·  D sit down             <- the next possible step
//! ```

pub mod chart;
pub mod densities;
pub mod dialogs;
pub mod frame;
pub mod health;
pub mod help;
pub mod live;
pub mod log;
pub mod next_step;
pub mod objective;
pub mod optimizer;
pub mod overrides;
pub mod points;
pub mod pre_arm;
pub mod proposal;
pub mod trial_text;
pub mod trials;
pub mod wireframe;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};

use crate::model::{Model, View};
use crate::theme::{Role, Theme};

/// Columns that the console needs.
pub const MIN_COLUMNS: u16 = 80;
/// Rows that the console needs.
pub const MIN_ROWS: u16 = 24;

/// The row of the tabs, below the frame.
pub const TABS_ROW: u16 = 2;

/// Draws everything.
pub fn render(frame: &mut Frame, model: &Model) {
    let area = frame.area();
    if area.width < MIN_COLUMNS || area.height < MIN_ROWS {
        return frame::render_small(frame, area, model);
    }
    let [top, tabs, body, message, next] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(1),
        Constraint::Length(1),
    ])
    .areas(area);
    frame::render(frame, top, model);
    frame::render_tabs(frame, tabs, model);
    match model.view {
        View::Live => live::render(frame, body, model),
        View::Trials => trials::render(frame, body, model),
        View::Optimizer => optimizer::render(frame, body, model),
        View::Override => overrides::render(frame, body, model),
        View::Health => health::render(frame, body, model),
        View::Log => log::render(frame, body, model),
    }
    dialogs::render(frame, body, model);
    frame::render_message(frame, message, model);
    next_step::render(frame, next, model);
}

/// Text in a role's style.
pub fn span(theme: &Theme, role: Role, text: impl Into<String>) -> Span<'static> {
    Span::styled(text.into(), theme.style(role))
}

/// A heading with a line to the right edge; returns the area below it.
pub fn heading(frame: &mut Frame, area: Rect, theme: &Theme, title: &str, aside: &str) -> Rect {
    let [top, rest] = Layout::vertical([Constraint::Length(1), Constraint::Fill(1)]).areas(area);
    // Where there is no room for both, the title stays.
    let aside = if title.chars().count() + aside.chars().count() + 4 > usize::from(area.width) { "" } else { aside };
    let used = title.chars().count() + aside.chars().count() + 2 + usize::from(!aside.is_empty());
    let fill = theme.line().repeat(usize::from(area.width).saturating_sub(used));
    let mut spans = vec![span(theme, Role::Heading, title), Span::raw(" "), span(theme, Role::Quiet, fill)];
    if !aside.is_empty() {
        spans.extend([Span::raw(" "), span(theme, Role::Quiet, aside)]);
    }
    frame.render_widget(Line::from(spans), top);
    rest
}

/// A number with four significant digits, as far as they fit: 1.243, 18.20, 118.2, 1240.
pub fn number(value: f64) -> String {
    match value.abs() {
        _ if !value.is_finite() => "-".to_owned(),
        size if size >= 1000.0 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.1}"),
        size if size >= 10.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// Hours, minutes and seconds of a time in ns; hours only where there are any.
pub fn clock(time_ns: u64) -> String {
    let seconds = time_ns / 1_000_000_000;
    let (h, m, s) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if h > 0 { format!("{h}:{m:02}:{s:02}") } else { format!("{m:02}:{s:02}") }
}

/// As [`clock`], with milliseconds.
pub fn clock_ms(time_ns: u64) -> String {
    format!("{}.{:03}", clock(time_ns), time_ns / 1_000_000 % 1000)
}

/// The text cut to a number of characters, with a mark where something is missing.
pub fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let mut short: String = text.chars().take(width.saturating_sub(2)).collect();
    short.push_str("..");
    short
}
