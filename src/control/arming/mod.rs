//! The arming checks of the control thread, one file each: measurement and limit, run in the tick, and the sentence for the
//! operator, made by the session. `Cycle` refuses to arm while a check fails. List and reasons: `docs/safety.md`.

mod battery;
mod check;
mod checksums;
mod foot_sensors;
mod gravity;
mod gyro_still;
mod inertial_live;
mod joint_velocity;
mod joints_inside;
mod link_delay;
mod loss;
mod lying_down;
mod motors_cool;
mod motors_follow;
mod on_time;
mod orientation;
mod remote;
mod robot_clock;
mod state_fresh;
mod upright;

pub use check::{ArmingHistory, ArmingInputs};

use super::settings::{ArmingLimits, ControlSettings};
use crate::telemetry::{ArmingCheck, ArmingCheckState, ArmingFinding, ArmingFindings};
use check::{ControlCheck, Reading};

/// The table, in the order of [`ArmingCheck::CONTROL`].
const CHECKS: [ControlCheck; ArmingCheck::CONTROL.len()] = [
    state_fresh::CHECK,
    loss::CHECK,
    link_delay::CHECK,
    checksums::CHECK,
    upright::CHECK,
    joints_inside::CHECK,
    lying_down::CHECK,
    battery::CHECK,
    motors_cool::CHECK,
    motors_follow::CHECK,
    gyro_still::CHECK,
    on_time::CHECK,
    inertial_live::CHECK,
    gravity::CHECK,
    orientation::CHECK,
    foot_sensors::CHECK,
    robot_clock::CHECK,
    joint_velocity::CHECK,
    remote::CHECK,
];

/// A finding in words with units.
pub struct Sentence {
    /// Measured value.
    pub found: String,
    /// Limit.
    pub needed: String,
}

/// Runs all checks of the table.
pub fn findings(inputs: &ArmingInputs, settings: &ControlSettings) -> ArmingFindings {
    ArmingFindings(CHECKS.map(|ControlCheck { check, measure, .. }| {
        let Reading { passed, measured, limit, joint } = measure(inputs, settings);
        let state = match passed {
            _ if !settings.hardware && !check.needed_in_simulation() => ArmingCheckState::NotNeeded,
            true => ArmingCheckState::Passed,
            false => ArmingCheckState::Failed,
        };
        ArmingFinding { check, state, measured, allowed: limit, joint }
    }))
}

/// Describes `finding` for the operator. Allocates: not for the tick.
pub fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    let row = CHECKS.iter().find(|row| row.check == finding.check);
    let known = row.filter(|_| finding.measured.is_finite());
    Sentence {
        found: known.map_or_else(|| "not known yet".to_owned(), |row| (row.found)(finding)),
        needed: row.map(|row| (row.needed)(limits)).unwrap_or_default(),
    }
}
