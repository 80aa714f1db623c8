//! View 1, Live: what the robot does now, what comes next and what came of the last trials.
//!
//! ```text
//! roll +0.021 rad    ±0.50   pitch -0.013 rad   ±0.50   Trial 8, by the sampler ────
//! ⣀⣀⣀⠤⠔⠊⠁⠀⠀⠀⠈⠒⠤⢄⣀          ⣀⣀⣀⣀⣀⣀⣀⣀⣀⣀⣀⣀⣀           f0    1.243 Hz  ├────●─────┤
//! FL foot -0.196 m           FR foot -0.196 m            Fx    118.2 N   ├───────●──┤
//! ⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤          ⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤           Fz    243.9 N   ├───●──────┤
//! RL foot -0.197 m           RR foot -0.196 m           J over trials ──── best 0.642 m
//! ⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤          ⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤⠤           o  o x o O
//!     iifffl                     iifffl
//!    #  f0 Hz   Fx N    Fz N    J m     verdict  source    cause
//!    7  1.243   118.2   243.9   0.642   accept   sampler
//! ```

use quadfrog::robot::{JOINTS, LEGS, Leg, joint_name};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};

use super::chart::{Chart, Signal, TimeAxis, draw_phases};
use super::{heading, objective, proposal, span, trials, wireframe};
use crate::model::{Model, SeriesSet};
use crate::settings::ChartMode;
use crate::theme::Role;

/// Width of the right-hand side.
const SIDE: u16 = 32;

const TILT: &[(f32, f32)] = &[(-0.25, 0.25), (-0.5, 0.5), (-1.0, 1.0), (-3.2, 3.2)];
const FOOT: &[(f32, f32)] = &[(-0.35, -0.05), (-0.45, 0.05)];
const FORCE: &[(f32, f32)] = &[(0.0, 100.0), (0.0, 400.0), (0.0, 1000.0)];

const fn foot(name: &'static str, value: fn(&crate::history::Sample) -> f32, role: Role) -> Signal {
    Signal { name, unit: "m", value, ranges: FOOT, role }
}

const fn force(name: &'static str, value: fn(&crate::history::Sample) -> f32, role: Role) -> Signal {
    Signal { name, unit: "N", value, ranges: FORCE, role }
}

/// The charts of a set, two in a row, laid out as the feet are seen from above.
fn signals(set: SeriesSet) -> [Signal; 6] {
    use Role::{SeriesA, SeriesB};
    match set {
        SeriesSet::Attitude => [
            Signal { name: "roll", unit: "rad", value: |s| s.roll, ranges: TILT, role: SeriesA },
            Signal { name: "pitch", unit: "rad", value: |s| s.pitch, ranges: TILT, role: SeriesB },
            foot("FL foot", |s| s.foot_z[Leg::FL as usize], SeriesA),
            foot("FR foot", |s| s.foot_z[Leg::FR as usize], SeriesA),
            foot("RL foot", |s| s.foot_z[Leg::RL as usize], SeriesB),
            foot("RR foot", |s| s.foot_z[Leg::RR as usize], SeriesB),
        ],
        SeriesSet::Forces => [
            Signal {
                name: "height",
                unit: "m",
                value: |s| s.height,
                ranges: &[(0.0, 0.5), (0.0, 1.0), (0.0, 2.0)],
                role: SeriesA,
            },
            Signal { name: "oscillator", unit: "rad", value: |s| s.theta, ranges: &[(0.0, 6.3)], role: SeriesB },
            force("FL force", |s| s.foot_force[Leg::FL as usize], SeriesA),
            force("FR force", |s| s.foot_force[Leg::FR as usize], SeriesA),
            force("RL force", |s| s.foot_force[Leg::RL as usize], SeriesB),
            force("RR force", |s| s.foot_force[Leg::RR as usize], SeriesB),
        ],
    }
}

/// Draws the view.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let table_rows = (area.height / 4).clamp(5, 14);
    let [upper, table] = Layout::vertical([Constraint::Fill(1), Constraint::Length(table_rows)]).areas(area);
    let side = if area.width >= 120 { SIDE + 10 } else { SIDE };
    let [charts, _, side] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Length(1), Constraint::Length(side)]).areas(upper);
    let card_rows = proposal::rows(model).min(side.height.saturating_sub(5));
    let picture_rows = if side.height >= card_rows + 18 { 12 } else { 0 };
    let [card, objective_area, picture] =
        Layout::vertical([Constraint::Length(card_rows), Constraint::Fill(1), Constraint::Length(picture_rows)])
            .areas(side);
    if area.width >= 120 && charts.height >= 24 {
        let [charts, joints] = Layout::vertical([Constraint::Fill(1), Constraint::Length(9)]).areas(charts);
        render_charts(frame, charts, model);
        render_joints(frame, joints, model);
    } else {
        render_charts(frame, charts, model);
    }
    proposal::render(frame, card, model);
    objective::render(frame, objective_area, model);
    if picture_rows > 0 {
        wireframe::render(frame, picture, model);
    }
    trials::render_table(frame, table, model, false);
}

fn render_charts(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = model.theme;
    let [charts, strip] = Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(area);
    let history = model.charted();
    let axis = TimeAxis {
        mode: model.live.mode,
        window_ns: (model.live.window_s * 1e9) as u64,
        newest_ns: history.newest_ns(),
    };
    let ghost = model.live.ghost.and_then(|trial| history.trace(trial));
    let cursor_ns = model.live.frozen.is_some().then_some(model.live.cursor_ns);
    let rows = Layout::vertical([Constraint::Fill(1); 3]).split(charts);
    let columns = |area: Rect| -> [Rect; 2] { Layout::horizontal([Constraint::Fill(1); 2]).spacing(1).areas(area) };
    for (index, signal) in signals(model.live.series).into_iter().enumerate() {
        let cell = columns(rows[index / 2])[index % 2];
        Chart { signal, axis, history, ghost, cursor_ns, cursor_line: model.live.cursor_line, theme }
            .draw(frame.buffer_mut(), cell);
    }
    for cell in columns(strip) {
        draw_phases(frame.buffer_mut(), cell, &axis, history, &theme);
    }
    render_axis(frame, strip, model);
}

/// What the time axis is, at the right end of the strip under the charts.
fn render_axis(frame: &mut Frame, strip: Rect, model: &Model) {
    let mode = if model.live.mode == ChartMode::Sweep { "sweep" } else { "scroll" };
    let (role, text) = match &model.live.frozen {
        Some((history, at)) => {
            let ago = model.clock.saturating_sub(*at).as_secs_f64();
            let back = (history.newest_ns().saturating_sub(model.live.cursor_ns)) as f64 / 1e9;
            (Role::Warning, format!(" FROZEN {ago:.0} s ago, cursor -{back:.2} s "))
        }
        None => (Role::Quiet, format!(" {} s {mode} ", model.live.window_s)),
    };
    let width = (text.chars().count() as u16).min(strip.width);
    let area = Rect { x: strip.right() - width, width, ..strip };
    frame.render_widget(Line::from(span(&model.theme, role, text)), area);
}

/// Torque and speed of each joint as bars against their limits; `!` where the last gate cut the command.
fn render_joints(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    let tick = &model.snapshot.tick;
    let body = heading(frame, area, theme, "Joints", "torque in N m, speed in rad/s, of their limits");
    let Some(robot) = &model.robot else {
        frame.render_widget(Line::from(span(theme, Role::Quiet, "the robot's limits are not known here")), body);
        return;
    };
    let columns = Layout::horizontal([Constraint::Fill(1); 2]).spacing(2).split(body);
    let half = JOINTS / 2;
    for joint in 0..LEGS * 3 {
        let column = columns[joint / half];
        let row = (joint % half) as u16;
        if row >= column.height {
            continue;
        }
        let torque = tick.state.joint_torque[joint];
        let speed = tick.state.joint_velocity[joint];
        let limits = &robot.limits;
        let width = usize::from(column.width).saturating_sub(24) / 2;
        let limited = if tick.limited & (1 << joint) != 0 { "!" } else { " " };
        let mut spans = vec![span(theme, Role::Quiet, format!("{:<9}", joint_name(joint).replace('_', " ")))];
        spans.extend(bar(model, torque / limits.max_torque[joint], width));
        spans.push(Span::raw(format!("{torque:6.1}{limited} ")));
        spans.extend(bar(model, speed / limits.max_velocity[joint], width));
        spans.push(Span::raw(format!("{speed:6.1}")));
        frame.render_widget(Line::from(spans), Rect { y: column.y + row, height: 1, ..column });
    }
}

/// A share of a limit as a bar; beyond nine tenths it warns.
pub fn bar(model: &Model, share: f64, width: usize) -> [Span<'static>; 2] {
    let theme = &model.theme;
    let size = if share.is_finite() { share.abs().min(1.0) } else { 1.0 };
    let filled = (size * width as f64).round() as usize;
    let (full, empty) = theme.fill();
    let role = if size >= 0.9 { Role::Warning } else { Role::SeriesA };
    [span(theme, role, full.repeat(filled)), span(theme, Role::Quiet, empty.repeat(width - filled))]
}
