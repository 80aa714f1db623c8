//! The trial panel: the proposal before the jump, the parameters while it runs, the measured values after it, and the
//! best parameters when the study is finished.

use quadfrog::trial::{
    ExpectedResult, ExperimentStage, FallRisk, FixedParameter, PredictedTrial, Proposal, ProposedParameter,
    TrialRecord, Verdict,
};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{expectation, falls_near, heading, number, scale, signed, span, with_deviation};
use super::points;
use crate::action::Action;
use crate::legal::{legal, may_request};
use crate::model::Model;
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};
use crate::wrap::{wrap, wrap_all};

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let PanelText { title, lines, points } = content(model, usize::from(area.width));
    let body = heading(frame, area, &model.theme, &title, "");
    // A row at least says that the points have no room.
    let rows = usize::from(body.height).saturating_sub(usize::from(!points.is_empty()));
    let mut lines = within(&lines, &model.theme, usize::from(body.width), rows);
    let room = usize::from(body.height).saturating_sub(lines.len());
    let elsewhere = format!(": view {}", model.keymap.key(Action::OptimizerView));
    lines.extend(points::within(points, &model.theme, 1, room, &elsewhere));
    frame.render_widget(Paragraph::new(lines), body);
}

/// The lines in rows of `width` columns, as far as `rows` rows have room: whole lines, and the number of those that are left out.
fn within(lines: &[Line], theme: &Theme, width: usize, rows: usize) -> Vec<Line<'static>> {
    let whole = wrap_all(lines, width, 1);
    if whole.len() <= rows {
        return whole;
    }
    let mut shown = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        let line = wrap(line, width, 1);
        // A row names those that are left out.
        if shown.len() + line.len() >= rows {
            let sign = format!(" {} more have no room", lines.len() - index);
            shown.push(Line::from(span(theme, Role::Warning, sign)));
            break;
        }
        shown.extend(line);
    }
    shown
}

/// The text of the panel.
#[derive(Default)]
struct PanelText {
    title: String,
    lines: Vec<Line<'static>>,
    /// The repeated points below the lines, as far as they have room.
    points: Vec<Line<'static>>,
}

impl PanelText {
    fn new(title: impl Into<String>, lines: Vec<Line<'static>>) -> PanelText {
        PanelText { title: title.into(), lines, points: Vec::new() }
    }
}

/// The rows that the whole panel takes with that many columns.
pub fn rows(model: &Model, width: u16) -> u16 {
    let (lines, points) = rows_of_parts(model, width);
    1 + lines + points
}

/// The same with one row for all of the repeated points, which says that they have no room.
pub fn least_rows(model: &Model, width: u16) -> u16 {
    let (lines, points) = rows_of_parts(model, width);
    1 + lines + points.min(1)
}

fn rows_of_parts(model: &Model, width: u16) -> (u16, u16) {
    let PanelText { lines, points, .. } = content(model, usize::from(width));
    (wrap_all(&lines, usize::from(width), 1).len() as u16, points.len() as u16)
}

fn content(model: &Model, width: usize) -> PanelText {
    let (session, theme) = (&model.session, &model.theme);
    let stage = session.stage.map(|info| info.stage);
    if let Some(trial) = session.under_review() {
        // A replay and a console that watches give no verdict.
        let asks = if may_request(model).is_ok() { "judge it" } else { "no verdict yet" };
        return PanelText::new(format!("Trial #{}: {asks}", trial.trial), review(session, theme, trial));
    }
    // A recording that begins within a trial.
    if session.proposal.is_none()
        && let Some(trial) = session.trials.newest().filter(|trial| trial.suggested.or(trial.verdict).is_none())
    {
        let as_run =
            |(name, value): &(String, f64)| ProposedParameter { name: name.clone(), value: *value, proposed: *value };
        let lines = trial.parameters.iter().map(|p| parameter(session, theme, &as_run(p), width)).collect();
        return PanelText::new(format!("Trial #{} runs", trial.trial), lines);
    }
    match (stage, &session.proposal) {
        (Some(ExperimentStage::Finished), _) => finished(model, width),
        (_, Some(proposal)) => {
            let source = match stage {
                Some(ExperimentStage::Running) => " runs".to_owned(),
                _ => format!(" ({})", proposal.source.with_parent(proposal.parent)),
            };
            let repeat = match proposal.repeats {
                0 => String::new(),
                repeats => format!(", repeat {} of {repeats}", proposal.repeat),
            };
            let title = format!("Trial #{}{repeat}{source}", proposal.trial);
            let mut lines: Vec<Line> = proposal.parameters.iter().map(|p| proposed(session, theme, p, width)).collect();
            lines.extend(proposal.changed_gains().map(|gain| parameter(session, theme, gain, width)));
            lines.extend(expected(session, theme, proposal.expected));
            if let Some(fallen) = void_fall(session, proposal) {
                lines.push(Line::from(span(theme, Role::Warning, format!(" this point fell in #{fallen}"))));
            }
            lines.push(risk(theme, proposal.risk, width));
            if let Some(share) = session.search.as_ref().and_then(|search| search.hop_share) {
                let text = format!(" hop envelope: {:.0} % of force", 100.0 * share);
                lines.push(Line::from(span(theme, Role::Warning, text)));
            }
            match session.queued_beside() {
                0 => {}
                count => {
                    let text = format!(" {count} more queued ({})", model.keymap.key(Action::Queue));
                    lines.push(Line::from(span(theme, Role::Quiet, text)));
                }
            }
            if let Some(left) = session.confirming() {
                lines.push(Line::from(span(theme, Role::Warning, format!(" confirming the best: {left} left"))));
                return PanelText { title, lines, points: points::titled_lines(session, theme, width) };
            }
            PanelText::new(title, lines)
        }
        _ => PanelText::new("Proposal", vec![Line::from(span(theme, Role::Quiet, " none yet"))]),
    }
}

/// A parameter of the proposal; one that the operator has fixed has the trials left in place of its bounds.
fn proposed(session: &SessionModel, theme: &Theme, p: &ProposedParameter, width: usize) -> Line<'static> {
    // A queued point has values of its own, and so has a changed one.
    let has_it = |fixed: &FixedParameter| fixed.value == p.value && p.value == p.proposed;
    match session.searched(&p.name).and_then(|searched| searched.fixed).filter(has_it) {
        Some(fixed) => {
            // Without room for the bounds.
            let mut line = parameter(session, theme, p, 0);
            line.push_span(span(theme, Role::Warning, format!(" fixed, {} more", fixed.trials)));
            line
        }
        None => parameter(session, theme, p, width),
    }
}

fn parameter(session: &SessionModel, theme: &Theme, p: &ProposedParameter, width: usize) -> Line<'static> {
    let info = session.parameter(&p.name).or_else(|| session.gain(&p.name).cloned());
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
        spans.extend([Span::raw(" "), span(theme, Role::Quiet, scale(theme, p.value, info.low, info.high, room))]);
    }
    Line::from(spans)
}

/// Expectation of the sampler's model of the trial, and its advice to end the search.
fn expected(session: &SessionModel, theme: &Theme, expected: Option<ExpectedResult>) -> Vec<Line<'static>> {
    let Some(expected) = expected else { return Vec::new() };
    let role = if expected.p_stand < 0.5 { Role::Warning } else { Role::Quiet };
    let mut lines =
        vec![Line::from(span(theme, role, format!(" {}", expectation(theme, &expected, &session.info.unit))))];
    if expected.advises_to_stop {
        let text = " no gain is worth the risk of a fall: confirm the best, or go on with sure points".to_owned();
        lines.push(Line::from(span(theme, Role::Warning, text)));
    }
    if let (Some(least), Some(most)) = (expected.simulated_least, expected.simulated_most) {
        let text = format!(" simulated robots {} to {} {}", number(least), number(most), session.info.unit);
        lines.push(Line::from(span(theme, Role::Quiet, text)));
    }
    lines
}

/// The void trial of the same point in which the robot fell: the risk counts judged trials alone.
fn void_fall(session: &SessionModel, proposal: &Proposal) -> Option<u32> {
    let repeated = session.trials.records.get(&proposal.parent?)?;
    let same = proposal.parameters.iter().chain(&proposal.gains).all(|p| p.value == p.proposed);
    let fell = repeated.suggested == Some(Verdict::Fall) && repeated.verdict == Some(Verdict::Void);
    (same && fell).then_some(repeated.trial)
}

fn risk(theme: &Theme, risk: Option<FallRisk>, width: usize) -> Line<'static> {
    let Some(risk) = risk.filter(|risk| risk.neighbours > 0) else {
        return Line::from(span(theme, Role::Quiet, " no judged trial near it yet"));
    };
    let role = if risk.falls * 2 >= risk.neighbours { Role::Warning } else { Role::Quiet };
    let mut text = format!(" {}", falls_near(&risk));
    if let (Some(distance), Some(trial)) = (risk.nearest_fall, risk.nearest_fall_trial) {
        // In few columns two lines; the manual explains the distance.
        let place = match width >= points::WORDS_FROM {
            true => format!(", {:.0} % of a range away", 100.0 * distance),
            false => format!(": {:.0} %", 100.0 * distance),
        };
        text.push_str(&format!("; nearest fall #{trial}{place}"));
    }
    Line::from(span(theme, role, text))
}

fn review(session: &SessionModel, theme: &Theme, trial: &TrialRecord) -> Vec<Line<'static>> {
    let label = |text: &str| span(theme, Role::Quiet, text.to_owned());
    let mut lines = Vec::new();
    let measured = trial.value.or_else(|| session.measured_objective(trial));
    match trial.hand_value.or(measured) {
        Some(value) => {
            let hand = match (trial.hand_value, trial.suggested) {
                (Some(_), Some(Verdict::Accept)) => " by hand",
                (Some(_), _) => " by hand, if accepted",
                (None, Some(Verdict::Void)) if trial.measured.as_ref().is_some_and(|m| m.ended_in_the_air()) => {
                    " in the air, if accepted"
                }
                (None, Some(Verdict::Void)) => " if accepted",
                (None, _) => "",
            };
            lines.push(Line::from(vec![
                label(" J    "),
                span(theme, Role::Key, format!("{} {}", number(value), session.info.unit)),
                span(theme, Role::Warning, hand),
            ]));
        }
        None => lines.push(Line::from(label(" nothing was measured"))),
    }
    if let Some(expected) = &trial.expected {
        lines.push(Line::from(label(&format!(" {}", expectation(theme, expected, &session.info.unit)))));
    }
    if let Some(m) = &trial.measured {
        let pair = |a, x, b, y| Line::from(vec![label(a), Span::raw(x), label(b), Span::raw(y)]);
        lines.push(pair(" dx   ", format!("{} m", signed(m.dx_m)), "  dy  ", format!("{} m", signed(m.dy_m))));
        lines.push(pair(" rise ", format!("{} m", signed(m.apex_m)), "  air ", format!(" {:.3} s", m.air_s)));
        lines.push(Line::from(vec![label(" yaw  "), Span::raw(format!("{} rad", signed(m.dyaw_rad)))]));
    }
    if let Some(verdict) = trial.suggested {
        let role = if verdict == Verdict::Accept { Role::Good } else { Role::Bad };
        let cause = if trial.cause.is_empty() { String::new() } else { format!(" ({})", trial.cause) };
        lines.push(Line::from(span(theme, role, format!(" suggested verdict: {}{cause}", verdict.name()))));
    }
    lines
}

fn finished(model: &Model, width: usize) -> PanelText {
    let (session, theme) = (&model.session, &model.theme);
    let title = "Study finished";
    let Some(best) = session.trials.best() else {
        return PanelText::new(title, vec![Line::from(span(theme, Role::Quiet, " no trial was accepted"))]);
    };
    let value = best.value.map(number).unwrap_or_default();
    let repeated = points::titled_lines(session, theme, width);
    let mut lines = vec![Line::from(vec![
        span(theme, Role::Quiet, if points::star(session).is_empty() { " best " } else { "* best " }),
        span(theme, Role::Good, format!("{value} {}", session.info.unit)),
        span(theme, Role::Quiet, format!(" (#{}{})", best.trial, if best.counts_by_hand() { ", by hand" } else { "" })),
    ])];
    if let Some(PredictedTrial { value, deviation, .. }) = session.trials.model_best {
        let text = format!(" its mean by the model {}", with_deviation(theme, value, deviation, &session.info.unit));
        lines.push(Line::from(span(theme, Role::Quiet, text)));
    }
    for (name, value) in &best.parameters {
        let p = ProposedParameter { name: name.clone(), value: *value, proposed: *value };
        lines.push(parameter(session, theme, &p, width));
    }
    lines.extend(session.changed_gains_of_best().iter().map(|gain| parameter(session, theme, gain, width)));
    let offers = [(Action::Continue, "more"), (Action::ConfirmBest, "confirm"), (Action::ExportBest, "export")];
    let offer = |(action, text)| {
        let (key, text) = (model.keymap.key(action), format!(" {text} "));
        [Span::raw(" "), span(theme, Role::Key, key), span(theme, Role::Quiet, text)]
    };
    let offers: Vec<_> = offers.into_iter().filter(|(action, _)| legal(*action, model).is_ok()).collect();
    // The last line of the screen names these keys, too: in few columns their row is that of the points.
    if !offers.is_empty() && (width >= points::WORDS_FROM || repeated.is_empty()) {
        lines.push(Line::from_iter(offers.into_iter().flat_map(offer)));
    }
    PanelText { points: repeated, ..PanelText::new(title, lines) }
}
