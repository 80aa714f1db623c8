//! Measurement and objective of a jump: pure functions of the trial's recorded ticks, so that a replay computes the same.

use nalgebra::{Rotation3, Vector3};

use crate::robot::CONTROL_PERIOD_S;
use crate::telemetry::{Fault, Tick, TrialEnd};
use crate::trial::{MeasuredJump, Task, TrialRecord, Verdict};

/// Beginning of the cause of a trial that tripped a limit.
const LIMIT: &str = "limit: ";

/// Measures a trial from its ticks; none if they end before the impulse.
///
/// x, y and yaw are read when the oscillator enters pi (t = 0) and at the last tick; displacements are in the world
/// frame turned so that the trial starts at yaw 0 (`docs/method.md`, "Timing of a trial").
pub fn measure(ticks: &[Tick]) -> Option<MeasuredJump> {
    let first = ticks.iter().position(|tick| tick.trial_time_s >= 0.0 && tick.trial.is_some())?;
    let (start, end) = (&ticks[first].estimate, &ticks.last()?.estimate);
    let yaw_init = start.roll_pitch_yaw.z;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw_init);
    let displacement = turn * (end.position_world - start.position_world);
    let apex_m =
        ticks[first..].iter().map(|tick| tick.estimate.position_world.z - start.position_world.z).fold(0.0, f64::max);
    let mut longest = 0;
    let mut left = None;
    for tick in &ticks[first..] {
        if tick.estimate.contact.iter().any(|&down| down) {
            left = None;
        } else {
            let since = *left.get_or_insert(tick.number);
            longest = longest.max(tick.number - since + 1);
        }
    }
    Some(MeasuredJump {
        dx_m: displacement.x,
        dy_m: displacement.y,
        dyaw_rad: end.roll_pitch_yaw.z - yaw_init,
        apex_m,
        air_s: longest as f64 * CONTROL_PERIOD_S,
    })
}

/// Returns the objective J, maximised: m for forward and lateral, rad for twist (paper, section II-D); mean per jump.
pub fn value(task: Task, measured: &MeasuredJump, jumps: u32) -> f64 {
    let whole = match task {
        Task::Forward => measured.dx_m,
        Task::LateralLeft => measured.dy_m,
        Task::LateralRight => -measured.dy_m,
        Task::TwistCcw => measured.dyaw_rad,
        Task::TwistCw => -measured.dyaw_rad,
    };
    whole / f64::from(jumps.max(1))
}

/// Returns the verdict that the rules suggest, and its reason. A limit that the motion trips is the outcome of the parameters,
/// as a fall is; void is a trial whose end they did not cause: link, console, operator, temperature of a motor.
pub fn suggest(end: &TrialEnd) -> (Verdict, String) {
    match end {
        TrialEnd::Settled => (Verdict::Accept, "landed and settled".into()),
        TrialEnd::NotQuiet => (Verdict::Fall, "did not come to rest".into()),
        TrialEnd::Fell(cause) => (Verdict::Fall, cause.to_string()),
        TrialEnd::Stopped => (Verdict::Void, "stopped by the operator".into()),
        TrialEnd::Cancelled => (Verdict::Void, "cancelled by the operator".into()),
        TrialEnd::NotReady(inhibit) => (Verdict::Void, format!("not begun: {inhibit}")),
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
    row.suggested == Some(Verdict::Fall) && row.cause.starts_with(LIMIT)
}
