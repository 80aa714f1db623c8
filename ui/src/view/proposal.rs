//! The card: the proposal before the jump, the parameters while it runs, what was measured after it, and the best
//! parameters when the study is finished.
//!
//! ```text
//! Trial #8, by the sampler ──────      Trial #8: judge it ────────────
//!  f0    1.243 Hz   [----o-----]        J     0.642 m
//!  Fx    118.2 N    [-------o--]        dx   +0.642 m   dy   -0.012 m
//!  Fz    243.9 N    [---o------]        yaw  +0.031 rad
//!  1 of the 5 nearest fell, the         apex  0.412 m   air   0.330 s
//!  nearest is #3 at 0.21                looks like accept
//! ```

use quadfrog::trial::{
    ExperimentStage, FallRisk, Proposal, ProposalSource, ProposedParameter, Task, TrialRecord, Verdict,
};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

use super::{heading, number, points, span};
use crate::action::Action;
use crate::model::Model;
use crate::theme::Role;

/// Rows that the card wants.
pub fn rows(model: &Model) -> u16 {
    let parameters = model.session.parameters.len().clamp(3, 6) as u16;
    let changed = |proposal: &Proposal| proposal.gains.iter().filter(|gain| gain.value != gain.proposed).count();
    let gains = model.proposal_on_table().map_or(0, changed) as u16;
    // Repeats are shown while the best is being confirmed and when the study is finished.
    let confirming = model.search.as_ref().is_some_and(|search| search.confirming.is_some());
    let repeats = match confirming || model.stage_is(ExperimentStage::Finished) {
        true => model.points.len().min(4) as u16 + u16::from(confirming),
        false => 0,
    };
    parameters + 4 + gains + repeats
}

/// Draws the card.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let (title, lines) = content(model, usize::from(area.width));
    let body = heading(frame, area, &model.theme, &title, "");
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }), body);
}

fn content(model: &Model, width: usize) -> (String, Vec<Line<'static>>) {
    let stage = model.stage.map(|info| info.stage);
    if let Some(trial) = model.under_review() {
        return (format!("Trial #{}: judge it", trial.trial), review(model, trial));
    }
    match (stage, &model.proposal) {
        (Some(ExperimentStage::Finished), _) => ("Study finished".to_owned(), finished(model, width)),
        (_, Some(proposal)) => {
            let running = stage == Some(ExperimentStage::Running);
            let title = match (running, proposal.source, proposal.parent) {
                (true, _, _) => format!("Trial #{} runs", proposal.trial),
                (false, ProposalSource::Sampler, _) => format!("Trial #{}, by the sampler", proposal.trial),
                (false, ProposalSource::Operator, _) => format!("Trial #{}, overridden", proposal.trial),
                (false, ProposalSource::Rerun, Some(parent)) => {
                    format!("Trial #{}, re-run of #{parent}", proposal.trial)
                }
                (false, ProposalSource::Rerun, None) => format!("Trial #{}, a re-run", proposal.trial),
                (false, ProposalSource::Confirm, _) => format!("Trial #{}, to confirm the best", proposal.trial),
                (false, ProposalSource::Queued, _) => format!("Trial #{}, from the queue", proposal.trial),
            };
            let mut lines: Vec<Line> = proposal.parameters.iter().map(|p| parameter(model, p, width)).collect();
            let changed = proposal.gains.iter().filter(|gain| gain.value != gain.proposed);
            lines.extend(changed.map(|gain| parameter(model, gain, width)));
            lines.push(risk(model, proposal.risk));
            if let Some(left) = model.search.as_ref().and_then(|search| search.confirming) {
                lines.push(Line::from(span(&model.theme, Role::Warning, format!(" confirming the best: {left} left"))));
                lines.extend(points::lines(model, width));
            }
            (title, lines)
        }
        _ => ("Proposal".to_owned(), vec![Line::from(span(&model.theme, Role::Quiet, " none yet"))]),
    }
}

/// One parameter with its place between the bounds.
fn parameter(model: &Model, p: &ProposedParameter, width: usize) -> Line<'static> {
    let theme = &model.theme;
    let info = model.parameter(&p.name).or_else(|| model.gain(&p.name).cloned());
    let unit = info.as_ref().map_or("", |info| info.unit.as_str());
    let mut spans = vec![
        span(theme, Role::Quiet, format!(" {:<4}", p.name)),
        Span::raw(format!("{:>7}", number(p.value))),
        span(theme, Role::Quiet, format!(" {unit:<3}")),
    ];
    let room = width.saturating_sub(18).min(24);
    if p.value != p.proposed {
        spans.push(span(theme, Role::Warning, format!(" was {}", number(p.proposed))));
    } else if let Some(info) = &info
        && room >= 6
    {
        spans.extend([Span::raw(" "), span(theme, Role::Quiet, place(theme, p.value, info.low, info.high, room))]);
    }
    Line::from(spans)
}

/// Where a value lies between two bounds: `[---o------]`.
pub fn place(theme: &crate::theme::Theme, value: f64, low: f64, high: f64, width: usize) -> String {
    let inner = width.saturating_sub(2).max(1);
    let share = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
    let at = (share * (inner - 1) as f64).round() as usize;
    format!("[{}o{}]", theme.line().repeat(at), theme.line().repeat(inner - 1 - at))
}

fn risk(model: &Model, risk: Option<FallRisk>) -> Line<'static> {
    let theme = &model.theme;
    let Some(risk) = risk.filter(|risk| risk.neighbours > 0) else {
        return Line::from(span(theme, Role::Quiet, " no judged trial near it yet"));
    };
    let role = if risk.falls * 2 >= risk.neighbours { Role::Warning } else { Role::Quiet };
    let mut text = format!(" {} of the {} nearest fell", risk.falls, risk.neighbours);
    if let (Some(distance), Some(trial)) = (risk.nearest_fall, risk.nearest_fall_trial) {
        text.push_str(&format!("; nearest fall #{trial} at {distance:.2}"));
    }
    Line::from(span(theme, role, text))
}

fn review(model: &Model, trial: &TrialRecord) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let label = |text: &str| span(theme, Role::Quiet, text.to_owned());
    let mut lines = Vec::new();
    match (trial.hand_value, objective(model, trial)) {
        (Some(value), _) => lines.push(Line::from(vec![
            label(" J    "),
            span(theme, Role::Key, format!("{} {}", number(value), model.session.unit)),
            span(theme, Role::Warning, " by hand"),
        ])),
        (None, Some(value)) => lines.push(Line::from(vec![
            label(" J    "),
            span(theme, Role::Key, format!("{} {}", number(value), model.session.unit)),
        ])),
        (None, None) => lines.push(Line::from(label(" nothing was measured"))),
    }
    if let Some(m) = trial.measured {
        lines.push(Line::from(vec![
            label(" dx   "),
            Span::raw(format!("{:+.3} m", m.dx_m)),
            label("  dy  "),
            Span::raw(format!("{:+.3} m", m.dy_m)),
        ]));
        lines.push(Line::from(vec![
            label(" apex "),
            Span::raw(format!("{:+.3} m", m.apex_m)),
            label("  air "),
            Span::raw(format!(" {:.3} s", m.air_s)),
        ]));
        lines.push(Line::from(vec![label(" yaw  "), Span::raw(format!("{:+.3} rad", m.dyaw_rad))]));
    }
    if let Some(verdict) = trial.suggested {
        let role = if verdict == Verdict::Accept { Role::Good } else { Role::Bad };
        let cause = if trial.cause.is_empty() { String::new() } else { format!(": {}", trial.cause) };
        lines.push(Line::from(span(theme, role, format!(" looks like {}{cause}", verdict.name()))));
    }
    lines
}

/// The trial's measured objective, whatever its verdict will be.
pub fn objective(model: &Model, trial: &TrialRecord) -> Option<f64> {
    let measured = trial.measured?;
    trial.value.or_else(|| {
        Some(match model.session.task? {
            Task::Forward => measured.dx_m,
            Task::LateralLeft => measured.dy_m,
            Task::LateralRight => -measured.dy_m,
            Task::TwistCcw => measured.dyaw_rad,
            Task::TwistCw => -measured.dyaw_rad,
        })
    })
}

fn finished(model: &Model, width: usize) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let Some(best) = model.best() else {
        return vec![Line::from(span(theme, Role::Quiet, " no trial was accepted"))];
    };
    let value = best.value.map(number).unwrap_or_default();
    let mut lines = vec![Line::from(vec![
        span(theme, Role::Quiet, " best "),
        span(theme, Role::Good, format!("{value} {}", model.session.unit)),
        span(theme, Role::Quiet, format!(" (#{})", best.trial)),
    ])];
    for (name, value) in &best.parameters {
        let p = ProposedParameter { name: name.clone(), value: *value, proposed: *value };
        lines.push(parameter(model, &p, width));
    }
    let deed = |action: Action, text: &'static str| {
        vec![
            Span::raw(" "),
            span(theme, Role::Key, model.keymap.key(action)),
            span(theme, Role::Quiet, format!(" {text} ")),
        ]
    };
    let mut last = deed(Action::Continue, "more");
    last.extend(deed(Action::ConfirmBest, "confirm"));
    last.extend(deed(Action::ExportBest, "export"));
    lines.push(Line::from(last));
    lines.extend(points::lines(model, width));
    lines
}
