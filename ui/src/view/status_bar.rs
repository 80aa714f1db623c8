//! The permanent frame: two lines at the top, the tabs, the message line; a reduced form on a small terminal.

use quadfrog::recording::record::LogLevel;
use quadfrog::robot::joint_name;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Approval, Backend};
use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::draw::{clock, clock_ms, number, span, truncate, without_sign_of_zero};
use super::next_step;
use crate::action::Action;
use crate::layout::{COMPACT_COLUMNS, COMPACT_ROWS, message_rows, tabs};
use crate::model::trials::BestValue;
use crate::model::{Model, View};
use crate::theme::Role;
use crate::wrap::wrap;

/// Age of the newest tick from which the numbers count as old, ms.
const STALE_MS: u128 = 500;

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let [first, second] = Layout::vertical([Constraint::Length(1); 2]).areas(area);
    let recording = Line::from(recording(model));
    let width = recording.width() as u16;
    let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Length(width)]).spacing(1).areas(first);
    frame.render_widget(identity(model, area.width, usize::from(left.width)), left);
    frame.render_widget(recording, right);
    frame.render_widget(Line::from(condition(model, area.width)), second);
}

/// The mode. A robot that stands ready while a trial waits for its verdict, as after an undone one, is in review for the operator.
pub fn mode_span(model: &Model) -> Span<'static> {
    let mode = match model.mode() {
        Mode::Ready if model.session.under_review().is_some() => Mode::Review,
        mode => mode,
    };
    let role = match mode {
        Mode::Damped | Mode::Fault => Role::Alarm,
        Mode::Ready | Mode::Review => Role::Good,
        Mode::StandUp | Mode::Countdown | Mode::Jump | Mode::Settle | Mode::SitDown => Role::Warning,
        Mode::Offline | Mode::Observe | Mode::Disarmed => Role::Key,
    };
    span(&model.theme, role, format!(" {:<9} ", mode.name()))
}

fn backend(model: &Model) -> Span<'static> {
    let theme = &model.theme;
    match model.session.info.backend {
        _ if let Some(observer) = model.observer() => match observer.ended {
            true => span(theme, Role::Bad, "ENDED"),
            false => span(theme, Role::Warning, "WATCHING"),
        },
        _ if model.replay.is_some() => span(theme, Role::Heading, "REPLAY"),
        None => span(theme, Role::Quiet, "starting"),
        Some(Backend::Simulator) => span(theme, Role::Heading, "SIM"),
        Some(Backend::Hardware) => {
            span(theme, Role::Hardware, format!(" {} ", model.session.info.robot.to_uppercase()))
        }
    }
}

/// Mode, machine, task, trial and best, within `room` characters: words give way before numbers, and a number is shown whole or
/// not at all.
fn identity(model: &Model, width: u16, room: usize) -> Line<'static> {
    let columns = |spans: &[Span]| spans.iter().map(Span::width).sum::<usize>();
    let forms = [Words::Whole, Words::Few, Words::Fewest].into_iter().skip(usize::from(width < 100));
    let mut lines: Vec<_> = forms.map(|words| identity_in(model, words)).collect();
    let at = lines.iter().position(|(spans, _)| columns(spans) <= room).unwrap_or(lines.len() - 1);
    let (mut spans, mut ends) = lines.swap_remove(at);
    while columns(&spans) > room
        && let Some(end) = ends.pop()
    {
        spans.truncate(end);
    }
    Line::from(spans)
}

/// Words beside the numbers of the first line.
#[derive(Clone, Copy, PartialEq)]
enum Words {
    Whole,
    Few,
    Fewest,
}

/// The parts of the first line with these words, and the numbers of parts before which it can end, the least important last.
fn identity_in(model: &Model, words: Words) -> (Vec<Span<'static>>, Vec<usize>) {
    let theme = &model.theme;
    let mut spans = vec![mode_span(model), Span::raw(" "), backend(model), Span::raw("  ")];
    let session = &model.session.info;
    if session.observe {
        spans.push(span(theme, Role::Warning, "OBSERVING  "));
    }
    if session.approve != Approval::Each && model.replay.is_none() {
        let approve = session.approve.name().to_uppercase();
        let text = match words {
            Words::Whole => format!("APPROVE {approve}  "),
            Words::Few => format!("{approve}  "),
            Words::Fewest => format!("{}  ", approve.split('-').next().unwrap_or_default()),
        };
        spans.push(span(theme, Role::Warning, text));
    }
    spans.push(Span::raw(session.task_name()));
    let mut ends = Vec::new();
    if let Some(trial) = model.session.shown_trial() {
        let (finished, budget) = (model.session.counted(), model.session.budget());
        let parts = match words {
            Words::Whole => [format!("   trial #{trial}"), format!("   {finished} of {budget} counted")],
            Words::Few => [format!("  trial #{trial}"), format!("  {finished}/{budget}")],
            Words::Fewest => [format!("  #{trial}"), format!("  {finished}/{budget}")],
        };
        for part in parts {
            ends.push(spans.len());
            spans.push(Span::raw(part));
        }
    }
    if let Some(BestValue { trial, value, by_hand, chosen }) = model.session.trials.best_value() {
        ends.push(spans.len());
        spans.push(Span::raw(if words == Words::Whole { "   best " } else { "  best " }));
        spans.push(span(theme, Role::Good, format!("{} {}{by_hand}", number(value), session.unit)));
        ends.push(spans.len());
        let chosen = if words == Words::Whole { chosen } else { "" };
        spans.push(span(theme, Role::Quiet, format!(" (#{trial}{chosen})")));
    }
    (spans, ends)
}

fn recording(model: &Model) -> Vec<Span<'static>> {
    let theme = &model.theme;
    if let Some(replay) = &model.replay {
        // Milliseconds are readable only while it does not play.
        let at = if replay.playing { clock(replay.time_ns) } else { clock_ms(replay.time_ns) };
        let speed = if replay.playing || replay.speed != 1.0 { format!(" x{}", replay.speed) } else { String::new() };
        let paused = if replay.playing { "" } else { " paused" };
        let text = format!("{at} / {}{paused}{speed} ", clock(replay.duration_ns));
        return vec![span(theme, Role::Text, text)];
    }
    let counters = &model.snapshot.counters;
    let elapsed = clock(model.snapshot.tick.time_ns);
    if let Some(status) = model.recorder.as_ref().filter(|status| status.incomplete().is_some()) {
        // After the error of an earlier file the present one goes on.
        let text = if status.error.is_some() { "NOT RECORDED " } else { "REC INCOMPLETE " };
        return vec![span(theme, Role::Bad, text), Span::raw(format!("{elapsed} "))];
    }
    match (model.session.info.recording.is_empty(), counters.ticks_not_recorded) {
        (true, _) => vec![span(theme, Role::Quiet, format!("not recording {elapsed} "))],
        (false, 0) => vec![span(theme, Role::Good, "REC "), Span::raw(format!("{elapsed} "))],
        (false, lost) => {
            vec![span(theme, Role::Bad, format!("REC {lost} ticks lost ")), Span::raw(format!("{elapsed} "))]
        }
    }
}

/// The keys that stop now.
fn stop_keys(model: &Model) -> String {
    match model.space_bar_is_text() {
        true => "F12 Ctrl-C".to_owned(),
        false => model.keymap.all_keys(Action::Stop),
    }
}

fn condition(model: &Model, width: u16) -> Vec<Span<'static>> {
    let theme = &model.theme;
    let narrow = width < 100;
    let mut spans = match model.can_stop() {
        true => vec![
            Span::raw(" "),
            span(theme, Role::Alarm, " STOP "),
            Span::raw(" "),
            span(theme, Role::Key, stop_keys(model)),
        ],
        false => vec![span(theme, Role::Quiet, " recorded: no robot to stop")],
    };
    let mut parts: Vec<(&str, Role, String)> = Vec::new();
    let mut part = |name, role, value: String| parts.push((name, role, value));
    let snapshot = &model.snapshot;
    let counters = &snapshot.counters;
    let limits = &model.session.info.limits;
    let late_share = counters.late_ticks as f64 / snapshot.tick.number.max(1) as f64;
    let late = match narrow {
        true => format!("{} late", counters.late_ticks),
        false => format!("{} late, worst {:.1} ms", counters.late_ticks, counters.worst_lateness_ns as f64 / 1e6),
    };
    part("loop ", warning(late_share > limits.late_share && model.lateness_matters()), late);
    match (counters.link, model.session.info.backend) {
        (_, None) => {}
        (None, Some(Backend::Simulator)) => part("link ", Role::Quiet, "none: SIM".to_owned()),
        (None, _) => {
            part("link ", bad(counters.state_age_ms > limits.state_age_ms), format!("{} ms", counters.state_age_ms))
        }
        (Some(link), _) => {
            let loss = 100.0 * link.loss_share();
            let lossy = loss >= 100.0 * limits.loss_share;
            let role = bad(link.state_age_ms > limits.state_age_ms || lossy || link.rate_hz == 0);
            part("link ", role, format!("{} ms, {loss:.1} % lost", link.state_age_ms));
        }
    }
    // What a silent robot has sent last is no value of now.
    let silent = model.robot_is_silent();
    let temperatures = snapshot.tick.state.motor_temperature_c;
    let hottest = temperatures.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((joint, hottest)) = hottest.filter(|(_, hottest)| *hottest > 0.0) {
        let joint = if narrow { String::new() } else { format!(" {}", joint_name(joint)) };
        let name = if narrow { "motor " } else { "hottest " };
        match silent {
            true => part(name, Role::Quiet, "-".to_owned()),
            false => part(name, bad(hottest >= limits.motor_c), format!("{hottest:.0} C{joint}")),
        }
    }
    if let Some(battery) = snapshot.tick.state.battery {
        let charge = battery.charge_percent;
        let name = if narrow { "bat " } else { "battery " };
        match silent {
            true => part(name, Role::Quiet, "-".to_owned()),
            false => part(name, bad(charge < limits.battery_percent), format!("{charge:.0} %")),
        }
    }
    if let Some(replay) = &model.replay {
        if replay.lost_ns > 0 {
            part("", Role::Bad, format!("LOST {:.3} s", replay.lost_ns as f64 / 1e9));
        }
        if let Some(trial) = replay.looping {
            part("", Role::Warning, format!("LOOP #{trial}"));
        }
        for (shown, text) in [(replay.slow_motion, "SLOW JUMPS"), (replay.shows_present(), "FOLLOWING")] {
            if shown {
                part("", Role::Warning, text.to_owned());
            }
        }
        if let Some(old_ns) = replay.old_ns() {
            let old_s = old_ns as f64 / 1e9;
            match replay.later_is_known() {
                true => part("", Role::Bad, format!("OLD: {old_s:.0} s behind")),
                false => part("", Role::Bad, format!("OLD: nothing new for {old_s:.0} s")),
            }
        }
    }
    match model.observer() {
        Some(observer) if observer.demanded > observer.stopped => part("", Role::Bad, "STOP NOT CONFIRMED".to_owned()),
        _ => {}
    }
    if let Some(old) = old(model) {
        part("", Role::Bad, old);
    }
    let gap = if narrow { "  " } else { "   " };
    let room = usize::from(width).saturating_sub(spans.iter().map(Span::width).sum());
    let columns = |parts: &[(&str, Role, String)]| -> usize {
        parts.iter().map(|(name, _, value)| gap.len() + name.len() + value.chars().count()).sum()
    };
    // Where there is no room for all, the values in order give way, each whole, and the warnings stay.
    while columns(&parts) > room {
        let in_order = |(_, role, _): &(&str, Role, String)| matches!(role, Role::Text | Role::Quiet);
        let Some(first) = parts.iter().position(in_order) else { break };
        parts.remove(first);
    }
    for (name, role, value) in parts {
        spans.push(span(theme, Role::Quiet, format!("{gap}{name}")));
        spans.push(span(theme, role, value));
    }
    spans
}

/// The mark of the numbers of a live session whose ticks have stopped; none while they arrive.
fn old(model: &Model) -> Option<String> {
    let age_ms = model.clock.saturating_sub(model.snapshot_at).as_millis();
    let stale = age_ms > STALE_MS && model.replay.is_none();
    stale.then(|| format!("OLD: nothing new for {:.1} s", age_ms as f64 / 1e3))
}

fn warning(condition: bool) -> Role {
    if condition { Role::Warning } else { Role::Text }
}

fn bad(condition: bool) -> Role {
    if condition { Role::Bad } else { Role::Text }
}

/// The tabs, and at the right the keys of the help, or that the charts do not show the present.
pub fn render_tabs(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    let spans: Vec<Span> = tabs(&model.keymap)
        .map(|(view, _, text)| span(theme, if view == model.view { Role::Selected } else { Role::Quiet }, text))
        .collect();
    frame.render_widget(Line::from(spans), area);
    let landed = model.landed().filter(|_| model.view == View::Live).map(|landed| landed.trial);
    let narrow = area.width < 100;
    let help = vec![
        span(theme, Role::Key, model.keymap.key(Action::Help)),
        span(theme, Role::Quiet, " help  "),
        span(theme, Role::Key, model.keymap.key(Action::Palette)),
        span(theme, Role::Quiet, " actions "),
    ];
    let mut aside = match (&model.live.frozen, landed) {
        (Some((history, at)), _) => {
            let ago_s = match model.replay {
                // Recorded time.
                Some(_) => model.history.newest_ns().saturating_sub(history.newest_ns()) as f64 / 1e9,
                None => model.clock.saturating_sub(*at).as_secs_f64(),
            };
            let view = if narrow { "" } else { "VIEW " };
            let at_s = without_sign_of_zero(-ago_s);
            vec![
                span(theme, Role::Hardware, format!(" {view}FROZEN {at_s:.1} s ")),
                span(theme, Role::Key, format!(" {}", model.keymap.key(Action::Freeze))),
            ]
        }
        (None, Some(trial)) => vec![
            span(theme, Role::Hardware, format!(" TRIAL #{trial} ")),
            span(theme, Role::Key, format!(" {}", model.keymap.key(Action::Freeze))),
            span(theme, Role::Quiet, " live "),
        ],
        (None, None) => Vec::new(),
    };
    if aside.is_empty() || !narrow {
        aside.push(Span::raw(if aside.is_empty() { "" } else { "  " }));
        aside.extend(help);
    }
    frame.render_widget(Line::from(aside).alignment(Alignment::Right), area);
}

/// Draws the newest answer to the operator; one with more rows than the area ends with the mark of a cut.
pub fn render_message(frame: &mut Frame, area: Rect, model: &Model) {
    let Some(message) = model.shown_message() else { return };
    let role = match message.level {
        LogLevel::Info | LogLevel::Warning if message.is_old(model.clock) => Role::Quiet,
        LogLevel::Info => Role::Text,
        LogLevel::Warning => Role::Warning,
        LogLevel::Error => Role::Bad,
    };
    let mut rows = message_rows(model, area.width);
    let shown = usize::from(area.height);
    if rows.len() > shown && shown > 0 {
        let cut = format!("{}..", rows[shown - 1]);
        rows[shown - 1] = Line::from(truncate(&cut, usize::from(area.width)));
    }
    frame.render_widget(Paragraph::new(rows).style(model.theme.style(role)), area);
}

/// The question of the open dialog, or the next step; none of a step whose key needs a larger terminal.
fn step_of_small(model: &Model) -> Option<String> {
    let waits = matches!(model.mode(), Mode::Offline | Mode::Observe | Mode::Disarmed | Mode::Ready);
    let energises = waits && model.replay.is_none() && model.session.under_review().is_none();
    (model.dialog.is_some() || !energises).then(|| next_step::with_row(model, false).lead)
}

/// The reduced form on a terminal that is too small: mode, STOP, link, what the keys do, needed size.
pub fn render_small(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    let keys = stop_keys(model);
    let link = match (model.snapshot.counters.link, model.session.info.is_hardware()) {
        (Some(link), _) => format!("link {} ms, {:.1} % lost", link.state_age_ms, 100.0 * link.loss_share()),
        (None, true) => format!("link {} ms", model.snapshot.counters.state_age_ms),
        (None, false) => "link none: SIM".to_owned(),
    };
    let wrapped = |line: Line<'static>| wrap(&line, usize::from(area.width), 1);
    let mut lines = vec![
        Line::from(vec![mode_span(model), Span::raw(" "), backend(model)]),
        match model.can_stop() {
            true => Line::from(vec![span(theme, Role::Alarm, " STOP "), Span::raw(" "), span(theme, Role::Key, keys)]),
            false => Line::from(span(theme, Role::Quiet, "no robot to stop")),
        },
    ];
    lines.extend(wrapped(Line::from(link)));
    lines.extend(old(model).map(|old| Line::from(span(theme, Role::Bad, old))));
    if let Some(step) = step_of_small(model) {
        lines.extend(wrapped(Line::from(span(theme, Role::Key, step))));
    }
    lines.extend([
        Line::from(format!("terminal {}x{}", area.width, area.height)),
        Line::from(format!("needed {COMPACT_COLUMNS}x{COMPACT_ROWS}")),
    ]);
    let keys = if model.can_stop() { "STOP works, no key arms or jumps" } else { "enlarge the terminal" };
    lines.extend(wrapped(Line::from(span(theme, Role::Quiet, keys))));
    // What a key was answered, or refused for.
    lines.extend(message_rows(model, area.width).into_iter().map(|row| row.style(theme.style(Role::Warning))));
    frame.render_widget(Paragraph::new(lines), area);
}
