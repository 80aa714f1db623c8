//! Causes of the failsafe table: one function each, which compares a measured value with its limit.

use super::command_gate;
use super::failsafe_inputs::FailsafeInputs;
use super::settings::ControlSettings;
use crate::robot::{CONTROL_PERIOD_S, JOINTS, RobotState};
use crate::telemetry::{Fault, Mode};

pub(super) fn events_lost(inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    inputs.events_lost.then_some(Fault::EventsLost)
}

pub(super) fn remote_stop(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let pressed = inputs.state.remote.is_some_and(|remote| remote.buttons.contains(settings.remote.stop));
    pressed.then_some(Fault::RemoteStop)
}

pub(super) fn remote_silent(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (silent_ms, allowed_ms) = (inputs.remote_silent_ms, settings.remote.silent_ms);
    (silent_ms > allowed_ms).then_some(Fault::RemoteSilent { silent_ms, allowed_ms })
}

pub(super) fn robot_clock(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    inputs.consistency.clock_fault(&settings.consistency)
}

pub(super) fn sensors(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    inputs.consistency.sensor_fault(inputs.mode, &settings.consistency)
}

pub(super) fn other_commander(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    inputs.consistency.commander_fault(inputs.mode, &settings.consistency)
}

pub(super) fn suspended(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (suspended_ms, allowed_ms) = (inputs.suspended_ms, settings.failsafe.suspended_ms);
    (suspended_ms > allowed_ms).then_some(Fault::Suspended { suspended_ms, allowed_ms })
}

pub(super) fn guard_silent(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (silent_ms, allowed_ms) = (inputs.guard_silent_ms, settings.failsafe.guard_silent_ms);
    (silent_ms > allowed_ms).then_some(Fault::GuardSilent { silent_ms, allowed_ms })
}

pub(super) fn link_lost(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (age_ms, allowed_ms) = (inputs.state_age_ms, settings.failsafe.link_lost_ms);
    (age_ms > allowed_ms).then_some(Fault::LinkLost { age_ms, allowed_ms })
}

pub(super) fn state_age(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (age_ms, allowed_ms) = (inputs.state_age_ms, settings.failsafe.state_age_ms);
    (age_ms > allowed_ms).then_some(Fault::StateAge { age_ms, allowed_ms })
}

pub(super) fn joints_not_finite(inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    command_gate::joints_finite(inputs.state).err()
}

pub(super) fn body_not_finite(inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    command_gate::body_finite(inputs.state).err().or(inputs.accelerometer_fault)
}

pub(super) fn reboot(inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    inputs.restarted.then_some(Fault::Reboot)
}

pub(super) fn corrupt(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (count, allowed) = (inputs.link?.recent_corrupt, settings.failsafe.corrupt);
    (count > allowed).then_some(Fault::Corrupt { count, allowed })
}

pub(super) fn send_error(inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    inputs.send_error.map(|errno| Fault::Send { errno })
}

pub(super) fn late(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (measured_ms, allowed_ms) = (inputs.lateness_ns as f64 * 1e-6, settings.late_ms);
    (allowed_ms > 0.0 && measured_ms > allowed_ms).then_some(Fault::Late { measured_ms, allowed_ms })
}

pub(super) fn motor_hot(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let ((joint, measured_c), allowed_c) = (hottest(inputs.state), settings.failsafe.motor_c);
    (measured_c >= allowed_c).then_some(Fault::MotorTemperature { joint, measured_c, allowed_c })
}

pub(super) fn motor_mode(inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    let joint = inputs.state.motor_enabled.iter().position(|enabled| !enabled)?;
    Some(Fault::MotorMode { joint: joint as u8 })
}

pub(super) fn joint_position(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let margin = settings.failsafe.joint_margin_rad;
    (0..JOINTS).find_map(|joint| {
        let measured_rad = inputs.state.joint_position_rad[joint];
        let (least, most) = (settings.min_position[joint] - margin, settings.max_position[joint] + margin);
        let allowed_rad = measured_rad.clamp(least, most);
        let fault = Fault::JointPosition { joint: joint as u8, measured_rad, allowed_rad };
        (measured_rad != allowed_rad).then_some(fault)
    })
}

pub(super) fn joint_velocity(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    (0..JOINTS).find_map(|joint| {
        let measured_rad_s = inputs.state.joint_velocity_rad_s[joint];
        let allowed_rad_s = settings.max_velocity[joint] * settings.failsafe.velocity_factor;
        let fault = Fault::JointVelocity { joint: joint as u8, measured_rad_s, allowed_rad_s };
        (measured_rad_s.abs() > allowed_rad_s).then_some(fault)
    })
}

pub(super) fn joint_torque(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    (0..JOINTS).find_map(|joint| {
        let measured_n_m = inputs.state.joint_torque_n_m[joint];
        let allowed_n_m = settings.max_torque[joint] * settings.failsafe.torque_factor;
        let fault = Fault::JointTorque { joint: joint as u8, measured_n_m, allowed_n_m };
        (measured_n_m.is_nan() || measured_n_m.abs() > allowed_n_m).then_some(fault)
    })
}

pub(super) fn tilt(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let measured_rad = inputs.estimate.tilt_rad();
    // The tilt limit is larger while the robot sits down.
    let limits = &settings.failsafe;
    let allowed_rad = if inputs.mode == Mode::SitDown { limits.tilt_rad } else { limits.stance_tilt_rad };
    (measured_rad.is_nan() || measured_rad > allowed_rad).then_some(Fault::Tilt { measured_rad, allowed_rad })
}

pub(super) fn delay(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (measured_ms, allowed_ms) = (inputs.delay_growth_ms, settings.failsafe.delay_land_ms);
    (settings.hardware && measured_ms > allowed_ms).then_some(Fault::LinkDelay { measured_ms, allowed_ms })
}

pub(super) fn operator_silent(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let silent_ms = inputs.operator_silent_ms;
    (silent_ms > settings.failsafe.operator_silent_ms).then_some(Fault::OperatorLost { silent_ms })
}

/// Charge of the battery, percent; not a number where none between 0 and 100 is reported. 255 is a usual "not available".
pub(super) fn reported_charge(state: &RobotState) -> f64 {
    let charge = state.battery.map(|battery| battery.charge_percent);
    charge.filter(|percent| (0.0..=100.0).contains(percent)).unwrap_or(f64::NAN)
}

/// Index and temperature (degrees Celsius) of the hottest motor.
pub(super) fn hottest(state: &RobotState) -> (u8, f64) {
    let temperatures = state.motor_temperature_c.iter().enumerate();
    temperatures.fold((0, f64::MIN), |hottest, (joint, &c)| if c > hottest.1 { (joint as u8, c) } else { hottest })
}

pub(super) fn slow(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let limits = &settings.failsafe;
    let slow = settings.late_ms > 0.0 && inputs.period.slow >= limits.period_ticks;
    slow.then_some(Fault::Slow {
        ticks: inputs.period.slow,
        measured_ms: inputs.period.period_ms,
        allowed_ms: limits.period_factor * CONTROL_PERIOD_S * 1e3,
    })
}
