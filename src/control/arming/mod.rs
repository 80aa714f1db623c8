//! The arming checks of the control thread, one file each: measurement and limit, run in the tick, and the sentence for the
//! operator, made by the session. `Cycle` refuses to arm while a check fails. List and reasons: `docs/safety.md`.

mod battery;
mod checksums;
mod gyro_still;
mod joints_inside;
mod loss;
mod lying_down;
mod motors_cool;
mod motors_follow;
mod on_time;
mod state_fresh;
mod upright;

use super::settings::{ArmingLimits, ControlSettings};
use crate::robot::recent_count::RecentCount;
use crate::robot::{JOINTS, LinkStatus, RobotState, joint_name};
use crate::telemetry::{ArmingCheck, ArmingCheckState, ArmingFinding, ArmingFindings, Estimate};

/// One arming check.
struct ControlCheck {
    check: ArmingCheck,
    /// Measures and compares; runs in the tick.
    measure: fn(&ArmingInputs, &ControlSettings) -> Reading,
    /// Words for the operator; allocates, so it runs outside of the tick.
    sentence: fn(&ArmingFinding, &ArmingLimits) -> Sentence,
}

/// The table, in the order of [`ArmingCheck::CONTROL`].
const CHECKS: [ControlCheck; ArmingCheck::CONTROL.len()] = [
    state_fresh::CHECK,
    loss::CHECK,
    checksums::CHECK,
    upright::CHECK,
    joints_inside::CHECK,
    lying_down::CHECK,
    battery::CHECK,
    motors_cool::CHECK,
    motors_follow::CHECK,
    gyro_still::CHECK,
    on_time::CHECK,
];

/// Data of one tick for the arming checks.
#[derive(Debug, Clone, Copy)]
pub struct ArmingInputs<'a> {
    /// Newest state of the robot.
    pub state: &'a RobotState,
    /// Estimate from that state.
    pub estimate: &'a Estimate,
    /// Age of that state, ms.
    pub state_age_ms: u32,
    /// The link; none for a machine without one.
    pub link: Option<LinkStatus>,
    /// Late ticks and stillness up to now.
    pub history: &'a ArmingHistory,
}

/// Late ticks of the last 5 s, and for how long the robot has been still.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ArmingHistory {
    late: RecentCount,
    /// New states in a row with a still gyroscope.
    still: u32,
}

impl ArmingHistory {
    /// Counts late ticks and still states; to be called once per tick.
    ///
    /// 1. Motion, a restart of the robot, or a silence that trips the failsafe resets the count of still states.
    /// 2. A tick without a new state does not change it.
    pub fn observe(
        &mut self,
        lateness_ns: u64,
        state: &RobotState,
        state_age_ms: u32,
        restarted: bool,
        settings: &ControlSettings,
    ) {
        let limits = &settings.pre_arm;
        self.late.advance();
        self.late.add(u32::from(lateness_ns as f64 * 1e-6 > limits.late_ms));
        let still = state.imu.gyro_body.norm() <= limits.gyro_rad_s;
        if restarted || !still || state_age_ms > settings.watchdog.state_age_ms {
            self.still = 0;
        } else if state_age_ms == 0 {
            self.still = self.still.saturating_add(1);
        }
    }
}

/// Measured value and limit of one check, in the check's unit. A value that is not a number fails.
#[derive(Clone, Copy)]
struct Reading {
    passed: bool,
    measured: f64,
    limit: f64,
    joint: Option<u8>,
}

impl Reading {
    fn at_most(measured: f64, limit: f64) -> Reading {
        Reading { passed: measured <= limit, measured, limit, joint: None }
    }

    fn at_least(measured: f64, limit: f64) -> Reading {
        Reading { passed: measured >= limit, measured, limit, joint: None }
    }

    /// The joint with the largest `value`; a value that is not a number counts as the largest.
    fn worst_joint(limit: f64, value: impl Fn(usize) -> f64) -> Reading {
        let reading = |joint: usize| Reading { joint: Some(joint as u8), ..Reading::at_most(value(joint), limit) };
        (1..JOINTS).map(reading).fold(reading(0), |worst, next| {
            if next.measured <= worst.measured || worst.measured.is_nan() { worst } else { next }
        })
    }
}

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
    let mut sentence = row.map_or_else(
        || Sentence { found: String::new(), needed: String::new() },
        |row| (row.sentence)(finding, limits),
    );
    if !finding.measured.is_finite() {
        sentence.found = "not known yet".to_owned();
    }
    sentence
}

/// Name of the joint of `finding`; empty for a finding about the whole robot.
fn joint_of(finding: &ArmingFinding) -> String {
    finding.joint.map(|joint| joint_name(joint as usize).to_string()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_the_order_of_the_findings() {
        assert_eq!(CHECKS.map(|row| row.check), ArmingCheck::CONTROL);
    }
}
