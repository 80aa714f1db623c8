//! Data of one tick for the failsafe table.

use super::consistency::Consistency;
use super::settings::ControlSettings;
use crate::robot::{CONTROL_PERIOD_S, LinkStatus, RobotState};
use crate::telemetry::{Estimate, Fault, Mode};

/// Data of one tick for the failsafes.
#[derive(Debug, Clone, Copy)]
pub struct FailsafeInputs<'a> {
    /// Mode in which the failsafes run.
    pub mode: Mode,
    /// Phase of the motion.
    pub phase: MotionPhase,
    /// Newest state of the robot.
    pub state: &'a RobotState,
    /// Estimate from that state.
    pub estimate: &'a Estimate,
    /// Age of that state, ms; zero while states arrive.
    pub state_age_ms: u32,
    /// The robot's clock went backwards since the last tick.
    pub restarted: bool,
    /// The link; none for a machine without one.
    pub link: Option<LinkStatus>,
    /// Growth of the link's delay, ms.
    pub delay_growth_ms: f64,
    /// Share of the states of the last second that were lost.
    pub loss_share: f64,
    /// Delay of the start of the tick, ns.
    pub lateness_ns: u64,
    /// Periods of the last ticks.
    pub period: PeriodWatch,
    /// `errno` of a failed send.
    pub send_error: Option<i32>,
    /// Time since the last heartbeat of the operator's console, ms.
    pub operator_silent_ms: u32,
    /// The session takes no events.
    pub events_lost: bool,
    /// Consistency of sensors, clocks and commands.
    pub consistency: &'a Consistency,
    /// The fault of an accelerometer with too many impossible values.
    pub accelerometer_fault: Option<Fault>,
    /// Time for which the computer was suspended since the last tick, ms.
    pub suspended_ms: u32,
    /// Time for which the guard has not answered, ms; `u32::MAX` when it is gone, zero without a guard.
    pub guard_silent_ms: u32,
    /// Time for which the remote control has not answered, ms; zero where none is needed.
    pub remote_silent_ms: u32,
}

/// Phase of the motion, on which the action of a failsafe depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MotionPhase {
    /// Standing, lying, or in an impulse before the trunk rises fast.
    #[default]
    Ground,
    /// In flight, or in an impulse that will end in flight whatever the motors do.
    Air,
    /// From the touchdown to the end of the trial.
    Landing,
}

/// Periods of the last ticks, for the row `slow`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PeriodWatch {
    /// Start of the last tick, ns.
    began_ns: Option<u64>,
    /// Time between the last two starts, ms.
    pub(super) period_ms: f64,
    /// Ticks in a row with too long a period.
    pub(super) slow: u32,
}

impl PeriodWatch {
    /// Measures the period; to be called once per tick, before the table is checked.
    pub fn begin(&mut self, time_ns: u64, lateness_ns: u64, settings: &ControlSettings) {
        let began_ns = time_ns + lateness_ns;
        self.period_ms = self.began_ns.map_or(0.0, |before| began_ns.saturating_sub(before) as f64 * 1e-6);
        self.began_ns = Some(began_ns);
        let slow = self.period_ms > settings.failsafe.period_factor * CONTROL_PERIOD_S * 1e3;
        self.slow = if slow { self.slow + 1 } else { 0 };
    }
}
