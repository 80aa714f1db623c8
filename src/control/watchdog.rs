//! What must never pass: each check names the quantity, the measured and the allowed value.

use super::limits;
use super::settings::Settings;
use crate::realtime::telemetry::{Estimate, Fault, Mode};
use crate::robot::RobotState;

/// What is known about the tick besides the robot's state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circumstances {
    /// Mode at the start of the tick.
    pub mode: Mode,
    /// Age of the robot's newest state, ms; zero while it answers.
    pub state_age_ms: u32,
    /// The robot's clock in the state before, ms.
    pub previous_robot_time_ms: u32,
    /// How late the tick started, ns.
    pub lateness_ns: u64,
}

/// The first limit that is broken; none if all is well.
pub fn check(state: &RobotState, estimate: &Estimate, around: &Circumstances, settings: &Settings) -> Option<Fault> {
    let limits = &settings.watchdog;
    if around.state_age_ms > limits.state_age_ms {
        return Some(Fault::StateAge { age_ms: around.state_age_ms, allowed_ms: limits.state_age_ms });
    }
    if let Err(fault) = limits::finite(state) {
        return Some(fault);
    }
    if state.robot_time_ms < around.previous_robot_time_ms {
        return Some(Fault::Reboot);
    }
    let late_ms = around.lateness_ns as f64 * 1e-6;
    if settings.late_ms > 0.0 && late_ms > settings.late_ms {
        return Some(Fault::Late { measured_ms: late_ms, allowed_ms: settings.late_ms });
    }
    if matches!(around.mode, Mode::StandUp | Mode::Ready | Mode::Countdown) {
        let [roll, pitch, _] = estimate.roll_pitch_yaw.into();
        let tilt = roll.abs().max(pitch.abs());
        if tilt > limits.stance_tilt_rad {
            return Some(Fault::Tilt { measured_rad: tilt, allowed_rad: limits.stance_tilt_rad });
        }
    }
    None
}
