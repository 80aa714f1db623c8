//! All details of one trial: the lines of their dialog, which are drawn, and counted where keys scroll.

use quadfrog::engine::{EstimateChange, RejudgedTrial};
use quadfrog::trial::{
    Displacement, ExpectedResult, JudgedBy, JumpRow, Overrides, TrialRecord, Verdict, four_digits, six_digits,
};

use ratatui::text::{Line, Span};

use crate::draw::{clock, falls_near, span, with_deviation};
use crate::model::Model;
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};
use crate::wrap::wrap;

/// Columns of a name.
const NAME_WIDTH: usize = 15;

/// Returns the details of a trial in lines of `width` columns; none of an unknown trial.
pub fn lines(model: &Model, trial: u32, width: usize) -> Option<Vec<Line<'static>>> {
    let record = model.final_row(trial)?;
    let again = model.rejudged.as_ref().and_then(|table| table.trials.get(&trial));
    let overrides = model.timeline.as_ref().map_or(&model.session.overrides, |timeline| &timeline.overrides);
    let rows = details(model, record, overrides).into_iter().chain(rejudged(again));
    let line = |(name, value): (String, String)| {
        Line::from(vec![span(&model.theme, Role::Quiet, format!("{name:<NAME_WIDTH$}")), Span::raw(value)])
    };
    // Long values continue on the next line.
    Some(rows.flat_map(|row| wrap(&line(row), width, NAME_WIDTH)).collect())
}

fn details(model: &Model, trial: &TrialRecord, overrides: &Overrides) -> Vec<(String, String)> {
    let Model { session, theme, .. } = model;
    let overrides = overrides.of(trial);
    let proposed = |name: &str| {
        let overridden = overrides.iter().find(|p| p.name == name);
        overridden.map_or(String::new(), |p| format!(", overridden; proposed {}", four_digits(p.proposed)))
    };
    let unit = &session.info.unit;
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    let verdict = trial.verdict_name().unwrap_or("not judged");
    let by = match trial.judged_by {
        // The cause says it.
        Some(JudgedBy::Operator) if trial.operators_reason().is_some() => "",
        Some(JudgedBy::Operator) => ", by the operator",
        Some(JudgedBy::Rule) => ", by a rule of the program",
        None => "",
    };
    row("verdict", verdict.to_owned() + by);
    if let Some(suggested) = trial.suggested {
        row("suggested", suggested.name().to_owned());
    }
    match trial.operators_reason() {
        Some((reason, cause)) => {
            if !reason.is_empty() {
                row("reason", reason.to_owned());
            }
            row("cause", cause);
        }
        None if !trial.cause.is_empty() => row("cause", trial.cause.clone()),
        None => {}
    }
    // The table cuts cause and note: both are shown before the first page ends.
    if !trial.note.is_empty() {
        row("note", trial.note.clone());
    }
    let use_of = |value: f64| match trial.verdict {
        Some(_) if session.undoable() == Some(trial.trial) && model.replay.is_none() => {
            format!("{value:.4} {unit}, reported to the optimizer once it cannot be undone")
        }
        Some(_) => format!("{value:.4} {unit}, reported to the optimizer"),
        None => format!("{value:.4} {unit} if it is judged as suggested"),
    };
    row("value", trial.value.map_or("none".to_owned(), use_of));
    if let Some(value) = trial.hand_value {
        row("by hand", format!("{value:.4} {unit}"));
    }
    if let Some(value) = session.measured_objective(trial) {
        row("measured", format!("{value:.4} {unit}"));
    }
    if let Some(model) = session.trials.model_best.filter(|model| model.trial == trial.trial) {
        let mean = with_deviation(theme, model.value, model.deviation, unit);
        row("best", format!("by the sampler's model: mean {mean}; a higher jump of another trial may be luck"));
    }
    row("source", trial.origin());
    row("attempt", session.trials.attempt(trial).to_string());
    if let Some(repeats) = repeats_of(session, theme, trial.trial) {
        row("repeats", repeats);
    }
    if let Some(ran) = session.trials.ran.get(&trial.trial) {
        let took = match ran.ended_ns {
            Some(ended) => format!(", took {:.1} s", ended.saturating_sub(ran.begun_ns) as f64 / 1e9),
            // In a replay the trial at the playhead has its verdict before its end.
            None if trial.verdict.is_some() => String::new(),
            None => ", no end so far".to_owned(),
        };
        let what = if trial.did_not_jump() { "the countdown alone, " } else { "" };
        row("ran", format!("{what}at {} of the session{took}", clock(ran.begun_ns)));
    } else if trial.verdict.is_some() {
        let ran = match (trial.was_not_run(), model.replay.is_some()) {
            (true, _) => "not at all",
            (false, true) => "not in this recording",
            (false, false) => "not in this session",
        };
        row("ran", ran.to_owned());
    }
    for (name, value) in &trial.parameters {
        let index = session.info.parameters.iter().position(|info| info.name == *name);
        let unit = index.map_or("", |index| session.info.parameters[index].unit.as_str());
        let range = trial.ranges.iter().find(|range| range.name == *name);
        let bounds = range.map_or(String::new(), |range| {
            format!("  (searched from {} to {} {unit})", six_digits(range.low), six_digits(range.high))
        });
        row(name, format!("{value:.5} {unit}{}{bounds}", proposed(name)));
    }
    if !trial.gains.is_empty() {
        let unit = |name: &str| session.gain(name).map_or(String::new(), |gain| format!(" {}", gain.unit));
        let gain =
            |(name, value): &(String, f64)| format!("{name} {}{}{}", six_digits(*value), unit(name), proposed(name));
        row("gains", trial.gains.iter().map(gain).collect::<Vec<_>>().join(", "));
    }
    if let Some(m) = &trial.measured {
        row("displacement", format!("{:+.4} m forward, {:+.4} m left", m.dx_m, m.dy_m));
        row("turn", format!("{:+.4} rad", m.dyaw_rad));
        row("rise, air", format!("{:.4} m, {:.3} s", m.apex_m, m.air_s));
        match m.touchdown {
            Some(Displacement { time_s, dx_m, dy_m, dyaw_rad }) => row(
                "touchdown",
                format!("at {time_s:.3} s, {dx_m:+.4} m forward, {dy_m:+.4} m left, turned {dyaw_rad:+.4} rad"),
            ),
            None if m.ended_in_the_air() => row("touchdown", "none: the trial ended in the air".to_owned()),
            // Of a trial that was stopped within the impulse an earlier version has counted no flight.
            None if m.air_s > 0.0 && trial.suggested != Some(Verdict::Void) => {
                row("touchdown", "none after the impulse: the feet were down before its end".to_owned());
            }
            None => {}
        }
        if m.flights > 1 {
            row("bounced", format!("{} flights after the impulse", m.flights));
        }
        for (index, jump) in m.jumps.iter().enumerate().filter(|_| m.jumps.len() > 1) {
            row(&format!("jump {}", index + 1), jump_line(jump, session.info.task.map_or("", |task| task.unit())));
        }
    }
    for (index, repeat) in trial.repeats.iter().enumerate() {
        let verdict = repeat.verdict.map_or("not judged", |verdict| verdict.name());
        let value = repeat.value.map_or(String::new(), |value| format!(" {value:.4} {unit}"));
        row(&format!("repeat {}", index + 1), format!("{verdict}{value}, seed {}: {}", repeat.seed, repeat.cause));
    }
    if let Some(risk) = trial.risk.filter(|risk| risk.neighbours > 0) {
        let nearest = match (risk.nearest_fall_trial, risk.nearest_fall) {
            (Some(trial), Some(distance)) => {
                format!("; nearest fall #{trial}, {:.1} % of a range away", 100.0 * distance)
            }
            _ => String::new(),
        };
        row("risk before", falls_near(&risk) + &nearest);
    }
    if let Some(expected) = &trial.expected {
        let ExpectedResult { value, deviation, p_stand, .. } = expected;
        let simulated = match (expected.simulated_least, expected.simulated_most) {
            (Some(least), Some(most)) => format!("; simulated robots {least:.4} to {most:.4} {unit}"),
            _ => String::new(),
        };
        let text = format!("{value:.4} {unit}, deviation {deviation:.4} {unit}, stands with {:.1} %", 100.0 * p_stand);
        row("expected", text + &simulated);
    }
    rows
}

/// The repeats of a trial's point in words; none where it ran once.
fn repeats_of(session: &SessionModel, theme: &Theme, trial: u32) -> Option<String> {
    let point = session.trials.points.iter().find(|point| point.trials.contains(&trial) && point.trials.len() > 1)?;
    let spread = point.deviation.map_or(String::new(), |sd| format!(" {} {:.4}", theme.plus_minus(), sd));
    let trials: Vec<String> = point.trials.iter().map(|trial| format!("#{trial}")).collect();
    let (stood, of, unit) = (point.without_fall, point.trials.len(), &session.info.unit);
    Some(format!("{stood}/{of} landed, {:.4}{spread} {unit} ({})", point.mean, trials.join(" ")))
}

/// The new judgement of a trial, and the change of its estimate.
fn rejudged(again: Option<&RejudgedTrial>) -> Vec<(String, String)> {
    let Some(RejudgedTrial { old, new, estimate, .. }) = again else { return Vec::new() };
    let number = |value: Option<f64>| value.map_or("none".to_owned(), |value| format!("{value:.4}"));
    let verdict = new.verdict.map_or("no verdict", |verdict| verdict.name());
    let (before, now) = (number(old.value), number(new.value));
    let mut rows = vec![("judged again".to_owned(), format!("{verdict}: {}; measured {before}, now {now}", new.cause))];
    if let Some(EstimateChange { distance_m, old_error_m, new_error_m }) = estimate {
        let (old, new) = (number(*old_error_m), number(*new_error_m));
        let text = format!("at most {distance_m:.4} m from the recorded one; error at the end {old} m, now {new} m");
        rows.push(("estimate".to_owned(), text));
    }
    rows
}

/// Start, place, attitude, rise, time in the air and value of one jump.
fn jump_line(jump: &JumpRow, unit: &str) -> String {
    let JumpRow { time_s, x_m, y_m, yaw_rad, tilt_rad, rise_m, air_s, value } = jump;
    format!(
        "{time_s:.2} s, x {x_m:+.3} m, y {y_m:+.3} m, yaw {yaw_rad:+.2}, tilt {tilt_rad:.2} rad, rise {rise_m:.3} m, air {air_s:.3} s, {value:+.3} {unit}"
    )
}
