//! View 1, Live: charts of the robot's state, the present proposal and the last trials.

use std::borrow::Cow;

use quadfrog::robot::{JOINTS, joint_name};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::chart::{Chart, Ghost, TimeAxis, curves, draw_phases, draw_time_axis, phases, plot_columns, sample_columns};
use super::draw::{NO_STATE, bar, heading, span, without_sign_of_zero};
use super::series_style::{SeriesStyle, style};
use super::{beside, objective, points, proposal, trials, wireframe};
use crate::model::Model;
use crate::model::comparison::{Comparison, impulse_start_ns};
use crate::model::history::{ChartSample, SignalHistory};
use crate::model::landed::LandedTrial;
use crate::model::live::Panel;
use crate::settings::ChartMode;
use crate::theme::Role;

const SIDE: u16 = 32;
/// The same below the charts of a landed trial: the table beside them has whole verdicts at 80 columns.
const LANDED_SIDE: u16 = 30;
/// Columns from which there is room for more than charts, the trial and the table.
const WIDE: u16 = 120;
/// Columns from which the whole table fits beside the trial.
const ROOMY: u16 = 160;
/// Rows of the table: heading and two trials, at least.
const LEAST_TABLE_ROWS: u16 = 3;
/// Rows of a chart with its heading, at least.
const CHART_ROWS: u16 = 3;
/// Rows of the charts from which the time axis has one of its own.
const TIMES_FROM_ROWS: u16 = 16;
/// Columns of the joints' panel from which two joints stand side by side.
const TWO_JOINTS_FROM: u16 = 72;

/// The places of the panels.
struct Places {
    /// The charts, or what the operator chose in place of them.
    main: Rect,
    /// Between these and the side, with a rule on a wide screen.
    gap: Rect,
    card: Rect,
    objective: Rect,
    /// The robot; none without room.
    picture: Option<Rect>,
    table: Rect,
}

/// The places of the panels in the body; none where a landed trial takes the whole width.
fn places(area: Rect, model: &Model) -> Option<Places> {
    if area.width < WIDE && model.live.panel == Panel::Charts && model.landed().is_some() {
        return None;
    }
    // In a low terminal the table gives rows to the two trials that are compared.
    let most = compared(model).map_or(14, |comparison| area.height.saturating_sub(beside::least_rows(comparison)));
    let table_rows = (area.height / 4).clamp(5, 14).min(most.max(LEAST_TABLE_ROWS));
    let above_table = |area: Rect| Layout::vertical([Constraint::Fill(1), Constraint::Length(table_rows)]).areas(area);
    let side_columns = if area.width >= WIDE { (SIDE + 10).max(area.width * 3 / 10) } else { SIDE };
    let beside = |area: Rect| {
        let gap = if area.width >= WIDE { 2 } else { 1 };
        let columns = [Constraint::Fill(1), Constraint::Length(gap), Constraint::Length(side_columns)];
        Layout::horizontal(columns).areas(area)
    };
    // Where the table has room beside it, the side with the picture of the robot takes the whole height.
    let ([main, gap, side], table) = if area.width >= ROOMY {
        let [left, gap, side] = beside(area);
        let [main, table] = above_table(left);
        ([main, gap, side], table)
    } else {
        let [upper, table] = above_table(area);
        (beside(upper), table)
    };
    let card_rows = match compared(model) {
        Some(comparison) => beside::rows(comparison).min(side.height),
        // In a low terminal the objective gives rows to what is to be approved.
        None => {
            let usual = card_rows(model, side.width).min(side.height.saturating_sub(5));
            usual.max(proposal::least_rows(model, side.width).min(side.height))
        }
    };
    let room = side.height - card_rows;
    // Without room for both, the panel of the joints shows the robot and the others the objective.
    let picture_rows = match model.live.panel {
        Panel::Robot => 0,
        _ if room >= 18 => (room / 2).clamp(12, 24),
        Panel::Joints => room,
        Panel::Charts => 0,
    };
    let [card, objective, picture] =
        Layout::vertical([Constraint::Length(card_rows), Constraint::Fill(1), Constraint::Length(picture_rows)])
            .areas(side);
    let picture = if model.live.panel == Panel::Robot { main } else { picture };
    Some(Places { main, gap, card, objective, picture: Some(picture).filter(|picture| picture.height > 0), table })
}

/// Rows of the card of a trial: equal over the stages of a study, more where the cause of a verdict needs them.
fn card_rows(model: &Model, width: u16) -> u16 {
    // In few columns the nearest falls take two lines, not three, and a trial that waits for its verdict has a place of its own.
    let spared = u16::from(usize::from(width) < points::WORDS_FROM);
    (model.session.trial_rows() - spared).max(proposal::rows(model, width))
}

/// The trials side by side in place of the proposal: in a replay only, because a live session shows its proposal in any
/// case for the operator to approve.
fn compared(model: &Model) -> Option<&Comparison> {
    model.live.comparison.as_ref().filter(|_| model.replay.is_some())
}

/// The panel of the robot; none without room.
pub fn robot_panel(area: Rect, model: &Model) -> Option<Rect> {
    places(area, model)?.picture
}

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let Some(Places { main, gap, card, objective, picture, table }) = places(area, model) else {
        return render_landed(frame, area, model);
    };
    if model.live.panel == Panel::Joints {
        render_joints(frame, main, model);
    } else if model.live.panel == Panel::Charts && area.width >= WIDE && main.height >= 24 {
        let joint_rows = JOINTS as u16 / if main.width >= TWO_JOINTS_FROM { 2 } else { 1 } + 1;
        let [charts, joints] = Layout::vertical([Constraint::Fill(1), Constraint::Length(joint_rows)]).areas(main);
        render_charts(frame, charts, model);
        render_joints(frame, joints, model);
    } else if model.live.panel == Panel::Charts {
        render_charts(frame, main, model);
    }
    if area.width >= WIDE {
        let bar = model.theme.bar();
        let lines = (0..gap.height).map(|_| Line::from(span(&model.theme, Role::Quiet, bar))).collect::<Vec<_>>();
        frame.render_widget(Paragraph::new(lines), gap);
    }
    match compared(model) {
        Some(comparison) => beside::render(frame, card, comparison, model),
        None => proposal::render(frame, card, model),
    }
    objective::render(frame, objective, &model.session, &model.theme);
    if let Some(picture) = picture.filter(|_| !model.first_frame) {
        wireframe::render(frame, picture, model);
    }
    trials::render_table(frame, table, model, false);
}

/// The landed trial over the whole width of a narrow terminal; its measured values and the table share the rows below.
fn render_landed(frame: &mut Frame, area: Rect, model: &Model) {
    let card_rows = card_rows(model, LANDED_SIDE).min(area.height / 2);
    let [charts, lower] = Layout::vertical([Constraint::Fill(1), Constraint::Length(card_rows)]).areas(area);
    let [card, _, table] =
        Layout::horizontal([Constraint::Length(LANDED_SIDE), Constraint::Length(1), Constraint::Fill(1)]).areas(lower);
    render_charts(frame, charts, model);
    proposal::render(frame, card, model);
    trials::render_table(frame, table, model, false);
}

struct ChartSource<'a> {
    history: Cow<'a, SignalHistory>,
    axis: TimeAxis,
    ghost: Option<Ghost<'a>>,
    cursor_ns: Option<u64>,
    /// The newest tick, where the present is charted: the charts hold every fifth.
    present: Option<ChartSample>,
}

impl<'a> ChartSource<'a> {
    /// The sample whose values stand in the headings: that at the cursor, else the newest.
    fn named(&self) -> Option<&ChartSample> {
        match self.cursor_ns {
            Some(time_ns) => self.history.at(time_ns),
            None => self.present.as_ref().or_else(|| self.history.samples().next_back()),
        }
    }

    /// Two trials, the landed trial, the present, or the frozen history.
    fn of(model: &'a Model) -> ChartSource<'a> {
        if let Some(comparison) = &model.live.comparison {
            return ChartSource::compared(comparison);
        }
        if let Some(landed) = model.landed() {
            return ChartSource::landed(&landed, model.live.landed_cursor_ns);
        }
        let history = model.charted();
        let axis = TimeAxis {
            mode: model.live.mode,
            window_ns: (model.live.window_s * 1e9) as u64,
            newest_ns: history.newest_ns(),
        };
        let trace = model.live.ghost.and_then(|trial| model.history.jump(trial));
        let under = history.samples().rev().find(|sample| sample.trial.is_some()).map(impulse_start_ns);
        let ghost =
            trace.zip(under).map(|(trace, start_ns)| Ghost { trace, start_ns, role: Role::Ghost, named: false });
        let cursor_ns = model.live.frozen.is_some().then_some(model.live.cursor_ns);
        let tick = &model.snapshot.tick;
        let newest = history.samples().next_back().filter(|newest| newest.time_ns <= tick.time_ns);
        let present = newest.map(|newest| ChartSample { heard: newest.heard, ..ChartSample::from(tick) });
        ChartSource { history: Cow::Borrowed(history), axis, ghost, cursor_ns, present }
    }

    /// The landed trial over the whole width, with another one under it.
    fn landed(landed: &LandedTrial<'a>, cursor_ns: Option<u64>) -> ChartSource<'a> {
        let (first, last) = landed.span_ns();
        let axis = TimeAxis { mode: ChartMode::Scroll, window_ns: last - first + 1, newest_ns: last };
        let under = |(_, trace)| Ghost { trace, start_ns: landed.start_ns, role: Role::Ghost, named: false };
        let history = Cow::Owned(SignalHistory::of_trace(landed.samples));
        ChartSource { history, axis, ghost: landed.under.map(under), cursor_ns, present: None }
    }

    /// Two trials, from the first sample to the last.
    fn compared(comparison: &'a Comparison) -> ChartSource<'a> {
        let (first, last) = comparison.span_ns();
        let axis = TimeAxis { mode: ChartMode::Scroll, window_ns: last - first + 1, newest_ns: last };
        let ghost = Ghost { trace: &comparison.trace_b, start_ns: comparison.start_ns, role: Role::Good, named: true };
        let history = Cow::Borrowed(&comparison.history_a);
        ChartSource { history, axis, ghost: Some(ghost), cursor_ns: Some(comparison.cursor_ns), present: None }
    }
}

fn render_charts(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = model.theme;
    let times_rows = u16::from(area.height >= TIMES_FROM_ROWS);
    let [charts, strip, times] =
        Layout::vertical([Constraint::Fill(1), Constraint::Length(1), Constraint::Length(times_rows)]).areas(area);
    let source = ChartSource::of(model);
    let series = &model.live.series;
    let across = if series.len() == 1 { 1 } else { 2 };
    let down = series.len().div_ceil(across).min(usize::from(charts.height / CHART_ROWS)).max(1);
    let columns = |area: Rect| Layout::horizontal(vec![Constraint::Fill(1); across]).spacing(1).split(area);
    let of_columns: Vec<_> = columns(strip)
        .iter()
        .map(|cell| plot_columns(*cell))
        .map(|cell| {
            let columns = sample_columns(&source.axis, &source.history, cell.width, theme.glyphs);
            (cell, phases(&source.axis, &source.history, cell.width), columns)
        })
        .collect();
    let rows = Layout::vertical(vec![Constraint::Fill(1); down]).split(charts);
    let middle_tick = rows.iter().all(|row| row.height > CHART_ROWS);
    let drawn: Vec<SeriesStyle> = series.iter().take(across * down).map(|series| style(*series, model)).collect();
    let curves = curves(&drawn, &source.history, &source.axis);
    let own: Vec<usize> = drawn.iter().zip(&curves).map(|(style, curve)| style.range_of(curve, source.ghost)).collect();
    for (index, style) in drawn.iter().enumerate() {
        // Charts of the same quantity have the same axis.
        let alike = drawn.iter().zip(&own).filter(|(other, _)| other.ranges == style.ranges);
        let range = alike.map(|(_, range)| *range).max().unwrap_or(0);
        let chart = Chart {
            style: *style,
            range: style.ranges.get(range).copied().unwrap_or((-1.0, 1.0)),
            axis: source.axis,
            curve: &curves[index],
            columns: &of_columns[index % across].2,
            phases: &of_columns[index % across].1,
            ghost: source.ghost,
            named: source.named(),
            cursor_ns: source.cursor_ns,
            cursor_line: model.live.cursor_line,
            middle_tick,
            theme,
        };
        chart.draw(frame.buffer_mut(), columns(rows[index / across])[index % across]);
    }
    // The charts side by side have the same times: the names stand under the left ones, the description under the right ones.
    for (cell, phases, _) in of_columns.iter().take(1) {
        draw_phases(frame.buffer_mut(), *cell, phases, &theme);
    }
    if times_rows > 0 {
        // Two trials, and the landed one, count from the begin of the impulse.
        let compared = source.ghost.filter(|_| source.cursor_ns.is_some()).map(|ghost| ghost.start_ns);
        let origin_ns = model.landed().map(|landed| landed.start_ns).or(compared);
        for cell in columns(times).iter() {
            draw_time_axis(frame.buffer_mut(), plot_columns(*cell), &source.axis, origin_ns, &theme);
        }
    }
    render_axis(frame, strip, model, series.len().saturating_sub(across * down));
}

/// Rounds to hundredths; no -0.00 is shown.
fn in_hundredths(time_s: f64) -> f64 {
    (time_s * 100.0).round() / 100.0 + 0.0
}

/// Describes the time axis at the right end of the strip under the charts, and counts the charts without room.
fn render_axis(frame: &mut Frame, strip: Rect, model: &Model, without_room: usize) {
    let live = &model.live;
    let (role, mut text) = match (&live.comparison, &live.frozen, model.landed()) {
        (Some(c), _, _) => {
            let at_s = in_hundredths((c.cursor_ns as f64 - c.start_ns as f64) / 1e9);
            (Role::Warning, format!(" A #{} line, B #{} dotted, at {at_s:+.2} s ", c.a.trial, c.b.trial))
        }
        (None, Some((history, _)), _) => {
            let back = (history.newest_ns().saturating_sub(live.cursor_ns)) as f64 / 1e9;
            (Role::Warning, format!(" cursor {:.2} s ", in_hundredths(-back)))
        }
        (None, None, Some(landed)) => {
            let under = landed.under.map_or(String::new(), |(under, _)| format!(", #{under} under it"));
            let at_s = |time_ns| in_hundredths(landed.trial_time_s(time_ns));
            let text = match live.landed_cursor_ns {
                Some(cursor_ns) => format!(" #{}{under}, at {:+.2} s ", landed.trial, at_s(cursor_ns)),
                None => {
                    let (first, last) = landed.span_ns();
                    format!(" #{}{under}, {:+.1} to {:+.1} s ", landed.trial, at_s(first), at_s(last))
                }
            };
            (Role::Warning, text)
        }
        (None, None, None) => {
            let mode = if live.mode == ChartMode::Sweep { "sweep" } else { "scroll" };
            (Role::Quiet, format!(" {} s {mode} ", live.window_s))
        }
    };
    if without_room > 0 {
        text = format!(" {without_room} more have no room {} {}", model.theme.dot(), text.trim_start());
    }
    let width = (text.chars().count() as u16).min(strip.width);
    let area = Rect { x: strip.right() - width, width, ..strip };
    frame.render_widget(Line::from(span(&model.theme, role, text)), area);
}

/// Torque and speed of each joint with bars of their share of the limit; `!` where the last gate changed the command.
fn render_joints(frame: &mut Frame, area: Rect, model: &Model) {
    if model.first_frame {
        return;
    }
    let theme = &model.theme;
    let tick = &model.snapshot.tick;
    let aside = if area.width >= 60 { "torque in N m, speed in rad/s; bars: share of the limit" } else { "N m, rad/s" };
    let body = heading(frame, area, theme, "Joints", aside);
    if model.robot_is_silent() {
        return frame.render_widget(Line::from(span(theme, Role::Quiet, NO_STATE)), body);
    }
    let Some(robot) = &model.robot else {
        frame.render_widget(Line::from(span(theme, Role::Quiet, "the robot's limits are not known here")), body);
        return;
    };
    // Two legs beside the other two where the bars stay long enough to read.
    let across = if body.width >= TWO_JOINTS_FROM { 2 } else { 1 };
    let columns = Layout::horizontal(vec![Constraint::Fill(1); across]).spacing(2).split(body);
    let down = JOINTS / across;
    for joint in 0..JOINTS {
        let column = columns[joint / down];
        let row = (joint % down) as u16;
        if row >= column.height {
            continue;
        }
        let torque = tick.state.joint_torque_n_m[joint];
        let speed = tick.state.joint_velocity_rad_s[joint];
        let limits = &robot.limits;
        let width = usize::from(column.width).saturating_sub(24) / 2;
        let limited = if tick.limited & (1 << joint) != 0 { "!" } else { " " };
        let mut spans = vec![span(theme, Role::Quiet, format!("{:<9}", joint_name(joint)))];
        spans.extend(bar(theme, torque / limits.max_torque[joint], width));
        spans.push(Span::raw(format!("{:6.1}{limited} ", without_sign_of_zero(torque))));
        spans.extend(bar(theme, speed / limits.max_velocity[joint], width));
        spans.push(Span::raw(format!("{:6.1}", without_sign_of_zero(speed))));
        frame.render_widget(Line::from(spans), Rect { y: column.y + row, height: 1, ..column });
    }
}
