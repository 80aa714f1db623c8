//! One point of a task over several seeds: falls with cause and time, value, attitude. Simulated time, no study.

use super::objective;
use super::rollout::Rollout;
use crate::robot::Robot;
use crate::telemetry::{CommandRefusal, TrialEnd, TrialSpec};
use crate::trial::MeasuredJump;

/// Result of one run of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluatedRun {
    /// Seed of sensor noise and terrain.
    pub seed: u64,
    /// End of the run.
    pub end: TrialEnd,
    /// Reason of the verdict on the end.
    pub cause: String,
    /// Time of the fall, or at which a limit tripped, since the first impulse began, s; none without either.
    pub fall_time_s: Option<f64>,
    /// Impulses that ended before the run did.
    pub jumps: u32,
    /// Displacement, turn, rise and time in the air of the whole run; none if it ended before the first impulse.
    pub measured: Option<MeasuredJump>,
    /// Objective, in the task's unit; 0 unless the robot stands at the end.
    pub value: f64,
    /// Mean angle between the trunk's and the world's z axis at the starts of the impulses, rad; none without an impulse.
    pub tilt_at_impulse_rad: Option<f64>,
    /// Difference of the largest and the smallest roll from the first impulse on, rad.
    pub roll_range_rad: f64,
    /// The same of pitch, rad.
    pub pitch_range_rad: f64,
}

impl EvaluatedRun {
    /// Whether the robot stands still at the end.
    pub fn stood(&self) -> bool {
        self.end == TrialEnd::Settled
    }

    /// Whether the trial began. One that did not is worth 0, as a fall is.
    pub fn begun(&self) -> bool {
        !matches!(self.end, TrialEnd::Refused(_) | TrialEnd::NotReady(_))
    }

    /// Whether the trial began, and the robot does not stand still at the end.
    pub fn fell(&self) -> bool {
        self.begun() && !self.stood()
    }

    /// Whether the robot bounced on, and the rule of the task judges that.
    pub fn bounced(&self) -> bool {
        self.stood() && self.cause != objective::suggest(&self.end).1
    }
}

/// Runs one trial and evaluates its ticks.
pub fn evaluate<R: Robot>(rollout: &mut Rollout<R>, spec: &TrialSpec) -> EvaluatedRun {
    let (end, ticks) = rollout.run(spec);
    let begun = ticks.iter().position(|tick| tick.trial_time_s >= 0.0).unwrap_or(ticks.len());
    let ticks = &ticks[begun..];
    let rule = spec.objective();
    let measured = objective::measure(&rule, ticks);
    let range = |axis: usize| {
        let angles = ticks.iter().map(|tick| tick.estimate.roll_pitch_yaw[axis]);
        angles.clone().fold(f64::NEG_INFINITY, f64::max) - angles.fold(f64::INFINITY, f64::min)
    };
    let starts: Vec<f64> =
        objective::impulse_edges(ticks, true).map(|index| objective::tilt_rad(&ticks[index])).collect();
    let value = measured.as_ref().and_then(|measured| measured.measured_value);
    let (_, mut cause) = objective::suggest_measured(&end, measured.as_ref(), spec.bounce);
    let jumps = objective::impulse_edges(ticks, false).count() as u32;
    let fall_time_s = (matches!(end, TrialEnd::Fell(_)) || objective::trips_limit(&end))
        .then(|| ticks.last().map_or(0.0, |tick| tick.trial_time_s));
    let [roll_range_rad, pitch_range_rad] = if ticks.is_empty() { [0.0; 2] } else { [range(0), range(1)] };
    // A failsafe that trips in the first tick changes the mode before the trial is requested.
    if end == TrialEnd::Refused(CommandRefusal::Mode)
        && let Some(tripped) = rollout.last_transition_cause()
    {
        cause = format!("not begun: {tripped}");
    }
    EvaluatedRun {
        seed: spec.seed,
        fall_time_s,
        jumps,
        value: value.filter(|_| end == TrialEnd::Settled).unwrap_or(0.0),
        cause,
        measured,
        tilt_at_impulse_rad: (!starts.is_empty()).then(|| starts.iter().sum::<f64>() / starts.len() as f64),
        roll_range_rad,
        pitch_range_rad,
        end,
    }
}
