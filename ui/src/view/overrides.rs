//! View 4, Override: the proposal with its bounds, the controller's gains, and the actions on the selected one.

use quadfrog::trial::{ParameterInfo, ProposedParameter};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{heading, number, scale, span};
use crate::action::Action;
use crate::legal::{legal, may_request};
use crate::model::Model;
use crate::theme::Role;
use crate::wrap::wrap_all;

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    let proposal = model.session.shown_proposal();
    let value = |values: &[ProposedParameter], name: &str| values.iter().find(|p| p.name == *name).cloned();
    let parameters = &model.session.info.parameters;
    let line = |(index, info): (usize, &ParameterInfo)| {
        let value = proposal.and_then(|p| value(&p.parameters, &info.name));
        let present = model.session.parameter(&info.name).unwrap_or_else(|| info.clone());
        let mut spans = row(model, index, &present, value.as_ref());
        spans.extend(search_state(model, info));
        Line::from(spans)
    };
    let rows: Vec<Line> = parameters.iter().enumerate().map(line).collect();
    let gain = |(index, info): (usize, &ParameterInfo)| {
        let value = proposal.and_then(|p| value(&p.gains, &info.name));
        Line::from(row(model, parameters.len() + index, info, value.as_ref()))
    };
    let gains: Vec<Line> = model.session.info.gains.iter().enumerate().map(gain).collect();
    let title = match proposal {
        Some(proposal) => {
            let runs = if model.session.open_proposal().is_some() { "" } else { " runs" };
            format!("Trial #{}{runs}, source: {}", proposal.trial, proposal.source.with_parent(proposal.parent))
        }
        None => "Parameters".to_owned(),
    };
    let gain_rows = if gains.is_empty() { 0 } else { gains.len() as u16 + 1 };
    let [upper, middle, lower] = Layout::vertical([
        Constraint::Length(rows.len() as u16 + 1),
        Constraint::Length(gain_rows),
        Constraint::Fill(1),
    ])
    .areas(area);
    let body = heading(frame, upper, theme, &title, "present bounds");
    frame.render_widget(Paragraph::new(rows), body);
    if gain_rows > 0 {
        let body = heading(frame, middle, theme, "Gains of the controller, for this trial", "safe ranges");
        frame.render_widget(Paragraph::new(gains), body);
    }
    let body = heading(frame, lower, theme, "Actions", "the robot moves only after an approval");
    frame.render_widget(Paragraph::new(actions(model, usize::from(body.width))), body);
}

fn row(model: &Model, index: usize, info: &ParameterInfo, p: Option<&ProposedParameter>) -> Vec<Span<'static>> {
    let theme = &model.theme;
    let selected = index == model.override_row && model.chooses_row();
    let mut spans = vec![
        span(
            theme,
            if selected { Role::Key } else { Role::Text },
            format!("{} {:<8}", if selected { ">" } else { " " }, info.name),
        ),
        Span::raw(format!("{:>7} {:<9}", p.map_or("-".to_owned(), |p| number(p.value)), info.unit)),
        span(theme, Role::Quiet, format!("{:>6} ", number(info.low))),
        match p {
            Some(p) => span(theme, Role::Quiet, scale(theme, p.value, info.low, info.high, 16)),
            None => span(theme, Role::Quiet, format!("{:^16}", "to")),
        },
        span(theme, Role::Quiet, format!(" {:<6}", number(info.high))),
    ];
    if let Some(p) = p.filter(|p| p.value != p.proposed) {
        spans.push(span(theme, Role::Warning, format!(" was {}", number(p.proposed))));
    }
    spans
}

/// The fixed value of a parameter, or its initial bounds where they have changed.
fn search_state(model: &Model, info: &ParameterInfo) -> Option<Span<'static>> {
    let theme = &model.theme;
    let searched = model.session.searched(&info.name)?;
    match searched.fixed {
        Some(fixed) => {
            // A queued point has values of its own.
            let proposal = model.session.shown_proposal();
            let value = proposal.and_then(|proposal| proposal.parameters.iter().find(|p| p.name == info.name));
            let has_it = value.is_none_or(|p| p.value == fixed.value);
            let when = if has_it { " " } else { " then " };
            Some(span(theme, Role::Warning, format!("{when}fixed at {}, {} more", number(fixed.value), fixed.trials)))
        }
        None if (searched.low, searched.high) != (info.low, info.high) => {
            let (low, high) = (number(info.low), number(info.high));
            Some(span(theme, Role::Warning, format!(" initial {low}..{high}")))
        }
        None => None,
    }
}

/// The actions with their keys, and the reason where one is not possible now.
fn actions(model: &Model, width: usize) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let chosen = model.override_parameter();
    let name = chosen.map_or("the parameter", |info| info.name.as_str());
    let unit = chosen.map_or("", |info| info.unit.as_str());
    let is_fixed = chosen.and_then(|info| model.session.searched(&info.name)?.fixed).is_some();
    let fix = match (is_fixed, model.override_value()) {
        (true, _) => format!("search {name} again"),
        (false, Some(value)) => format!("fix {name} at {} {unit} for the next trials", number(value)),
        (false, None) => format!("fix {name} for the next trials"),
    };
    let help = |action: Action| action.info().help.to_owned();
    let offered = [
        (Action::Override, "change values and gains: typed, or in steps of 1 % and 10 %".to_owned()),
        (Action::ClearOverrides, help(Action::ClearOverrides)),
        (Action::Fix, fix),
        (Action::Bounds, format!("search {name} within other bounds")),
        (Action::QueuePoint, help(Action::QueuePoint)),
        (Action::Skip, help(Action::Skip)),
    ];
    // A replay and an observer change nothing: one line says so for all.
    let commands = may_request(model);
    let proposal = legal(Action::Override, model);
    let line = |(action, text): (Action, String)| {
        let key = model.keymap.key(action);
        match legal(action, model) {
            Err(_) if commands.is_err() => Line::from(span(theme, Role::Quiet, format!("  {key:<3}{text}"))),
            Ok(()) => Line::from(vec![span(theme, Role::Key, format!("  {key:<3}")), Span::raw(text)]),
            // What holds for the whole proposal is said once, below.
            Err(reason) if Some(&reason) == proposal.as_ref().err() => {
                Line::from(span(theme, Role::Quiet, format!("  {key:<3}{text}")))
            }
            Err(reason) => Line::from(span(theme, Role::Quiet, format!("  {key:<3}{text} ({reason})"))),
        }
    };
    let mut lines: Vec<Line> = offered.into_iter().map(line).collect();
    if let Err(reason) = commands {
        lines.push(Line::from(span(theme, Role::Quiet, format!("  Nothing can be changed: {reason}."))));
    } else if let Err(reason) = &proposal {
        lines.push(Line::from(span(theme, Role::Quiet, format!("  The proposal cannot be changed now: {reason}."))));
    }
    wrap_all(&lines, width, 5)
}
