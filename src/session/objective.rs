//! Measurement and objective of a jump: pure functions of the trial's recorded ticks, so that a replay computes the same.

use nalgebra::Vector3;

use crate::control::foot_placement::SHORTEST_FLIGHT_S;
use crate::robot::rotation::about_z;
use crate::robot::{CONTROL_PERIOD_S, ticks_in};
use crate::telemetry::{Fault, Phase, Tick, TrialEnd};
use crate::trial::{BounceRule, Displacement, JumpRow, MeasuredJump, ObjectiveRule, Task, TrialRecord, Verdict};

/// Beginning of the cause of a trial that tripped a limit.
const LIMIT: &str = "limit: ";
/// Beginning of the cause of a trial that bounced on under a rule for that.
const BOUNCED: &str = "bounced: ";

/// Shortest further flight that counts as a bounce, s: a free flight of this time rises by g t^2 / 8 = 3 mm. In 270 random jumps
/// that settled, ideal and hardware-like, all feet were off the ground for at most 4 ms after the touchdown.
pub const SHORTEST_BOUNCE_S: f64 = 0.05;

/// Measures a trial from its ticks; none if they end before the impulse.
///
/// x, y and yaw are read when the oscillator enters pi (t = 0), at the start of every further impulse, at the first touchdown
/// after the last impulse and at the last tick; displacements are in the world frame turned so that the trial starts at yaw 0
/// (`docs/method.md`, "Timing of a trial").
pub fn measure(rule: &ObjectiveRule, ticks: &[Tick]) -> Option<MeasuredJump> {
    let first = ticks.iter().position(|tick| tick.trial_time_s >= 0.0 && tick.trial.is_some())?;
    let ticks = &ticks[first..];
    let start = &ticks[0].estimate;
    let yaw_init = start.roll_pitch_yaw.z;
    let turn = about_z(-yaw_init);
    let displacement = |tick: &Tick| {
        let moved = turn * (tick.estimate.position_world - start.position_world);
        let dyaw_rad = tick.estimate.roll_pitch_yaw.z - yaw_init;
        Displacement { time_s: tick.trial_time_s, dx_m: moved.x, dy_m: moved.y, dyaw_rad }
    };
    let Displacement { dx_m, dy_m, dyaw_rad, .. } = displacement(ticks.last()?);
    let airborne = airborne(ticks);
    let landing = Landing::of(ticks, &airborne);
    let mut measured = MeasuredJump {
        dx_m,
        dy_m,
        dyaw_rad,
        apex_m: rise_m(ticks),
        air_s: longest_s(airborne.iter()),
        end_s: ticks.last()?.trial_time_s,
        measured_value: None,
        flights: landing.flights,
        touchdown: landing.touchdown.map(|index| displacement(&ticks[index])),
        first_landing: landing.bounced_at.map(|index| displacement(&ticks[index - 1])),
        jumps: jumps(rule.task, ticks, &airborne, displacement),
    };
    measured.measured_value = Some(value(rule, &measured));
    Some(measured)
}

/// Returns the objective J, maximised: m for forward and lateral, rad for twist (paper, section II-D). It is the mean per jump,
/// or with `rate` the mean per second from the start of the first impulse to the first touchdown after the last one (to the end
/// of a trial without a flight). Of a robot that bounced on it is of the displacement that the rule names.
pub fn value(rule: &ObjectiveRule, measured: &MeasuredJump) -> f64 {
    let MeasuredJump { dx_m, dy_m, dyaw_rad, .. } = *measured;
    let rest = Displacement { time_s: 0.0, dx_m, dy_m, dyaw_rad };
    let whole = match (bounced(measured), rule.bounce) {
        (true, BounceRule::Zero) => 0.0,
        (true, BounceRule::FirstLanding) => along(rule.task, &measured.first_landing.unwrap_or(rest)),
        _ => along(rule.task, &rest),
    };
    if rule.rate {
        let time_s = measured.touchdown.map_or(measured.end_s, |touchdown| touchdown.time_s);
        return if time_s > 0.0 { whole / time_s } else { 0.0 };
    }
    let jumps = if measured.jumps.is_empty() { rule.jumps } else { measured.jumps.len() as u32 };
    whole / f64::from(jumps.max(1))
}

/// Returns verdict, value and cause of a trial of several rollouts, from verdict and value of those that are not void: the mean
/// with 0 for a fall, and a fall if all fell.
pub fn judge_repeats(counted: &[(Verdict, Option<f64>)]) -> (Verdict, Option<f64>, String) {
    let falls = counted.iter().filter(|(verdict, _)| *verdict == Verdict::Fall).count();
    let of_one = |(verdict, value): &(Verdict, Option<f64>)| if *verdict == Verdict::Fall { Some(0.0) } else { *value };
    let verdict = if falls == counted.len() { Verdict::Fall } else { Verdict::Accept };
    (verdict, mean(counted.iter().filter_map(of_one)), format!("mean of {} repeats, {falls} fell", counted.len()))
}

/// Returns the mean; none without values.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Whether the robot flew again after its first landing.
fn bounced(measured: &MeasuredJump) -> bool {
    measured.flights > 1
}

/// Returns the displacement or turn in the direction of the task, m or rad.
pub fn along(task: Task, displacement: &Displacement) -> f64 {
    match task {
        Task::Forward => displacement.dx_m,
        Task::LateralLeft => displacement.dy_m,
        Task::LateralRight => -displacement.dy_m,
        Task::TwistCcw => displacement.dyaw_rad,
        Task::TwistCw => -displacement.dyaw_rad,
    }
}

/// Indices of ticks in a row without any foot on the ground: the first, and the first after them.
type AirborneTicks = std::ops::Range<usize>;

fn airborne(ticks: &[Tick]) -> Vec<AirborneTicks> {
    let mut ranges: Vec<AirborneTicks> = Vec::new();
    for (index, tick) in ticks.iter().enumerate() {
        if tick.estimate.contact.iter().any(|&down| down) {
            continue;
        }
        match ranges.last_mut() {
            Some(range) if range.end == index => range.end = index + 1,
            _ => ranges.push(index..index + 1),
        }
    }
    ranges
}

fn longest_s<'a>(airborne: impl Iterator<Item = &'a AirborneTicks>) -> f64 {
    airborne.map(ExactSizeIterator::len).max().unwrap_or(0) as f64 * CONTROL_PERIOD_S
}

/// Returns the largest height of the trunk above its height in the first tick, m.
fn rise_m(ticks: &[Tick]) -> f64 {
    let height_m = |tick: &Tick| tick.estimate.position_world.z;
    ticks.iter().map(|tick| height_m(tick) - height_m(&ticks[0])).fold(0.0, f64::max)
}

/// The landing after the last impulse.
#[derive(Debug, Default)]
struct Landing {
    /// Flights after the impulse: the jump's, and bounces.
    flights: u32,
    /// Index of the first tick on the ground after the first flight.
    touchdown: Option<usize>,
    /// Index of the first tick of the second flight.
    bounced_at: Option<usize>,
}

impl Landing {
    fn of(ticks: &[Tick], airborne: &[AirborneTicks]) -> Landing {
        let impulse_end = ticks.iter().rposition(|tick| tick.phase == Phase::Impulse).map_or(0, |last| last + 1);
        let mut landing = Landing::default();
        // A trial that was stopped within the impulse may end in the air.
        let counts = |flight: &&AirborneTicks| flight.end > impulse_end || flight.end == ticks.len();
        for flight in airborne.iter().filter(counts) {
            let shortest_s = if landing.flights == 0 { SHORTEST_FLIGHT_S } else { SHORTEST_BOUNCE_S };
            if (flight.len() as u32) < ticks_in(shortest_s) {
                continue;
            }
            match landing.flights {
                0 => landing.touchdown = Some(flight.end).filter(|end| *end < ticks.len()),
                1 => landing.bounced_at = Some(flight.start),
                _ => {}
            }
            landing.flights += 1;
        }
        landing
    }
}

/// Returns the first ticks of the impulses, or with `rising` false the first ticks after them, by index.
pub(super) fn impulse_edges(ticks: &[Tick], rising: bool) -> impl Iterator<Item = usize> {
    let impulse = move |index: usize| ticks[index].phase == Phase::Impulse;
    let edge = move |index: &usize| {
        let before = *index > 0 && impulse(index - 1);
        impulse(*index) == rising && before != rising
    };
    (0..ticks.len()).filter(edge)
}

fn jumps(
    task: Task,
    ticks: &[Tick],
    airborne: &[AirborneTicks],
    displacement: impl Fn(&Tick) -> Displacement,
) -> Vec<JumpRow> {
    let starts: Vec<usize> = impulse_edges(ticks, true).collect();
    let row = |(number, &start): (usize, &usize)| {
        let next = starts.get(number + 1).copied();
        let window = start..next.unwrap_or(ticks.len());
        let (from, to) = (displacement(&ticks[start]), displacement(&ticks[next.unwrap_or(ticks.len() - 1)]));
        JumpRow {
            time_s: from.time_s,
            x_m: from.dx_m,
            y_m: from.dy_m,
            yaw_rad: from.dyaw_rad,
            tilt_rad: tilt_rad(&ticks[start]),
            rise_m: rise_m(&ticks[window.clone()]),
            air_s: longest_s(airborne.iter().filter(|flight| window.contains(&flight.start))),
            value: along(task, &to) - along(task, &from),
        }
    };
    starts.iter().enumerate().map(row).collect()
}

/// Angle between the trunk's and the world's z axis, rad.
pub fn tilt_rad(tick: &Tick) -> f64 {
    let up_world = tick.estimate.world_from_body * Vector3::z();
    libm::acos(up_world.z.clamp(-1.0, 1.0))
}

/// Returns the suggested verdict with its reason. A robot that bounced on has a cause of its own under a rule other than
/// [`BounceRule::Ignore`].
pub fn suggest_measured(end: &TrialEnd, measured: Option<&MeasuredJump>, bounce: BounceRule) -> (Verdict, String) {
    let flights =
        measured.filter(|measured| *end == TrialEnd::Settled && bounced(measured)).map(|measured| measured.flights);
    match (flights, bounce) {
        (Some(flights), BounceRule::FirstLanding) => (
            Verdict::Accept,
            format!("{BOUNCED}{flights} flights after the impulse; J at the end of the first landing"),
        ),
        (Some(flights), BounceRule::Zero) => (Verdict::Fall, format!("{BOUNCED}{flights} flights after the impulse")),
        _ => suggest(end),
    }
}

/// Returns the verdict that the rules suggest, and its reason. A limit that the motion trips is the outcome of the parameters,
/// as a fall is; void is a trial whose end they did not cause: link, console, operator, temperature of a motor.
pub fn suggest(end: &TrialEnd) -> (Verdict, String) {
    match end {
        TrialEnd::Settled => (Verdict::Accept, "landed and settled".into()),
        TrialEnd::NotQuiet => (Verdict::Fall, "did not come to rest".into()),
        TrialEnd::Fell(cause) => (Verdict::Fall, cause.to_string()),
        TrialEnd::Stopped => (Verdict::Void, "STOP was pressed".into()),
        TrialEnd::Cancelled => (Verdict::Void, "countdown cancelled, the robot did not jump".into()),
        TrialEnd::Refused(because) => (Verdict::Void, format!("not begun: {}", because.without_remedy())),
        TrialEnd::NotReady(inhibit) => (Verdict::Void, format!("not begun: {inhibit}")),
        TrialEnd::Held(inhibit) => (Verdict::Void, format!("no further jump: {inhibit}")),
        TrialEnd::SatDown => (Verdict::Void, "no further jump: sat down by the operator".into()),
        TrialEnd::Fault(fault) if trips_limit(end) => (Verdict::Fall, format!("{LIMIT}{fault}")),
        TrialEnd::Fault(fault) => (Verdict::Void, fault.to_string()),
    }
}

/// Whether a limit of the motion ended the trial: position, velocity or torque of a joint, or tilt.
pub fn trips_limit(end: &TrialEnd) -> bool {
    let TrialEnd::Fault(fault) = end else { return false };
    matches!(
        fault,
        Fault::JointPosition { .. } | Fault::JointVelocity { .. } | Fault::JointTorque { .. } | Fault::Tilt { .. }
    )
}

/// Whether the trial under review tripped a limit of the motion; to judge it void the operator gives a reason.
pub fn tripped_limit(row: &TrialRecord) -> bool {
    row.suggested == Some(Verdict::Fall) && row.cause_by_rule().starts_with(LIMIT)
}

/// Whether a trial ended at rest, with or without a bounce.
pub fn ended_at_rest(row: &TrialRecord) -> bool {
    let cause = row.cause_by_rule();
    cause == suggest(&TrialEnd::Settled).1 || cause.starts_with(BOUNCED)
}

/// Whether the detection of a fall ended a trial.
pub fn ended_by_fall(row: &TrialRecord) -> bool {
    let other = ended_at_rest(row) || tripped_limit(row) || row.cause_by_rule() == suggest(&TrialEnd::NotQuiet).1;
    row.suggested == Some(Verdict::Fall) && !other
}
