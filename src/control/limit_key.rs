//! The key of the configuration behind the end of a trial, for messages: which number an operator would change.
//!
//! The matches have no wildcard: a new fault, fall or inhibit is either mapped here or said to have no limit.

use super::settings::ControlSettings;
use crate::telemetry::{CommanderSign, FallCause, Fault, SensorCheck, TrialEnd, TrialInhibit};

/// A key of a configuration file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitKey {
    /// The key with its table.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// The file's name.
    pub file: &'static str,
}

/// A key with its table, and its value.
type KeyValue = (&'static str, f64);

impl std::fmt::Display for LimitKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} = {} in {}", self.key, self.value, self.file)
    }
}

const SAFETY: &str = "safety.toml";
const CONTROL: &str = "control.toml";

/// Returns the key of the limit that ended a trial; none where no limit of the configuration did. `settings` are those of the
/// trial: some limits have a key for the simulator and one for hardware.
pub fn limit_key(end: &TrialEnd, settings: &ControlSettings) -> Option<LimitKey> {
    let ((key, value), file) = match end {
        TrialEnd::Settled | TrialEnd::Stopped | TrialEnd::Cancelled | TrialEnd::Refused(_) | TrialEnd::SatDown => {
            return None;
        }
        TrialEnd::NotQuiet => (("settle.cap_s", settings.settle.cap_s), CONTROL),
        TrialEnd::Fell(cause) => (fall_key(cause, settings), SAFETY),
        TrialEnd::NotReady(TrialInhibit::NotQuiet { .. }) | TrialEnd::Held(TrialInhibit::NotQuiet { .. }) => {
            (("settle.quiet_s", settings.settle.quiet_s), CONTROL)
        }
        TrialEnd::NotReady(inhibit) | TrialEnd::Held(inhibit) => (inhibit_key(inhibit, settings)?, SAFETY),
        TrialEnd::Fault(Fault::PoseTimeout { .. }) => (("stand_up.timeout_s", settings.stand_up.timeout_s), CONTROL),
        TrialEnd::Fault(fault) => (fault_key(fault, settings)?, SAFETY),
    };
    Some(LimitKey { key, value, file })
}

fn fall_key(cause: &FallCause, settings: &ControlSettings) -> KeyValue {
    // The limit in flight is the smaller one wherever it applies; of equal limits that on the ground is named.
    let (allowed_rad, ground_rad, ground_key) = match *cause {
        FallCause::BodyContact => return ("fall.body_contact_s", settings.fall.body_contact_s),
        FallCause::Roll { allowed_rad, .. } => (allowed_rad, settings.fall.roll_rad, "fall.roll_rad"),
        FallCause::Pitch { allowed_rad, .. } => (allowed_rad, settings.fall.pitch_rad, "fall.pitch_rad"),
    };
    match (allowed_rad == settings.flight_tilt_rad && allowed_rad != ground_rad, settings.hardware) {
        (false, _) => (ground_key, ground_rad),
        (true, false) => ("fall.simulator_flight_rad", settings.flight_tilt_rad),
        (true, true) => ("fall.hardware_flight_rad", settings.flight_tilt_rad),
    }
}

fn inhibit_key(inhibit: &TrialInhibit, settings: &ControlSettings) -> Option<KeyValue> {
    let limits = &settings.failsafe;
    Some(match inhibit {
        TrialInhibit::BatteryLow { .. } => ("watchdog.battery_percent", limits.battery_percent),
        TrialInhibit::MotorUnmeasured { .. } => ("pre_arm.motor_measured_c", settings.arming.motor_measured_c),
        TrialInhibit::MotorWarm { .. } => ("watchdog.motor_warm_c", limits.motor_warm_c),
        TrialInhibit::FootForces { measured_n, least_n, .. } if measured_n < least_n => {
            ("ready.force_share_min", settings.ready.force_share_min)
        }
        TrialInhibit::FootForces { .. } => ("ready.force_share_max", settings.ready.force_share_max),
        TrialInhibit::NotLevel { .. } => ("ready.tilt_rad", settings.ready.tilt_rad),
        TrialInhibit::NotAtStance { .. } => ("ready.stance_rad", settings.ready.stance_rad),
        TrialInhibit::StatesOld { .. } => ("pre_arm.state_age_ms", settings.arming.state_age_ms.into()),
        TrialInhibit::StatesLost { .. } => ("pre_arm.loss_share", settings.arming.loss_share),
        TrialInhibit::TicksLate { .. } => ("pre_arm.late_share", settings.arming.late_share),
        TrialInhibit::LinkDelay { .. } => ("watchdog.delay_hold_ms", limits.delay_hold_ms),
        // No number, or a number of another file.
        TrialInhibit::BatteryUnreported
        | TrialInhibit::RemoteSilent
        | TrialInhibit::FeetUp { .. }
        | TrialInhibit::NotQuiet { .. } => return None,
    })
}

fn fault_key(fault: &Fault, settings: &ControlSettings) -> Option<KeyValue> {
    let limits = &settings.failsafe;
    Some(match *fault {
        Fault::JointPosition { .. } => ("watchdog.joint_margin_rad", limits.joint_margin_rad),
        Fault::JointVelocity { .. } => ("watchdog.velocity_factor", limits.velocity_factor),
        Fault::JointTorque { .. } => ("watchdog.torque_factor", limits.torque_factor),
        Fault::StateAge { .. } => ("watchdog.state_age_ms", limits.state_age_ms.into()),
        Fault::LinkLost { .. } => ("watchdog.link_lost_ms", limits.link_lost_ms.into()),
        Fault::Corrupt { .. } => ("watchdog.corrupt", limits.corrupt.into()),
        Fault::MotorTemperature { .. } => ("watchdog.motor_c", limits.motor_c),
        Fault::Tilt { allowed_rad, .. } if allowed_rad == settings.failsafe.stance_tilt_rad => {
            ("watchdog.stance_tilt_rad", limits.stance_tilt_rad)
        }
        Fault::Tilt { .. } => ("watchdog.tilt_rad", limits.tilt_rad),
        Fault::Late { .. } if settings.hardware => ("watchdog.hardware_late_ms", limits.hardware_late_ms),
        Fault::Late { .. } => ("watchdog.simulator_late_ms", limits.simulator_late_ms),
        Fault::Slow { .. } => ("watchdog.period_factor", limits.period_factor),
        Fault::OperatorLost { .. } => ("watchdog.operator_silent_ms", limits.operator_silent_ms.into()),
        Fault::Sensors { check, .. } => (sensor_key(check), settings.consistency.allowed(check)),
        Fault::Acceleration { .. } => ("consistency.accel_most_m_s2", settings.consistency.accel_most_m_s2),
        Fault::RobotClock { .. } => ("consistency.clock_step_ms", settings.consistency.clock_step_ms),
        Fault::OtherCommander { sign: CommanderSign::LostStates, .. } => {
            ("consistency.loss_share", settings.consistency.loss_share)
        }
        Fault::OtherCommander { sign: CommanderSign::ForeignTorque, .. } => {
            ("consistency.torque_n_m", settings.consistency.torque_n_m)
        }
        Fault::RemoteSilent { .. } => ("remote.silent_ms", settings.remote.silent_ms.into()),
        Fault::Suspended { .. } => ("watchdog.suspended_ms", limits.suspended_ms.into()),
        Fault::GuardSilent { .. } => ("watchdog.guard_silent_ms", limits.guard_silent_ms.into()),
        Fault::LinkDelay { .. } => ("watchdog.delay_land_ms", limits.delay_land_ms),
        Fault::FollowingError { .. } => ("watchdog.ramp_error_rad", limits.ramp_error_rad),
        Fault::RampTorque { .. } => ("watchdog.ramp_torque_share", limits.ramp_torque_share),
        // No number, or a number of another file.
        Fault::NotFinite { .. }
        | Fault::WantedTorque { .. }
        | Fault::Reboot
        | Fault::MotorMode { .. }
        | Fault::PoseTimeout { .. }
        | Fault::OperatorLeft
        | Fault::Send { .. }
        | Fault::EventsLost
        | Fault::OtherCommander { sign: CommanderSign::ForeignMode | CommanderSign::ForeignCommands, .. }
        | Fault::RemoteStop => return None,
    })
}

const fn sensor_key(check: SensorCheck) -> &'static str {
    match check {
        SensorCheck::InertialUnitLive => "consistency.repeated_states",
        SensorCheck::GravityMagnitude => "consistency.gravity_m_s2",
        SensorCheck::Orientation => "consistency.orientation_rad",
        SensorCheck::TurnRate => "consistency.turn_rad",
        SensorCheck::FeetLoaded => "consistency.foot_load_s",
        SensorCheck::FeetInFreeFall => "consistency.free_fall_contact_s",
        SensorCheck::FeetAfterLanding => "consistency.unsupported_s",
        SensorCheck::JointVelocity => "consistency.joint_velocity_rad",
        SensorCheck::MotorsLive => "consistency.repeated_motor_states",
    }
}
