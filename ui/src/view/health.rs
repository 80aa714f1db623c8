//! View 5, Health: loop timing, recorder, link, motors, battery, arming checks.

use quadfrog::recording::live::LiveStatus;
use quadfrog::recording::record::{ArmingCheckRecord, HealthLimits};
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::robot::{Battery, JOINTS, LinkStatus, joint_name};
use quadfrog::telemetry::ArmingCheck;
use quadfrog::trial::counted;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{NO_STATE, heading, span, without_sign_of_zero};
use super::health_history;
use crate::action::Action;
use crate::arming;
use crate::model::Model;
use crate::model::history::ChartSample;
use crate::theme::Role;
use crate::wrap::wrap_all;

/// Rows and columns from which the history is below or beside the numbers; a smaller terminal shows one of the two.
const HISTORY_BELOW: u16 = 46;
const HISTORY_BESIDE: u16 = 170;
/// Rows of the numbers where the history is below them.
const NUMBER_ROWS: u16 = 34;

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let key = model.keymap.key(Action::Series);
    // Where there is no room for both.
    let mut loop_aside = String::new();
    let area = if area.height >= HISTORY_BELOW {
        let [numbers, history] = Layout::vertical([Constraint::Length(NUMBER_ROWS), Constraint::Fill(1)]).areas(area);
        health_history::render(frame, history, model, false);
        numbers
    } else if area.width >= HISTORY_BESIDE {
        let [numbers, history] = Layout::horizontal([Constraint::Fill(2), Constraint::Fill(1)]).spacing(2).areas(area);
        health_history::render(frame, history, model, false);
        numbers
    } else if model.health_history_shown {
        return health_history::render(frame, area, model, true);
    } else {
        loop_aside = format!("history ({key})");
        area
    };
    let right_width = MOTOR_WIDTH.max(area.width.saturating_sub(2) / 2);
    let [left, right] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Length(right_width)]).spacing(2).areas(area);
    render_numbers(frame, left, model, &loop_aside);
    let [motors, checks] = Layout::vertical([Constraint::Length(JOINTS as u16 + 1), Constraint::Fill(1)]).areas(right);
    let limited = if model.snapshot.tick.limited != 0 { "max: limited by the gate" } else { "" };
    panel(frame, motors, model, ("Motors", limited), lines(model, right.width, MOTOR_NAME_WIDTH, &motor_rows(model)));
    let aside = format!("{} ({})", arming::summary(model), model.keymap.key(Action::ArmingChecks));
    let title = if checks.width < WHOLE_TITLE_FROM { "Arming" } else { "Arming checks" };
    let body = heading(frame, checks, &model.theme, title, &aside);
    let lines = arming::lines(model, usize::from(body.width), usize::from(body.height));
    frame.render_widget(Paragraph::new(lines), body);
}

/// Columns from which the heading of the arming checks has room for its whole title beside their time.
const WHOLE_TITLE_FROM: u16 = 44;

const NAME_WIDTH: usize = 13;
const MOTOR_NAME_WIDTH: usize = 9;
/// Columns of a motor beyond its limit.
const MOTOR_WIDTH: u16 = 40;

/// A row of a panel.
struct HealthRow {
    name: String,
    value: String,
    /// Whether it is beyond its limit.
    beyond: bool,
    /// Left out where it has no room, unless it is beyond its limit.
    detail: bool,
    /// Whether it is of an earlier time: grey.
    past: bool,
}

fn row(name: &str, value: String, beyond: bool) -> HealthRow {
    HealthRow { name: name.to_owned(), value, beyond, detail: false, past: false }
}

fn detail(name: &str, value: String, beyond: bool) -> HealthRow {
    HealthRow { detail: true, ..row(name, value, beyond) }
}

/// The rows as lines of `width`; a long value continues on the next line.
fn lines(model: &Model, width: u16, name_width: usize, rows: &[HealthRow]) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let line = |row: &HealthRow| {
        let HealthRow { name, value, beyond, past, .. } = row;
        let value = match (past, beyond) {
            (true, _) => span(theme, Role::Quiet, value.as_str()),
            (false, true) => span(theme, Role::Warning, format!("{value} !")),
            (false, false) => Span::raw(value.clone()),
        };
        Line::from(vec![span(theme, Role::Quiet, format!("{name:<name_width$}")), value])
    };
    wrap_all(&rows.iter().map(line).collect::<Vec<_>>(), usize::from(width), name_width)
}

fn panel(frame: &mut Frame, area: Rect, model: &Model, (title, aside): (&str, &str), lines: Vec<Line<'static>>) {
    let body = heading(frame, area, &model.theme, title, aside);
    frame.render_widget(Paragraph::new(lines), body);
}

/// Loop, recorder and robot below each other, with as many details as have room; the histogram if it has room besides.
fn render_numbers(frame: &mut Frame, area: Rect, model: &Model, loop_aside: &str) {
    let titles = [("Loop", loop_aside), ("Recorder and screen", ""), ("Link and battery", "")];
    let mut rows = [timing_rows(model), recorder_rows(model, usize::from(area.width)), robot_rows(model)];
    let as_lines = |rows: &[Vec<HealthRow>; 3]| rows.each_ref().map(|rows| lines(model, area.width, NAME_WIDTH, rows));
    let height = |panels: &[Vec<Line>; 3]| panels.iter().map(|lines| lines.len() + 1).sum::<usize>();
    let room = usize::from(area.height);
    let mut shown = as_lines(&rows);
    let histogram = height(&shown) + HISTOGRAM_ROWS <= room;
    while height(&shown) > room {
        let last_detail = |rows: &mut Vec<HealthRow>| {
            let at = rows.iter().rposition(|row| row.detail && !row.beyond);
            at.map(|at| rows.remove(at))
        };
        if rows.iter_mut().rev().find_map(last_detail).is_none() {
            break;
        }
        shown = as_lines(&rows);
    }
    let mut rest = area;
    for (at, (title, lines)) in titles.into_iter().zip(shown).enumerate() {
        let [place, below] =
            Layout::vertical([Constraint::Length(lines.len() as u16 + 1), Constraint::Fill(1)]).areas(rest);
        panel(frame, place, model, title, lines);
        rest = below;
        if at == 0 && histogram {
            let [place, below] =
                Layout::vertical([Constraint::Length(HISTOGRAM_ROWS as u16), Constraint::Fill(1)]).areas(rest);
            let rows = lateness_rows(model, usize::from(place.width));
            let lines = self::lines(model, place.width, NAME_WIDTH, &rows);
            panel(frame, place, model, ("Wake-up latency, last minute", ""), lines);
            rest = below;
        }
    }
}

/// Rows of the histogram of the wake-up latency, with its title and an empty one.
const HISTOGRAM_ROWS: usize = 9;

/// Upper ends of the histogram's classes, microseconds; the last class has none.
const CLASSES_US: [u32; 6] = [20, 50, 100, 200, 500, 1000];

/// The value below which the given share of the sorted values lies.
fn percentile(sorted: &[u32], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1) as f64;
    sorted.get((last * share).round() as usize).copied().map_or(0.0, f64::from)
}

fn timing_rows(model: &Model) -> Vec<HealthRow> {
    let tick = &model.snapshot.tick;
    let counters = &model.snapshot.counters;
    let limits = &model.session.info.limits;
    let share = counters.late_ticks as f64 / tick.number.max(1) as f64;
    let sorted = |value: fn(&ChartSample) -> u32| {
        let mut values: Vec<u32> = model.history.samples().map(value).collect();
        values.sort_unstable();
        values
    };
    let (late, busy) = (sorted(|sample| sample.lateness_ns), sorted(|sample| sample.busy_ns));
    let micro = |values: &[u32]| {
        let [p50, p99] = [0.5, 0.99].map(|share| percentile(values, share) / 1e3);
        format!("p50 {p50:.0} us, p99 {p99:.0} us")
    };
    let matters = model.lateness_matters();
    let worst_ms = counters.worst_lateness_ns as f64 / 1e6;
    let stages = &tick.stages;
    let [read, decide, write] = [stages.read_ns, stages.decide_ns, stages.write_ns].map(|ns| f64::from(ns) / 1e3);
    vec![
        detail("ticks", tick.number.to_string(), false),
        row(
            "late ticks",
            format!("{} ({:.3} %)", counters.late_ticks, share * 100.0),
            matters && share > limits.late_share,
        ),
        row("worst", format!("{worst_ms:.2} ms late"), matters && worst_ms > limits.late_ms),
        row("wake-up", micro(&late), matters && percentile(&late, 0.99) > 5e5),
        row("tick takes", micro(&busy), percentile(&busy, 0.99) > 5e5),
        // The names before the column of the values: so three numbers of three digits have room in 38 columns.
        detail("read, decide, write ", format!("{read:.0}, {decide:.0}, {write:.0} us"), false),
    ]
}

fn lateness_rows(model: &Model, width: usize) -> Vec<HealthRow> {
    let mut counts = [0_u32; CLASSES_US.len() + 1];
    for sample in model.history.samples() {
        let class = CLASSES_US.iter().position(|limit| sample.lateness_ns < limit * 1000);
        counts[class.unwrap_or(CLASSES_US.len())] += 1;
    }
    let total = f64::from(counts.iter().sum::<u32>().max(1));
    let (full, _) = model.theme.fill();
    let room = width.saturating_sub(NAME_WIDTH + 8) as f64;
    let bar = |(class, count): (usize, u32)| {
        let name = CLASSES_US.get(class).map_or("1 ms or more".to_owned(), |limit| format!("< {limit} us"));
        let share = f64::from(count) / total;
        row(&name, format!("{:5.1} % {}", share * 100.0, full.repeat((share * room) as usize)), false)
    };
    counts.into_iter().enumerate().map(bar).collect()
}

fn recorder_rows(model: &Model, width: usize) -> Vec<HealthRow> {
    let recording = &model.session.info.recording;
    // The present one of several files.
    let present = model.recorder.as_ref().map(|status| status.file.display().to_string());
    let file = present.filter(|file| !file.is_empty()).unwrap_or_else(|| recording.clone());
    let counters = &model.snapshot.counters;
    // The end of the path identifies the study and the recording. Where both have no room in a row, the folder has one of its own.
    let name = |path: &str| match path.rsplit_once('/') {
        Some((folder, file)) => (file.to_owned(), format!("in {}", folder.rsplit('/').next().unwrap_or_default())),
        None if path.is_empty() => ("none".to_owned(), String::new()),
        None => (path.to_owned(), String::new()),
    };
    let (recorded, folder) = name(&file);
    let (stored, study_folder) = name(&model.session.info.study);
    let beside = |file: &str, folder: &str| format!("{file} {folder}").trim_end().to_owned();
    let fits = NAME_WIDTH + beside(&recorded, &folder).chars().count() <= width;
    let not_recording = recording.is_empty() && model.replay.is_none();
    let mut rows = vec![row("recording", if fits { beside(&recorded, &folder) } else { recorded }, not_recording)];
    if !fits {
        rows.push(row(&folder, String::new(), false));
    }
    // That of a recording in the same folder has been named.
    let same = !fits && folder == study_folder;
    rows.extend([
        detail("study", if same { stored } else { beside(&stored, &study_folder) }, false),
        match &model.recorder {
            Some(status) if status.incomplete().is_some() => {
                row("writing", status.incomplete().unwrap_or_default().to_owned(), true)
            }
            Some(status) => row("written", written(status, model.snapshot.tick.time_ns), false),
            None => row("written", "-".to_owned(), false),
        },
        disk_row(model),
        row("not recorded", counted(counters.ticks_not_recorded as usize, "tick"), counters.ticks_not_recorded > 0),
        detail("not shown", counted(counters.ticks_not_shown as usize, "tick"), false),
        detail("refused", counted(counters.commands_refused as usize, "command"), false),
    ]);
    if let Some(LiveStatus { address, viewers, dropped }) = model.viewers {
        rows.push(row("live view", format!("{address}, {viewers} viewers, {dropped} messages left out"), false));
    }
    if let Some(observers) = model.observers {
        rows.push(detail("observers", format!("{observers} with quadfrog attach"), false));
    }
    rows
}

/// The free space of the disk, from the newest arming checks; grey once the robot is armed.
fn disk_row(model: &Model) -> HealthRow {
    let disk = model.session.arming_checks.iter().find(|item| item.check == ArmingCheck::Disk);
    let Some(ArmingCheckRecord { found, state, .. }) = disk else { return row("disk", "-".to_owned(), false) };
    match arming::checked_at(model) {
        Some(at) => HealthRow { past: true, ..row("disk", format!("{found} at {at}"), false) },
        None => row("disk", found.clone(), !state.allows()),
    }
}

fn robot_rows(model: &Model) -> Vec<HealthRow> {
    let tick = &model.snapshot.tick;
    let counters = &model.snapshot.counters;
    let limits = &model.session.info.limits;
    let mut rows = Vec::new();
    match counters.link {
        Some(link) => rows.extend(link_rows(&link, limits)),
        None if model.session.info.is_hardware() => {
            let age_ms = counters.state_age_ms;
            rows.push(row("state age", format!("{age_ms} ms"), age_ms > limits.state_age_ms));
        }
        None => rows.push(row("link", "SIM: no link".to_owned(), false)),
    }
    // What a silent robot has sent last is no value of now.
    let heard = !model.robot_is_silent();
    let robot_s = f64::from(tick.state.robot_time_ms) / 1e3;
    let clock = if heard { format!("{robot_s:.1} s since its start") } else { "-".to_owned() };
    rows.push(detail("robot clock", clock, false));
    match tick.state.battery.filter(|_| heard) {
        Some(battery) => {
            let cells: Vec<f64> = battery.cell_v.into_iter().filter(|v| *v > 0.0).collect();
            let low = cells.iter().copied().fold(f64::INFINITY, f64::min);
            let high = cells.iter().copied().fold(0.0, f64::max);
            let low_charge = battery.charge_percent < limits.battery_percent;
            let Battery { charge_percent, voltage_v, current_a, .. } = battery;
            rows.push(row("battery", format!("{charge_percent:.0} %, {voltage_v:.1} V, {current_a:.1} A"), low_charge));
            if !cells.is_empty() {
                rows.push(row("cells", format!("{low:.3} to {high:.3} V",), high - low > 0.1));
            }
        }
        None if !heard => rows.push(row("battery", "-".to_owned(), false)),
        None => rows.push(row("battery", "none".to_owned(), false)),
    }
    rows
}

fn written(status: &RecorderStatus, time_ns: u64) -> String {
    let megabytes = status.bytes as f64 / 1e6;
    let rate = status.bytes as f64 / 1e3 / (time_ns as f64 / 1e9).max(1.0);
    format!("{megabytes:.1} MB, {rate:.0} kB/s")
}

fn link_rows(link: &LinkStatus, limits: &HealthLimits) -> Vec<HealthRow> {
    let loss = 100.0 * link.loss_share();
    let states = format!("{} Hz, {} ms old", link.rate_hz, link.state_age_ms);
    let mut rows = vec![
        row("states", states, link.state_age_ms > limits.state_age_ms),
        row("lost in 5 s", format!("{loss:.2} %, {} in all", link.lost), loss >= 100.0 * limits.loss_share),
        row("corrupt", format!("{} in 5 s, {} in all", link.recent_corrupt, link.corrupt), link.recent_corrupt > 0),
        row("restarts", link.reboots.to_string(), link.reboots > 0),
        detail("out of order", format!("{}, duplicate {}", link.out_of_order, link.duplicate), false),
        detail("other header", format!("{}, other length {}", link.foreign, link.wrong_length), false),
        detail("sent", format!("{}, failed {}", link.sent, link.send_errors), link.send_errors > 0),
    ];
    // Only DDS shows them: on another link none is no sign.
    if link.foreign_commands > 0 {
        rows.push(row("others sent", counted(link.foreign_commands as usize, "command"), true));
    }
    rows
}

fn motor_rows(model: &Model) -> Vec<HealthRow> {
    let tick = &model.snapshot.tick;
    if model.robot_is_silent() {
        return vec![row(NO_STATE, String::new(), false)];
    }
    let mut rows = Vec::new();
    // A robot that reports no temperatures, as the simulator, sends zeros.
    let measured = tick.state.motor_temperature_c.iter().any(|temperature| *temperature > 0.0);
    for joint in 0..JOINTS {
        let temperature = tick.state.motor_temperature_c[joint];
        let degrees = if measured { format!("{temperature:3.0} C") } else { "  - C".to_owned() };
        let state = match (tick.state.motor_enabled[joint], tick.limited & (1 << joint) != 0) {
            // That of a motor that was never commanded says nothing.
            _ if !tick.mode.commanded() => "-",
            (false, _) => "off",
            (true, false) => "on",
            (true, true) => "max",
        };
        let q = tick.state.joint_position_rad[joint];
        let torque = without_sign_of_zero(tick.state.joint_torque_n_m[joint]);
        let text = format!("{degrees} {state:<3} {q:+5.2} rad {torque:+5.1} N m");
        rows.push(row(&joint_name(joint), text, temperature >= model.session.info.limits.motor_c));
    }
    rows
}
