//! View 6, Log: events, every request and its outcome, and markers at trials and faults.

use quadfrog::recording::record::LogLevel;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::draw::{heading, span, truncate};
use crate::action::Action;
use crate::model::Model;
use crate::model::log::LogLine;
use crate::theme::{Role, Theme};

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let lines: Vec<&LogLine> = model.log_view.lines(&model.session.log).collect();
    let body = heading(frame, area, &model.theme, "Log", &summary(model, lines.len()));
    let space = usize::from(body.height);
    let last = lines.len().saturating_sub(model.log_view.back).max(space.min(lines.len()));
    let first = last.saturating_sub(space);
    for (row, line) in lines[first..last].iter().enumerate() {
        let area = Rect { y: body.y + row as u16, height: 1, ..body };
        frame.render_widget(line_of(&model.theme, line, usize::from(body.width)), area);
    }
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
    format!("{shown} lines{back}; {level} ({}), {search} ({})", key(Action::Filter), key(Action::Search))
}

fn line_of(theme: &Theme, line: &LogLine, width: usize) -> Line<'static> {
    let ms = line.time_ns / 1_000_000;
    let time = format!("{:>3}:{:02}.{:03} ", ms / 60_000, ms / 1000 % 60, ms % 1000);
    let (symbol, role) = match line.level {
        LogLevel::Error => ("E", Role::Bad),
        LogLevel::Warning => ("W", Role::Warning),
        LogLevel::Info if line.marker => (">", Role::Heading),
        LogLevel::Info => (" ", Role::Text),
    };
    Line::from(vec![
        span(theme, Role::Quiet, time),
        span(theme, role, format!("{symbol} ")),
        span(theme, Role::Quiet, format!("{:<9} ", truncate(&line.source, 9))),
        match line.level {
            LogLevel::Info => Span::raw(truncate(&line.text, width.saturating_sub(23))),
            _ => span(theme, role, truncate(&line.text, width.saturating_sub(23))),
        },
    ])
}
