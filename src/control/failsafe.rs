//! The failsafe table: cause, modes in which it is watched, action. Reasons: `docs/safety.md`; every limit is a key of
//! `config/safety.toml`, `[watchdog]`.
//!
//! A fall during a trial is an outcome of the trial, detected by `running_trial::FallWatch`; it damps as well.

use super::command_gate;
use super::consistency::Consistency;
use super::settings::ControlSettings;
use crate::robot::{CONTROL_PERIOD_S, JOINTS, LinkStatus, RobotState};
use crate::telemetry::{Estimate, FailsafeWarning, Fault, Mode, TrialInhibit};

/// Data of one tick for the failsafes.
#[derive(Debug, Clone, Copy)]
pub struct FailsafeInputs<'a> {
    /// Mode in which the failsafes run.
    pub mode: Mode,
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
    /// Delay of the start of the tick, ns.
    pub lateness_ns: u64,
    /// `errno` of a failed send.
    pub send_error: Option<i32>,
    /// Time since the last heartbeat of the operator's console, ms.
    pub operator_silent_ms: u32,
    /// The session takes no events.
    pub events_lost: bool,
    /// Consistency of sensors, clocks and commands.
    pub consistency: &'a Consistency,
}

/// The action of a failsafe and the condition that clears it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailsafeAction {
    /// Damping in the same tick, latched as FAULT. Cleared by an acknowledgement once no row with this action trips.
    Damp,
    /// No further impulse; after the landing the robot sits down and is disarmed. Cleared when the cause is gone, and by arming.
    Land,
}

/// A failsafe that tripped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trip {
    /// Its action.
    pub action: FailsafeAction,
    /// Its cause, with measured value and limit.
    pub fault: Fault,
}

/// One row of the table.
struct FailsafeRow {
    cause: fn(&Failsafe, &FailsafeInputs, &ControlSettings) -> Option<Fault>,
    /// Modes in which the cause is watched.
    modes: fn(Mode) -> bool,
    action: FailsafeAction,
}

const fn cut(
    cause: fn(&Failsafe, &FailsafeInputs, &ControlSettings) -> Option<Fault>,
    modes: fn(Mode) -> bool,
) -> FailsafeRow {
    FailsafeRow { cause, modes, action: FailsafeAction::Damp }
}

/// The table, by precedence: the first row that trips counts. A cause that makes measured numbers invalid stands above the rows
/// that compare them.
const TABLE: [FailsafeRow; 20] = [
    cut(remote_stop, Mode::commanded),
    cut(events_lost, Mode::commanded),
    cut(link_lost, Mode::commanded),
    cut(state_age, Mode::commanded),
    // True in one tick only, and a robot that boots may report numbers that are not finite.
    cut(reboot, Mode::commanded),
    cut(robot_clock, Mode::commanded),
    cut(not_finite, Mode::commanded),
    cut(corrupt, Mode::commanded),
    cut(send_error, Mode::commanded),
    cut(late, Mode::commanded),
    cut(slow, Mode::commanded),
    cut(motor_hot, Mode::commanded),
    // Above the single motor: no command of ours takes all of them out of servo mode.
    cut(other_commander, Mode::energised),
    cut(motor_mode, energised_or_faulted),
    cut(joint_position, Mode::energised),
    cut(joint_velocity, Mode::energised),
    cut(joint_torque, Mode::energised),
    cut(tilt, outside_a_trial),
    cut(sensors, Mode::energised),
    FailsafeRow { cause: operator_silent, modes: Mode::energised, action: FailsafeAction::Land },
];

/// Also reported when another fault is latched: the motors' power may have been cut. While disarmed it is an arming check.
const fn energised_or_faulted(mode: Mode) -> bool {
    mode.energised() || matches!(mode, Mode::Fault)
}

/// Energised, without a trial and its review, where tilt is a fall: `running_trial::FallWatch` compares it with this row's limit in REVIEW,
/// and with the limit of a fall in SETTLE, where a landing may swing.
const fn outside_a_trial(mode: Mode) -> bool {
    matches!(mode, Mode::StandUp | Mode::Ready | Mode::Countdown | Mode::SitDown)
}

/// Periods of the last ticks, for the row `slow`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Failsafe {
    /// Start of the last tick, ns.
    began_ns: Option<u64>,
    /// Time between the last two starts, ms.
    period_ms: f64,
    /// Ticks in a row with too long a period.
    slow: u32,
}

impl Failsafe {
    /// Measures the period; to be called once per tick, before `check`.
    pub fn begin(&mut self, time_ns: u64, lateness_ns: u64, settings: &ControlSettings) {
        let began_ns = time_ns + lateness_ns;
        self.period_ms = self.began_ns.map_or(0.0, |before| began_ns.saturating_sub(before) as f64 * 1e-6);
        self.began_ns = Some(began_ns);
        let slow = self.period_ms > settings.failsafe.period_factor * CONTROL_PERIOD_S * 1e3;
        self.slow = if slow { self.slow + 1 } else { 0 };
    }

    /// Returns the first row that trips.
    pub fn check(&self, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Trip> {
        TABLE.iter().filter(|row| (row.modes)(inputs.mode)).find_map(|row| {
            let fault = (row.cause)(self, inputs, settings)?;
            Some(Trip { action: row.action, fault })
        })
    }
}

/// Returns the reason to refuse the next trial (HOLD); a running trial finishes.
///
/// 1. Battery below its limit.
/// 2. A motor at its warm limit.
pub fn trial_inhibit(state: &RobotState, settings: &ControlSettings) -> Option<TrialInhibit> {
    let limits = &settings.failsafe;
    let low = state.battery.map(|battery| battery.charge_percent).filter(|charge| *charge < limits.battery_percent);
    if let Some(measured_percent) = low {
        return Some(TrialInhibit::BatteryLow { measured_percent, allowed_percent: limits.battery_percent });
    }
    let (joint, measured_c) = hottest(state);
    (measured_c >= limits.motor_warm_c).then_some(TrialInhibit::MotorWarm {
        joint,
        measured_c,
        allowed_c: limits.motor_warm_c,
    })
}

/// Returns the warning that precedes a failsafe: an old state before a silent operator's console.
pub fn warning(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<FailsafeWarning> {
    let limits = &settings.failsafe;
    if inputs.mode.commanded() && inputs.state_age_ms > limits.state_age_warn_ms {
        Some(FailsafeWarning::StateAge { age_ms: inputs.state_age_ms, allowed_ms: limits.state_age_warn_ms })
    } else if inputs.mode.energised() && inputs.operator_silent_ms > limits.operator_warn_ms {
        Some(FailsafeWarning::OperatorQuiet {
            silent_ms: inputs.operator_silent_ms,
            allowed_ms: limits.operator_warn_ms,
        })
    } else {
        None
    }
}

fn events_lost(_: &Failsafe, inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    inputs.events_lost.then_some(Fault::EventsLost)
}

fn remote_stop(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let pressed = inputs.state.remote.is_some_and(|remote| remote.buttons.contains(settings.remote.stop));
    pressed.then_some(Fault::RemoteStop)
}

fn robot_clock(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    inputs.consistency.clock_fault(&settings.consistency)
}

fn sensors(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    inputs.consistency.sensor_fault(inputs.mode, &settings.consistency)
}

fn other_commander(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    inputs.consistency.commander_fault(inputs.mode, &settings.consistency)
}

fn link_lost(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (age_ms, allowed_ms) = (inputs.state_age_ms, settings.failsafe.link_lost_ms);
    (age_ms > allowed_ms).then_some(Fault::LinkLost { age_ms, allowed_ms })
}

fn state_age(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (age_ms, allowed_ms) = (inputs.state_age_ms, settings.failsafe.state_age_ms);
    (age_ms > allowed_ms).then_some(Fault::StateAge { age_ms, allowed_ms })
}

fn not_finite(_: &Failsafe, inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    command_gate::finite(inputs.state).err()
}

fn reboot(_: &Failsafe, inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    inputs.restarted.then_some(Fault::Reboot)
}

fn corrupt(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (count, allowed) = (inputs.link?.recent_corrupt, settings.failsafe.corrupt);
    (count > allowed).then_some(Fault::Corrupt { count, allowed })
}

fn send_error(_: &Failsafe, inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    inputs.send_error.map(|errno| Fault::Send { errno })
}

fn late(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (measured_ms, allowed_ms) = (inputs.lateness_ns as f64 * 1e-6, settings.late_ms);
    (allowed_ms > 0.0 && measured_ms > allowed_ms).then_some(Fault::Late { measured_ms, allowed_ms })
}

fn slow(failsafe: &Failsafe, _: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let limits = &settings.failsafe;
    let slow = settings.late_ms > 0.0 && failsafe.slow >= limits.period_ticks;
    slow.then_some(Fault::Slow {
        ticks: failsafe.slow,
        measured_ms: failsafe.period_ms,
        allowed_ms: limits.period_factor * CONTROL_PERIOD_S * 1e3,
    })
}

fn motor_hot(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let ((joint, measured_c), allowed_c) = (hottest(inputs.state), settings.failsafe.motor_c);
    (measured_c >= allowed_c).then_some(Fault::MotorTemperature { joint, measured_c, allowed_c })
}

fn motor_mode(_: &Failsafe, inputs: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    let joint = inputs.state.motor_enabled.iter().position(|enabled| !enabled)?;
    Some(Fault::MotorMode { joint: joint as u8 })
}

fn joint_position(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let margin = settings.failsafe.joint_margin_rad;
    (0..JOINTS).find_map(|joint| {
        let measured_rad = inputs.state.joint_position_rad[joint];
        let (least, most) = (settings.min_position[joint] - margin, settings.max_position[joint] + margin);
        let allowed_rad = measured_rad.clamp(least, most);
        let fault = Fault::JointPosition { joint: joint as u8, measured_rad, allowed_rad };
        (measured_rad != allowed_rad).then_some(fault)
    })
}

fn joint_velocity(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    (0..JOINTS).find_map(|joint| {
        let measured_rad_s = inputs.state.joint_velocity_rad_s[joint];
        let allowed_rad_s = settings.max_velocity[joint] * settings.failsafe.velocity_factor;
        let fault = Fault::JointVelocity { joint: joint as u8, measured_rad_s, allowed_rad_s };
        (measured_rad_s.abs() > allowed_rad_s).then_some(fault)
    })
}

fn joint_torque(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    (0..JOINTS).find_map(|joint| {
        let measured_nm = inputs.state.joint_torque_n_m[joint];
        let allowed_nm = settings.max_torque[joint] * settings.failsafe.torque_factor;
        let fault = Fault::JointTorque { joint: joint as u8, measured_nm, allowed_nm };
        (measured_nm.is_nan() || measured_nm.abs() > allowed_nm).then_some(fault)
    })
}

fn tilt(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let [roll, pitch, _] = inputs.estimate.roll_pitch_yaw.into();
    let measured_rad = roll.abs().max(pitch.abs());
    // The tilt limit is larger while the robot sits down.
    let limits = &settings.failsafe;
    let allowed_rad = if inputs.mode == Mode::SitDown { limits.tilt_rad } else { limits.stance_tilt_rad };
    (measured_rad > allowed_rad).then_some(Fault::Tilt { measured_rad, allowed_rad })
}

fn operator_silent(_: &Failsafe, inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let silent_ms = inputs.operator_silent_ms;
    (silent_ms > settings.failsafe.operator_silent_ms).then_some(Fault::OperatorLost { silent_ms })
}

/// Index and temperature (degrees Celsius) of the hottest motor.
fn hottest(state: &RobotState) -> (u8, f64) {
    let temperatures = state.motor_temperature_c.iter().enumerate();
    temperatures.fold((0, f64::MIN), |hottest, (joint, &c)| if c > hottest.1 { (joint as u8, c) } else { hottest })
}
