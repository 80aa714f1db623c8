//! The table of watchdogs: what may never be passed, in which modes it is watched, and what happens then. Table and reasons:
//! `research/operators.md` D.4; every threshold is a key of `config/safety.toml`, `[watchdog]`.
//!
//! A fall in the course of a trial is not here: it is an outcome of the trial (`jump::FallWatch`), and damps as well.

use super::limits;
use super::settings::{ControlSettings, PERIOD_S};
use crate::robot::{JOINTS, LinkStatus, RobotState};
use crate::telemetry::{Estimate, FailsafeWarning, Fault, Mode, TrialInhibit};

/// What one tick knows.
#[derive(Debug, Clone, Copy)]
pub struct FailsafeInputs<'a> {
    /// Mode at the start of the tick.
    pub mode: Mode,
    /// The newest state.
    pub state: &'a RobotState,
    /// What the controller makes of it.
    pub estimate: &'a Estimate,
    /// Age of that state, ms; zero while the robot answers.
    pub state_age_ms: u32,
    /// The robot's clock went backwards since the tick before.
    pub restarted: bool,
    /// The link; none for a machine without one.
    pub link: Option<LinkStatus>,
    /// How late the tick started, ns.
    pub lateness_ns: u64,
    /// The system's error number, if the robot could not be reached in this tick.
    pub send_error: Option<i32>,
    /// How long the operator's screen has been silent, ms.
    pub operator_silent_ms: u32,
    /// The session does not take events.
    pub events_lost: bool,
}

/// What happens when a row trips.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailsafeAction {
    /// Damping in the same tick, latched as a fault.
    Cut,
    /// The landing is finished, then the robot sits down and is disarmed.
    Land,
}

/// A row that tripped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trip {
    /// What happens.
    pub level: FailsafeAction,
    /// What was measured and what is allowed.
    pub fault: Fault,
}

/// One row of the table.
struct FailsafeRow {
    level: FailsafeAction,
    /// The modes in which it is watched.
    watched: fn(Mode) -> bool,
    /// The fault, if it is one now.
    trips: fn(&Failsafe, &FailsafeInputs, &ControlSettings) -> Option<Fault>,
}

/// The table. The first row that trips counts, so what makes the numbers below it worthless stands above them.
const TABLE: [FailsafeRow; 16] = [
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: events_lost },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: link_lost },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: state_age },
    // FailsafeInputs in one tick alone, and what a robot reports while it starts need not be numbers.
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: reboot },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: not_finite },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: corrupt },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: send_error },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: late },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: slow },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::commanded, trips: motor_hot },
    FailsafeRow { level: FailsafeAction::Cut, watched: energised_or_faulted, trips: motor_mode },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::energised, trips: joint_position },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::energised, trips: joint_velocity },
    FailsafeRow { level: FailsafeAction::Cut, watched: Mode::energised, trips: joint_torque },
    FailsafeRow { level: FailsafeAction::Cut, watched: outside_a_trial, trips: tilt },
    FailsafeRow { level: FailsafeAction::Land, watched: Mode::energised, trips: operator_silent },
];

/// A motor that leaves servo mode after another fault is told, too: power may have been cut. Disarmed, it is an item of the
/// pre-arm list.
const fn energised_or_faulted(mode: Mode) -> bool {
    mode.energised() || matches!(mode, Mode::Fault)
}

/// Energised, and neither a trial nor its verdict, whose tilt is a fall and `jump::FallWatch`'s to see: in REVIEW at this
/// row's own limit, in SETTLE, where a landing may swing, at that of a fall.
const fn outside_a_trial(mode: Mode) -> bool {
    matches!(mode, Mode::StandUp | Mode::Ready | Mode::Countdown | Mode::SitDown)
}

/// The watchdog: the table and what it must remember from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Failsafe {
    /// When the tick before began, ns.
    began_ns: Option<u64>,
    /// Time since then, ms.
    period_ms: f64,
    /// Ticks in a row that came too long after the one before.
    slow: u32,
}

impl Failsafe {
    /// Once per tick, first: the pace.
    pub fn begin(&mut self, time_ns: u64, lateness_ns: u64, settings: &ControlSettings) {
        let began_ns = time_ns + lateness_ns;
        self.period_ms = self.began_ns.map_or(0.0, |before| began_ns.saturating_sub(before) as f64 * 1e-6);
        self.began_ns = Some(began_ns);
        let slow = self.period_ms > settings.watchdog.period_factor * PERIOD_S * 1e3;
        self.slow = if slow { self.slow + 1 } else { 0 };
    }

    /// The first row that trips; none if all is well.
    pub fn check(&self, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Trip> {
        TABLE.iter().filter(|row| (row.watched)(seen.mode)).find_map(|row| {
            let fault = (row.trips)(self, seen, settings)?;
            Some(Trip { level: row.level, fault })
        })
    }
}

/// What lets a trial finish but forbids the next: none if nothing does.
pub fn hold(state: &RobotState, settings: &ControlSettings) -> Option<TrialInhibit> {
    let limits = &settings.watchdog;
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

/// What is only worth a word: none if nothing is.
pub fn caution(seen: &FailsafeInputs, settings: &ControlSettings) -> Option<FailsafeWarning> {
    let limits = &settings.watchdog;
    if seen.mode.commanded() && seen.state_age_ms > limits.state_age_warn_ms {
        Some(FailsafeWarning::StateAge { age_ms: seen.state_age_ms, allowed_ms: limits.state_age_warn_ms })
    } else if seen.mode.energised() && seen.operator_silent_ms > limits.operator_warn_ms {
        Some(FailsafeWarning::OperatorQuiet { silent_ms: seen.operator_silent_ms, allowed_ms: limits.operator_warn_ms })
    } else {
        None
    }
}

fn events_lost(_: &Failsafe, seen: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    seen.events_lost.then_some(Fault::EventsLost)
}

fn link_lost(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (age_ms, allowed_ms) = (seen.state_age_ms, settings.watchdog.link_lost_ms);
    (age_ms > allowed_ms).then_some(Fault::LinkLost { age_ms, allowed_ms })
}

fn state_age(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (age_ms, allowed_ms) = (seen.state_age_ms, settings.watchdog.state_age_ms);
    (age_ms > allowed_ms).then_some(Fault::StateAge { age_ms, allowed_ms })
}

fn not_finite(_: &Failsafe, seen: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    limits::finite(seen.state).err()
}

fn reboot(_: &Failsafe, seen: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    seen.restarted.then_some(Fault::Reboot)
}

fn corrupt(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (count, allowed) = (seen.link?.recent_corrupt, settings.watchdog.corrupt);
    (count > allowed).then_some(Fault::Corrupt { count, allowed })
}

fn send_error(_: &Failsafe, seen: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    seen.send_error.map(|errno| Fault::Send { errno })
}

fn late(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let (measured_ms, allowed_ms) = (seen.lateness_ns as f64 * 1e-6, settings.late_ms);
    (allowed_ms > 0.0 && measured_ms > allowed_ms).then_some(Fault::Late { measured_ms, allowed_ms })
}

fn slow(watchdog: &Failsafe, _: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let limits = &settings.watchdog;
    let slow = settings.late_ms > 0.0 && watchdog.slow >= limits.period_ticks;
    slow.then_some(Fault::Slow {
        ticks: watchdog.slow,
        measured_ms: watchdog.period_ms,
        allowed_ms: limits.period_factor * PERIOD_S * 1e3,
    })
}

fn motor_hot(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let ((joint, measured_c), allowed_c) = (hottest(seen.state), settings.watchdog.motor_c);
    (measured_c >= allowed_c).then_some(Fault::MotorTemperature { joint, measured_c, allowed_c })
}

fn motor_mode(_: &Failsafe, seen: &FailsafeInputs, _: &ControlSettings) -> Option<Fault> {
    let joint = seen.state.motor_enabled.iter().position(|enabled| !enabled)?;
    Some(Fault::MotorMode { joint: joint as u8 })
}

fn joint_position(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let margin = settings.watchdog.joint_margin_rad;
    (0..JOINTS).find_map(|joint| {
        let measured_rad = seen.state.joint_position[joint];
        let (least, most) = (settings.min_position[joint] - margin, settings.max_position[joint] + margin);
        let allowed_rad = measured_rad.clamp(least, most);
        let fault = Fault::JointPosition { joint: joint as u8, measured_rad, allowed_rad };
        (measured_rad != allowed_rad).then_some(fault)
    })
}

fn joint_velocity(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    (0..JOINTS).find_map(|joint| {
        let measured_rad_s = seen.state.joint_velocity[joint];
        let allowed_rad_s = settings.max_velocity[joint] * settings.watchdog.velocity_factor;
        let fault = Fault::JointVelocity { joint: joint as u8, measured_rad_s, allowed_rad_s };
        (measured_rad_s.abs() > allowed_rad_s).then_some(fault)
    })
}

fn joint_torque(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    (0..JOINTS).find_map(|joint| {
        let measured_nm = seen.state.joint_torque[joint];
        let allowed_nm = settings.max_torque[joint] * settings.watchdog.torque_factor;
        let fault = Fault::JointTorque { joint: joint as u8, measured_nm, allowed_nm };
        (measured_nm.is_nan() || measured_nm.abs() > allowed_nm).then_some(fault)
    })
}

fn tilt(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let [roll, pitch, _] = seen.estimate.roll_pitch_yaw.into();
    let measured_rad = roll.abs().max(pitch.abs());
    // Who sits down may lean; who stands must not.
    let limits = &settings.watchdog;
    let allowed_rad = if seen.mode == Mode::SitDown { limits.tilt_rad } else { limits.stance_tilt_rad };
    (measured_rad > allowed_rad).then_some(Fault::Tilt { measured_rad, allowed_rad })
}

fn operator_silent(_: &Failsafe, seen: &FailsafeInputs, settings: &ControlSettings) -> Option<Fault> {
    let silent_ms = seen.operator_silent_ms;
    (silent_ms > settings.watchdog.operator_silent_ms).then_some(Fault::OperatorLost { silent_ms })
}

/// The hottest motor and its temperature, degrees Celsius.
fn hottest(state: &RobotState) -> (u8, f64) {
    let temperatures = state.motor_temperature_c.iter().enumerate();
    temperatures.fold((0, f64::MIN), |hottest, (joint, &c)| if c > hottest.1 { (joint as u8, c) } else { hottest })
}
