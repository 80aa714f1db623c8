//! One arming check: its inputs, its measurement and its words.

use crate::control::consistency::Consistency;
use crate::control::settings::{ArmingLimits, ControlSettings};
use crate::robot::recent_count::RecentCount;
use crate::robot::{JOINTS, LinkStatus, RobotState, joint_name};
pub(super) use crate::telemetry::ArmingCheck;
use crate::telemetry::{ArmingFinding, Estimate};

/// One arming check.
pub(super) struct ControlCheck {
    pub check: ArmingCheck,
    /// Measures and compares; runs in the tick.
    pub measure: fn(&ArmingInputs, &ControlSettings) -> Reading,
    /// Measured value in words; as `needed` it allocates, so it runs outside of the tick.
    pub found: fn(&ArmingFinding) -> String,
    /// Limit in words.
    pub needed: fn(&ArmingLimits) -> String,
}

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
    /// Growth of the link's delay, ms.
    pub delay_growth_ms: f64,
    /// Late ticks and stillness up to now.
    pub history: &'a ArmingHistory,
    /// Consistency of sensors, clocks and commands.
    pub consistency: &'a Consistency,
}

/// Late ticks of the last 5 s, and for how long the robot has been still.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ArmingHistory {
    pub(super) late: RecentCount,
    /// New states in a row with a still gyroscope.
    pub(super) still: u32,
}

impl ArmingHistory {
    /// Counts late ticks and still states; to be called once per tick.
    ///
    /// 1. Motion, a restart of the robot, or a silence that trips the failsafe resets the count of still states.
    /// 2. A tick without a new state does not change it.
    pub fn update(
        &mut self,
        lateness_ns: u64,
        state: &RobotState,
        state_age_ms: u32,
        restarted: bool,
        settings: &ControlSettings,
    ) {
        let limits = &settings.arming;
        self.late.advance();
        self.late.add(u32::from(lateness_ns as f64 * 1e-6 > limits.late_ms));
        let still = state.imu.gyro_body.norm() <= limits.gyro_rad_s;
        if restarted || !still || state_age_ms > settings.failsafe.state_age_ms {
            self.still = 0;
        } else if state_age_ms == 0 {
            self.still = self.still.saturating_add(1);
        }
    }

    /// Share of late ticks in the last second, 0 to 1.
    pub fn late_share_of_a_second(&self) -> f64 {
        let (late, span_ms) = self.late.last_second();
        f64::from(late) / f64::from(span_ms.max(1))
    }
}

/// Measured value and limit of one check, in the check's unit. A value that is not a number fails.
#[derive(Clone, Copy)]
pub(super) struct Reading {
    pub passed: bool,
    pub measured: f64,
    pub limit: f64,
    pub joint: Option<u8>,
}

impl Reading {
    pub fn at_most(measured: f64, limit: f64) -> Reading {
        Reading { passed: measured <= limit, measured, limit, joint: None }
    }

    pub fn at_least(measured: f64, limit: f64) -> Reading {
        Reading { passed: measured >= limit, measured, limit, joint: None }
    }

    /// The joint with the largest `value`; a value that is not a number counts as the largest.
    pub fn worst_joint(limit: f64, value: impl Fn(usize) -> f64) -> Reading {
        let reading = |joint: usize| Reading { joint: Some(joint as u8), ..Reading::at_most(value(joint), limit) };
        (1..JOINTS).map(reading).fold(reading(0), |worst, next| {
            if next.measured <= worst.measured || worst.measured.is_nan() { worst } else { next }
        })
    }
}

/// Name of the joint of `finding`; empty for a finding about the whole robot.
pub(super) fn joint_of(finding: &ArmingFinding) -> String {
    finding.joint.map(|joint| joint_name(joint as usize).to_string()).unwrap_or_default()
}
