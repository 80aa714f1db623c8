//! View 3, Optimizer: objective over trials and parameters, the sampler's reasons, landing places.

use quadfrog::trial::{ExperimentStage, ParameterInfo, ProposalInsight, SimulatorComparison, Verdict};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{heading, scale, sign, span, with_deviation};
use super::objective::objective_over;
use super::parameter_axes::{LEAST_SPAN, ParameterAxes};
use super::{densities, objective, points};
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};

/// Rows from which the repeated points have some of their own.
const REPEATS_FROM_ROWS: u16 = 30;

pub fn render(frame: &mut Frame, area: Rect, session: &SessionModel, theme: &Theme) {
    let (repeated, _) = points::lines(session, theme, usize::from(area.width));
    let roomy = area.height >= REPEATS_FROM_ROWS;
    let repeat_rows = if repeated.is_empty() || !roomy { 0 } else { repeated.len().min(5) as u16 + 1 };
    // In few rows the result of a confirmation stands in place of the sampler's reasons.
    let confirmed = session.confirming().is_some() || session.stage_is(ExperimentStage::Finished);
    let in_place_of_reasons = !repeated.is_empty() && !roomy && confirmed;
    let parameters = &session.info.parameters;
    let columns = |area: Rect| Layout::horizontal(vec![Constraint::Fill(1); parameters.len()]).spacing(2).split(area);
    let reasons_width = columns(area).iter().map(|panel| panel.width).min().filter(|_| !in_place_of_reasons);
    let legend_rows = legend(session, theme, area.width, reasons_width);
    let [upper, repeats, scatters, why, legend] = Layout::vertical([
        Constraint::Fill(1),
        Constraint::Length(repeat_rows),
        Constraint::Fill(1),
        Constraint::Fill(1),
        Constraint::Length(legend_rows.len() as u16),
    ])
    .areas(area);
    let repeats = if in_place_of_reasons { why } else { repeats };
    let [history, _, landings] =
        Layout::horizontal([Constraint::Fill(3), Constraint::Length(2), Constraint::Fill(2)]).areas(upper);
    frame.render_widget(Paragraph::new(legend_rows), legend);
    objective::render(frame, history, session, theme);
    render_landings(frame, landings, session, theme);
    if repeats.height > 0 {
        let aside = format!("landed/repeats, mean, std{}", points::star(session));
        let body = heading(frame, repeats, theme, "Repeated points", &aside);
        let lines = points::within(repeated, theme, 0, usize::from(body.height), "");
        frame.render_widget(Paragraph::new(lines), body);
    }
    if parameters.is_empty() {
        return;
    }
    let (above, below) = (columns(scatters), columns(why));
    for (index, info) in parameters.iter().enumerate() {
        let info = session.with_shown_range(info);
        render_scatter(frame, above[index], session, theme, &info);
        if session.simulator().is_none() && !in_place_of_reasons {
            densities::render(frame, below[index], session, &info, theme);
        }
    }
    if let Some(simulator) = session.simulator().filter(|_| !in_place_of_reasons) {
        render_simulator(frame, why, simulator, &session.info.unit, theme);
    }
}

/// The robot beside the simulated robots of the prior.
fn render_simulator(frame: &mut Frame, area: Rect, simulator: &SimulatorComparison, unit: &str, theme: &Theme) {
    let body = heading(frame, area, theme, "Robot beside the simulated robots", "mean and standard deviation");
    let SimulatorComparison { ratio, ratio_deviation, bias, bias_deviation, worlds, contradicted } = simulator;
    let mut lines = vec![
        Line::from(format!(
            " the robot shows {} the simulated change over the parameters",
            with_deviation(theme, *ratio, *ratio_deviation, "times")
        )),
        Line::from(format!(" and differs everywhere by {}", with_deviation(theme, *bias, *bias_deviation, unit))),
        Line::from(span(theme, Role::Quiet, " most like")),
    ];
    if *contradicted {
        let text = " the robot's values contradict the simulated ones: the sampler does not use them";
        lines.insert(0, Line::from(span(theme, Role::Warning, text)));
    }
    lines.extend(worlds.iter().map(|world| {
        let share = scale(theme, world.weight, 0.0, 1.0, 20);
        Line::from(vec![
            Span::raw(format!(" {:<12}{:>4.0} % ", world.name, 100.0 * world.weight)),
            span(theme, Role::Quiet, share),
        ])
    }));
    frame.render_widget(Paragraph::new(lines), body);
}

/// Every judged trial's value over one parameter; the proposal as a line.
fn render_scatter(frame: &mut Frame, area: Rect, session: &SessionModel, theme: &Theme, info: &ParameterInfo) {
    let body = heading(frame, area, theme, &objective_over(&info.name, &session.info.unit), &info.unit);
    let values = || session.trials.records.values().filter_map(|trial| trial.value);
    let (low, high) = (values().fold(0.0, f64::min), values().fold(LEAST_SPAN, f64::max));
    let Some(axes) = ParameterAxes::new(info, body, (low, high)) else { return };
    let buffer = frame.buffer_mut();
    let proposed = session.open_proposal().and_then(|p| p.parameters.iter().find(|p| p.name == info.name));
    axes.draw(buffer, proposed.map(|proposed| proposed.value), theme);
    let best = session.trials.best().map(|trial| trial.trial);
    // The best last: its repeats lie at the same place.
    let mut trials: Vec<_> =
        session.trials.records.values().filter(|trial| trial.verdict != Some(Verdict::Void)).collect();
    trials.sort_by_key(|trial| best == Some(trial.trial));
    for trial in trials {
        let Some(value) = trial.parameters.get(&info.name) else { continue };
        let Some(objective) = trial.value else { continue };
        let (symbol, role) = sign(trial.verdict);
        let symbol = if best == Some(trial.trial) { "*" } else { symbol };
        buffer.set_string(axes.column(value), axes.row(objective), symbol, theme.style(role));
    }
}

/// The signs of all panels, each whole, in as many lines as they need. `reasons_width` are the columns of the narrowest panel of the
/// sampler's reasons; none where there is none.
fn legend(session: &SessionModel, theme: &Theme, width: u16, reasons_width: Option<u16>) -> Vec<Line<'static>> {
    let modelled = session.insight.as_ref().is_some_and(|insight| !insight.predicted.is_empty());
    let explained = session.insight.as_ref().filter(|_| reasons_width.is_some());
    let densities = explained.is_some_and(|insight| insight.parameters.iter().any(|p| !p.at.is_empty()));
    let mut items = Vec::new();
    let void = if width >= 100 { "void, without J" } else { "void" };
    for (verdict, text) in
        [(Some(Verdict::Accept), "accept"), (Some(Verdict::Fall), "fall"), (Some(Verdict::Void), void)]
    {
        let (symbol, role) = sign(verdict);
        items.push((symbol, role, text));
    }
    if session.trials.records.values().any(|trial| trial.verdict.is_none()) {
        let (symbol, role) = sign(None);
        items.push((symbol, role, "not judged"));
    }
    items.push(("*", Role::Good, "best"));
    // Without an open proposal the reasons of the last one stay, with its line.
    let reasons = densities || modelled && explained.is_some_and(|insight| !insight.parameters.is_empty());
    let line = match (session.open_proposal().is_some(), reasons, modelled) {
        (true, _, false) => Some((Role::Key, "proposal")),
        (true, _, true) => Some((Role::Key, "proposal, deviation")),
        (false, true, false) => Some((Role::Key, "last proposal")),
        (false, true, true) => Some((Role::Key, "last proposal, deviation")),
        (false, false, true) => Some((Role::Quiet, "deviation")),
        (false, false, false) => None,
    };
    items.extend(line.map(|(role, text)| (theme.bar(), role, text)));
    let overridden =
        |insight: &ProposalInsight| insight.parameters.iter().any(|sampled| session.override_of(sampled).is_some());
    if reasons && session.insight.as_ref().is_some_and(overridden) {
        items.push((theme.bar(), Role::Quiet, "of the sampler"));
    }
    if densities && !modelled {
        items.extend([("g", Role::Good, "good"), ("r", Role::SeriesB, "rest")]);
    }
    items.push((theme.line(), Role::Quiet, "best so far"));
    let importance = |insight: &ProposalInsight| {
        insight.parameters.iter().any(|p| reasons_width.is_some_and(|width| densities::has_importance(p, width)))
    };
    if session.simulator().is_none() && explained.is_some_and(importance) {
        items.push(("importance:", Role::Quiet, "for best tenth"));
    }
    let (mut lines, mut line) = (Vec::new(), Line::from(" "));
    for (symbol, role, text) in items {
        let sign = [span(theme, role, symbol), span(theme, Role::Quiet, format!(" {text}  "))];
        // The two spaces behind the last sign of a line need no room.
        if line.width() + sign[0].width() + sign[1].width() > usize::from(width) + 2 {
            lines.push(std::mem::replace(&mut line, Line::from(" ")));
        }
        line.spans.extend(sign);
    }
    lines.push(line);
    lines
}

/// Where the trunk came to rest, from above: forward is up, left is left, the start is `+`.
fn render_landings(frame: &mut Frame, area: Rect, session: &SessionModel, theme: &Theme) {
    let landed = || session.trials.records.values().filter_map(|trial| Some((trial, trial.measured.as_ref()?)));
    let body = heading(frame, area, theme, "Landings, from above", "forward is up");
    if body.height < 3 || body.width < 10 {
        return;
    }
    // A character is about twice as high as wide; the same metres per length both ways.
    let ahead = landed().fold(0.1_f64, |ahead, (_, m)| ahead.max(m.dx_m));
    let behind = landed().fold(0.1_f64, |behind, (_, m)| behind.max(-m.dx_m));
    let sideways = landed().fold(0.1_f64, |side, (_, m)| side.max(m.dy_m.abs()));
    let per_row = ((ahead + behind) / f64::from(body.height - 1)).max(2.0 * 2.0 * sideways / f64::from(body.width - 1));
    let zero_row = f64::from(body.height - 1) * ahead / (ahead + behind);
    let place = |dx: f64, dy: f64| {
        let x = f64::from(body.width - 1) / 2.0 - dy / (per_row / 2.0);
        let y = zero_row - dx / per_row;
        let clamp = |v: f64, max: u16| v.round().clamp(0.0, f64::from(max - 1)) as u16;
        (body.x + clamp(x, body.width), body.y + clamp(y, body.height))
    };
    let buffer = frame.buffer_mut();
    let (x, y) = place(0.0, 0.0);
    buffer.set_string(x, y, "+", theme.style(Role::Quiet));
    let best = session.trials.best().map(|trial| trial.trial);
    let mut landings: Vec<_> = landed().collect();
    // The later covers the earlier: a void trial tells least, the best most.
    landings.sort_by_key(|(trial, _)| (best == Some(trial.trial), trial.verdict != Some(Verdict::Void)));
    for (trial, m) in landings {
        let (symbol, role) = sign(trial.verdict);
        let symbol = if best == Some(trial.trial) { "*" } else { symbol };
        let (x, y) = place(m.dx_m, m.dy_m);
        buffer.set_string(x, y, symbol, theme.style(role));
    }
    if landed().next().is_none() {
        buffer.set_string(body.x, body.y, "none yet", theme.style(Role::Quiet));
        return;
    }
    // The same metres per length to the side.
    let axis = [(body.y, ahead), (y, 0.0), (body.bottom() - 1, -behind)];
    for (row, dx_m) in axis.into_iter().filter(|(row, dx_m)| *dx_m >= 0.0 || *row > y) {
        let text = if dx_m == 0.0 { "0 m".to_owned() } else { format!("{dx_m:+.2} m") };
        buffer.set_string(body.x, row, text, theme.style(Role::Quiet));
    }
}
