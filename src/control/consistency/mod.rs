//! Consistency of the robot's sensors with each other, with its weight and with this computer's clock, and of its
//! motors with the commands. One file per group of checks: state over time, updated once per tick, and the measures
//! of that state. The failsafe table and the arming checks compare them with their limits. List and reasons:
//! `docs/safety.md`.
//!
//! On hardware alone: the simulator's sensors have no faults, and its states may stand still.

mod clock;
mod commander;
mod feet;
mod inertial;
mod inputs;
mod joints;
mod leaky;

pub(super) use commander::FOREIGN_COMMANDS;
pub use inputs::ConsistencyInputs;

use super::command_gate;
use super::settings::{ConsistencyLimits, ControlSettings};
use crate::robot::{CONTROL_PERIOD_S, RobotState, robot_time_passed};
use crate::telemetry::{Fault, Mode, SensorCheck};
use clock::ClockComparison;
use commander::CommandEcho;
use feet::FootLoads;
use inertial::InertialUnit;
use inputs::StateStep;
use joints::JointRates;

/// Tolerance of a comparison: times are sums of rounded milliseconds.
const ROUNDING: f64 = 5e-4;

/// Sensors, clocks and commands over the last seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Consistency {
    last: Option<RobotState>,
    inertial: InertialUnit,
    feet: FootLoads,
    clock: ClockComparison,
    joints: JointRates,
    commander: CommandEcho,
}

impl Consistency {
    /// Resets every measure, after a placement.
    pub fn reset(&mut self) {
        *self = Consistency::default();
    }

    /// Records one tick; to be called once per tick, before the failsafes.
    pub fn update(&mut self, inputs: &ConsistencyInputs, settings: &ControlSettings) {
        if !settings.hardware {
            return;
        }
        let limits = &settings.consistency;
        self.commander.count_states(inputs.link.as_ref());
        self.clock.update(inputs, limits);
        if !inputs.is_new || command_gate::finite(inputs.state).is_err() {
            return;
        }
        let state = inputs.state;
        let passed_ms = self.last.map(|last| robot_time_passed(state.robot_time_ms, last.robot_time_ms));
        match (self.last.replace(*state), passed_ms) {
            (Some(last), Some(passed_ms @ 1..)) => {
                let dt_s = f64::from(passed_ms) * CONTROL_PERIOD_S;
                let step = StateStep::new(dt_s, settings.failsafe.state_age_ms);
                self.inertial.update(&last.imu, &state.imu, &inputs.accel_body, &step, inputs.mode.energised());
                self.feet.update(inputs, dt_s, settings);
                self.joints.update(&last, state, &step);
                self.commander.compare_torques(inputs, dt_s, settings);
            }
            // The first state, or one after a restart of the robot's clock.
            _ => {
                self.inertial = InertialUnit::begin(&state.imu, &inputs.accel_body);
                self.feet = FootLoads::begin(inputs);
                self.joints = JointRates::default();
            }
        }
    }

    /// Measured value of a check; not a number before the first state.
    pub fn measured(&self, check: SensorCheck) -> f64 {
        if self.last.is_none() {
            return f64::NAN;
        }
        match check {
            SensorCheck::InertialUnitLive => self.inertial.repeated_states().into(),
            SensorCheck::GravityMagnitude => self.inertial.gravity_error_m_s2(),
            SensorCheck::Orientation => self.inertial.tilt_error_rad(),
            SensorCheck::TurnRate => self.inertial.turn_error_rad(),
            SensorCheck::FeetLoaded => self.feet.load_error_s(),
            SensorCheck::FeetInFreeFall => self.feet.contact_in_free_fall_s(),
            SensorCheck::FeetAfterLanding => self.feet.unsupported_s(),
            SensorCheck::JointVelocity => self.joints.worst().1,
            SensorCheck::MotorsLive => self.joints.repeated_states().into(),
        }
    }

    /// Angle from the averaged specific force to the orientation's upward direction, rad; for a robot at rest.
    pub fn resting_tilt_error_rad(&self) -> f64 {
        self.last.map_or(f64::NAN, |_| self.inertial.resting_tilt_error_rad())
    }

    /// Joint with the largest error of its velocity.
    pub fn worst_joint(&self) -> u8 {
        self.joints.worst().0
    }

    /// Sum of the foot forces, N, averaged.
    pub fn foot_load_n(&self) -> f64 {
        self.last.map_or(f64::NAN, |_| self.feet.load_n())
    }

    /// Difference of the clocks since the last comparison, or the last step within a second, ms.
    pub fn clock_error_ms(&self) -> f64 {
        self.clock.recent_error_ms()
    }

    /// The fault of the robot's clock in this tick.
    pub fn clock_fault(&self, limits: &ConsistencyLimits) -> Option<Fault> {
        let (measured_ms, allowed_ms) = (self.clock.error_ms(), limits.clock_step_ms);
        (measured_ms.abs() > allowed_ms).then_some(Fault::RobotClock { measured_ms, allowed_ms })
    }

    /// The first sensor check that fails in `mode`.
    pub fn sensor_fault(&self, mode: Mode, limits: &ConsistencyLimits) -> Option<Fault> {
        SensorCheck::ALL.iter().filter(|check| watched(**check, mode)).find_map(|&check| {
            let (measured, allowed) = (self.measured(check), limits.allowed(check));
            (measured > allowed + ROUNDING).then_some(Fault::Sensors { check, measured, allowed })
        })
    }

    /// The first sign of another program that commands the robot.
    pub fn commander_fault(&self, mode: Mode, limits: &ConsistencyLimits) -> Option<Fault> {
        let (sign, measured, allowed) = self.commander.sign(self.last.as_ref()?, mode, limits)?;
        Some(Fault::OtherCommander { sign, measured, allowed })
    }
}

/// Whether the failsafe table watches a check in a mode.
const fn watched(check: SensorCheck, mode: Mode) -> bool {
    match check {
        // A motor of a standing robot may rest.
        SensorCheck::MotorsLive => matches!(mode, Mode::Jump),
        SensorCheck::GravityMagnitude | SensorCheck::FeetLoaded => matches!(mode, Mode::Ready | Mode::Countdown),
        SensorCheck::FeetAfterLanding => matches!(mode, Mode::Jump | Mode::Settle | Mode::Review),
        SensorCheck::InertialUnitLive
        | SensorCheck::Orientation
        | SensorCheck::TurnRate
        | SensorCheck::FeetInFreeFall
        | SensorCheck::JointVelocity => mode.energised(),
    }
}
