//! View 6, Log: events, every request and its outcome, and markers at trials and faults.

use quadfrog::recording::record::LogLevel;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{columns, heading, heading_width, span, truncate, wall_clock};
use crate::action::Action;
use crate::model::Model;
use crate::model::log::LogLine;
use crate::theme::Role;
use crate::wrap::{wrap, wrap_all};

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let lines: Vec<&LogLine> = model.log_view.lines(&model.session.log).collect();
    let summary = summary(model, lines.len());
    let explained = format!("{summary}; > of a trial");
    let aside = if heading_width("Log", &explained) <= usize::from(area.width) { explained } else { summary };
    let body = heading(frame, area, &model.theme, "Log", &aside);
    let space = usize::from(body.height);
    let Some(newest) = lines.len().checked_sub(1) else {
        let text = Line::from(span(&model.theme, Role::Quiet, nothing_shown(model)));
        frame.render_widget(Paragraph::new(wrap(&text, usize::from(body.width), 1)), body);
        return;
    };
    let selected = newest.saturating_sub(model.log_view.back);
    let last = (selected + 1).max(space.min(lines.len()));
    let first = last.saturating_sub(space);
    for (row, line) in lines[first..last].iter().enumerate() {
        let area = Rect { y: body.y + row as u16, height: 1, ..body };
        frame.render_widget(line_of(model, line, first + row == selected, usize::from(body.width)), area);
    }
}

/// The reason why no line is shown, and where the lines of earlier sessions are.
fn nothing_shown(model: &Model) -> &'static str {
    let filtered = !model.log_view.search.is_empty() || model.log_view.level.is_some();
    match (model.replay.is_some(), filtered) {
        (true, true) => " No line up to this time passes.",
        (false, true) => {
            " No line of this session passes. Those of earlier sessions of the study are shown by quadfrog replay with its folder."
        }
        (_, false) => " No line yet.",
    }
}

/// Columns from which a line has the time of day and the time of the session.
const BOTH_TIMES_FROM: usize = 100;

/// The selected line, all of it, in rows of at most `width` characters.
pub fn whole_line(model: &Model, width: usize) -> Option<Vec<Line<'static>>> {
    let line = model.log_view.selected(&model.session.log)?;
    let theme = &model.theme;
    let level = match line.level {
        LogLevel::Error => ("error", Role::Bad),
        LogLevel::Warning => ("warning", Role::Warning),
        LogLevel::Info => ("information", Role::Text),
    };
    let of = if model.replay.is_some() { "of the replay" } else { "after the start" };
    let times = format!("{}, {} {of}", wall_clock(model, line.time_ns), session_time(line));
    let head = vec![
        Line::from(vec![span(theme, Role::Quiet, "time    "), Span::raw(times)]),
        Line::from(vec![span(theme, Role::Quiet, "level   "), span(theme, level.1, level.0)]),
        Line::from(vec![span(theme, Role::Quiet, "source  "), Span::raw(line.source.clone())]),
        Line::default(),
    ];
    let lines: Vec<Line> = head.into_iter().chain(line.text.lines().map(|text| Line::from(text.to_owned()))).collect();
    Some(wrap_all(&lines, width, 0))
}

fn summary(model: &Model, shown: usize) -> String {
    let view = &model.log_view;
    let level = match view.level {
        None | Some(LogLevel::Info) => "all levels",
        Some(LogLevel::Warning) => "warnings and errors",
        Some(LogLevel::Error) => "errors",
    };
    let search = if view.search.is_empty() { "search".to_owned() } else { format!("with \"{}\"", view.search) };
    let back = if view.back > 0 { format!("; {} back", view.back) } else { String::new() };
    let key = |action| model.keymap.key(action);
    let (filter, search_key, open) = (key(Action::Filter), key(Action::Search), key(Action::Open));
    format!("{shown} lines{back}; {level} ({filter}), {search} ({search_key}), whole line ({open})")
}

/// Minutes, seconds and milliseconds since the session began.
fn session_time(line: &LogLine) -> String {
    let ms = line.time_ns / 1_000_000;
    format!("{}:{:02}.{:03}", ms / 60_000, ms / 1000 % 60, ms % 1000)
}

/// One row: in a narrow terminal with the time of day, in a replay with the time of the playhead.
fn line_of(model: &Model, line: &LogLine, selected: bool, width: usize) -> Line<'static> {
    let theme = &model.theme;
    let mut time = String::new();
    if width >= BOTH_TIMES_FROM || model.replay.is_none() {
        time = format!("{:<9}", wall_clock(model, line.time_ns));
    }
    if width >= BOTH_TIMES_FROM || model.replay.is_some() {
        time += &format!("{:>10} ", session_time(line));
    }
    let (symbol, role) = match line.level {
        LogLevel::Error => ("E", Role::Bad),
        LogLevel::Warning => ("W", Role::Warning),
        LogLevel::Info if line.marker => (">", Role::Heading),
        LogLevel::Info => (" ", Role::Text),
    };
    let room = width.saturating_sub(time.chars().count() + 12);
    let source = truncate(&line.source, 9);
    let filling = 10_usize.saturating_sub(columns(&source));
    Line::from(vec![
        span(theme, if selected { Role::Selected } else { Role::Quiet }, time),
        span(theme, role, format!("{symbol} ")),
        span(theme, Role::Quiet, format!("{source}{:filling$}", "")),
        match line.level {
            LogLevel::Info => Span::raw(truncate(&line.text, room)),
            _ => span(theme, role, truncate(&line.text, room)),
        },
    ])
}
