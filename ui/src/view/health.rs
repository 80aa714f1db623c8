//! View 5, Health: is the machine, and are we, fit for the next jump?
//!
//! ```text
//! Loop ──────────────────────────   Motors ────────────────────────────
//! lateness   12 us, worst 0.1 ms    FR_hip     31 C  on
//! stages     read 3 decide 9 ...    ...
//! ```

use quadfrog::robot::{JOINTS, joint_name};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{heading, span};
use crate::model::Model;
use crate::theme::Role;

/// Draws the view.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let [left, right] = Layout::horizontal([Constraint::Fill(1); 2]).spacing(2).areas(area);
    let [timing, recording, robot] =
        Layout::vertical([Constraint::Length(8), Constraint::Length(6), Constraint::Fill(1)]).areas(left);
    panel(frame, timing, model, "Loop", timing_rows(model));
    panel(frame, recording, model, "Recorder and screen", recorder_rows(model));
    panel(frame, robot, model, "Robot", robot_rows(model));
    panel(frame, right, model, "Motors", motor_rows(model));
}

/// A line of a panel: name, value, and whether it needs a look.
type Row = (String, String, bool);

fn panel(frame: &mut Frame, area: Rect, model: &Model, title: &str, rows: Vec<Row>) {
    let theme = &model.theme;
    let body = heading(frame, area, theme, title, "");
    let line = |(name, value, look): Row| {
        let value = if look { span(theme, Role::Warning, format!("{value} !")) } else { Span::raw(value) };
        Line::from(vec![span(theme, Role::Quiet, format!("{name:<14}")), value])
    };
    frame.render_widget(Paragraph::new(rows.into_iter().map(line).collect::<Vec<_>>()), body);
}

fn row(name: &str, value: String, look: bool) -> Row {
    (name.to_owned(), value, look)
}

fn timing_rows(model: &Model) -> Vec<Row> {
    let tick = &model.snapshot.tick;
    let counters = &model.snapshot.counters;
    let micro = |ns: u32| format!("{:.1} us", f64::from(ns) / 1e3);
    let share = counters.late_ticks as f64 / tick.number.max(1) as f64;
    vec![
        row("ticks", tick.number.to_string(), false),
        row("late ticks", format!("{} ({:.3} %)", counters.late_ticks, share * 100.0), share > 0.001),
        row(
            "worst",
            format!("{:.2} ms late", counters.worst_lateness_ns as f64 / 1e6),
            counters.worst_lateness_ns > 10_000_000,
        ),
        row("this tick", format!("{} late", micro(tick.stages.lateness_ns)), false),
        row("  read", micro(tick.stages.read_ns), false),
        row("  decide", micro(tick.stages.decide_ns), false),
        row("  write", micro(tick.stages.write_ns), false),
    ]
}

fn recorder_rows(model: &Model) -> Vec<Row> {
    let counters = &model.snapshot.counters;
    let file = if model.session.recording.is_empty() { "none" } else { &model.session.recording };
    vec![
        row("recording", file.to_owned(), model.session.recording.is_empty() && model.replay.is_none()),
        row(
            "study",
            if model.session.study.is_empty() { "none".to_owned() } else { model.session.study.clone() },
            false,
        ),
        row("not recorded", format!("{} ticks", counters.ticks_not_recorded), counters.ticks_not_recorded > 0),
        row("not shown", format!("{} ticks", counters.ticks_not_shown), false),
        row("refused", format!("{} commands", counters.commands_refused), false),
    ]
}

fn robot_rows(model: &Model) -> Vec<Row> {
    let tick = &model.snapshot.tick;
    let mut rows = vec![
        row(
            "state age",
            format!("{} ms", model.snapshot.counters.state_age_ms),
            model.snapshot.counters.state_age_ms > 5,
        ),
        row("robot's clock", format!("{:.1} s", f64::from(tick.state.robot_time_ms) / 1e3), false),
    ];
    match tick.state.battery {
        Some(battery) => {
            let cells: Vec<f64> = battery.cell_v.into_iter().filter(|v| *v > 0.0).collect();
            let low = cells.iter().copied().fold(f64::INFINITY, f64::min);
            let high = cells.iter().copied().fold(0.0, f64::max);
            rows.push(row("battery", format!("{:.0} %", battery.charge_percent), battery.charge_percent < 30.0));
            rows.push(row("", format!("{:.1} V, {:.1} A", battery.voltage_v, battery.current_a), false));
            if !cells.is_empty() {
                rows.push(row("cells", format!("{low:.3} to {high:.3} V",), high - low > 0.1));
            }
        }
        None => rows.push(row("battery", "none".to_owned(), false)),
    }
    rows
}

fn motor_rows(model: &Model) -> Vec<Row> {
    let tick = &model.snapshot.tick;
    let mut rows = Vec::new();
    for joint in 0..JOINTS {
        let temperature = tick.state.motor_temperature_c[joint];
        let state = if tick.state.motor_enabled[joint] { "follows" } else { "off" };
        let limited = if tick.limited & (1 << joint) != 0 { " limited" } else { "" };
        let (q, torque) = (tick.state.joint_position[joint], tick.state.joint_torque[joint]);
        let text = format!("{temperature:3.0} C {q:+7.3} rad {torque:+6.1} Nm {state}{limited}");
        rows.push((joint_name(joint), text, temperature >= 60.0));
    }
    rows
}
