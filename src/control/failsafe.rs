//! The failsafe table: cause, modes in which it is watched, action by phase of the motion. Reasons: `docs/safety.md`, whose table a test
//! compares with this one; every limit is a key of `config/safety.toml`, `[watchdog]`.
//!
//! A fall during a trial is an outcome of the trial, detected by `running_trial::FallWatch`; it damps as well.

use super::consistency::FOREIGN_COMMANDS;
use super::estimator::{MOST_IN_A_ROW, MOST_RECENT};
use super::failsafe_causes::{
    body_not_finite, corrupt, delay, events_lost, guard_silent, hottest, joint_position, joint_torque, joint_velocity,
    joints_not_finite, late, link_lost, motor_hot, motor_mode, operator_silent, other_commander, reboot, remote_silent,
    remote_stop, reported_charge, robot_clock, send_error, sensors, slow, state_age, suspended, tilt,
};
pub use super::failsafe_inputs::{FailsafeInputs, MotionPhase, PeriodWatch};
use super::settings::ControlSettings;
use crate::robot::{CONTROL_PERIOD_S, RobotState};
use crate::telemetry::{FailsafeWarning, Fault, Mode, TrialInhibit};

/// The action of a failsafe and the condition that clears it, from the mildest to the strictest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FailsafeAction {
    /// No further impulse; after the landing the robot sits down and is disarmed. Cleared when the cause is gone, and by arming.
    Land,
    /// The controller lands the robot, without the rest of the impulse; then damping, latched as FAULT.
    LandThenDamp,
    /// The motors hold the joint angles of the stance by themselves, without measured state; then damping, latched as FAULT.
    HoldThenDamp,
    /// Damping in the same tick, latched as FAULT. Cleared by an acknowledgement once no row with this action trips.
    Damp,
}

impl FailsafeAction {
    /// Name in `docs/safety.md`.
    pub const fn name(self) -> &'static str {
        match self {
            FailsafeAction::Land => "LAND",
            FailsafeAction::LandThenDamp => "LAND, then DAMP",
            FailsafeAction::HoldThenDamp => "STANCE, then DAMP",
            FailsafeAction::Damp => "DAMP",
        }
    }
}

/// A failsafe that tripped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trip {
    /// Its action.
    pub action: FailsafeAction,
    /// Its cause, with measured value and limit.
    pub fault: Fault,
}

type Cause = fn(&FailsafeInputs, &ControlSettings) -> Option<Fault>;

/// One row of the table.
struct FailsafeRow {
    name: &'static str,
    /// Limit in words.
    limit: fn(&ControlSettings) -> String,
    cause: Cause,
    /// Modes in which the cause is watched.
    modes: fn(Mode) -> bool,
    /// Actions on the ground, in the air, in the landing.
    actions: [FailsafeAction; 3],
}

const fn row(
    name: &'static str,
    limit: fn(&ControlSettings) -> String,
    cause: Cause,
    modes: fn(Mode) -> bool,
    actions: [FailsafeAction; 3],
) -> FailsafeRow {
    FailsafeRow { name, limit, cause, modes, actions }
}

/// A fault of the motors or of measured values, or STOP by the remote control: no controller may use them.
const MOTORS: [FailsafeAction; 3] = [FailsafeAction::Damp; 3];
/// The state is known and commands arrive: the controller lands the robot. Damped legs in the air tilt it by 0.6 rad before the touchdown.
const STATE_KNOWN: [FailsafeAction; 3] =
    [FailsafeAction::Damp, FailsafeAction::LandThenDamp, FailsafeAction::LandThenDamp];
/// The state is not known: in the air the motors alone hold the stance. With a foot on the ground the legs are compressed, and the
/// motors' springs would throw the robot: damping (simulated landings: largest tilt 3.1 rad held, 0.5 rad damped).
const STATE_UNKNOWN: [FailsafeAction; 3] = [FailsafeAction::Damp, FailsafeAction::HoldThenDamp, FailsafeAction::Damp];
/// Commands leave seldom: in the air the motors alone hold the stance; a landing under the controller is finished.
const COMMANDS_SELDOM: [FailsafeAction; 3] =
    [FailsafeAction::Damp, FailsafeAction::HoldThenDamp, FailsafeAction::LandThenDamp];
/// The state is late: standing, the ramp of sitting down runs in the motors; a jump as without a state.
const STATE_LATE: [FailsafeAction; 3] = [FailsafeAction::Land, FailsafeAction::HoldThenDamp, FailsafeAction::Damp];
/// A cause that leaves time.
const SIT_DOWN: [FailsafeAction; 3] = [FailsafeAction::Land; 3];

/// The table, by precedence: of the rows that trip the strictest action counts, of equal ones the first row. A cause that makes
/// measured numbers invalid stands above the rows that compare them.
const TABLE: [FailsafeRow; 25] = [
    row(
        "stop buttons of the remote",
        |_| "pressed together (`[remote]`)".to_owned(),
        remote_stop,
        Mode::commanded,
        MOTORS,
    ),
    row(
        "session takes no events",
        |_| "ring of events full or abandoned".to_owned(),
        events_lost,
        Mode::commanded,
        STATE_KNOWN,
    ),
    // True in one tick only.
    row(
        "computer suspended",
        |s| format!("CLOCK_BOOTTIME ran ahead of CLOCK_MONOTONIC by more than {} ms", s.failsafe.suspended_ms),
        suspended,
        Mode::commanded,
        MOTORS,
    ),
    row(
        "link lost",
        |s| format!("newest state older than {} ms", s.failsafe.link_lost_ms),
        link_lost,
        Mode::commanded,
        STATE_UNKNOWN,
    ),
    row(
        "state age",
        |s| {
            let limits = &s.failsafe;
            format!("newest state older than {} ms (warning {} ms)", limits.state_age_ms, limits.state_age_warn_ms)
        },
        state_age,
        Mode::commanded,
        STATE_UNKNOWN,
    ),
    // True in one tick only, and a robot that boots may report numbers that are not finite.
    row("reboot", |_| "robot's clock went backwards".to_owned(), reboot, Mode::commanded, MOTORS),
    row(
        "robot's clock",
        |s| {
            format!(
                "off by more than {} ms against this computer's within 10 s, on hardware",
                s.consistency.clock_step_ms
            )
        },
        robot_clock,
        Mode::commanded,
        MOTORS,
    ),
    row(
        "joint not finite",
        |_| "angle or velocity of a joint is NaN or infinite".to_owned(),
        joints_not_finite,
        Mode::commanded,
        MOTORS,
    ),
    row(
        "body not finite",
        |s| {
            let most = s.consistency.accel_most_m_s2;
            format!(
                "a number of the inertial unit or a foot sensor is NaN or infinite; more than {MOST_IN_A_ROW} states in a row or \
                 {MOST_RECENT} in 1 s with a specific force beyond {most} m/s^2, on hardware"
            )
        },
        body_not_finite,
        Mode::commanded,
        STATE_UNKNOWN,
    ),
    row(
        "corrupt datagrams",
        |s| format!("more than {} wrong checksums in 5 s", s.failsafe.corrupt),
        corrupt,
        Mode::commanded,
        STATE_KNOWN,
    ),
    row("send error", |_| "the system refused to send".to_owned(), send_error, Mode::commanded, COMMANDS_SELDOM),
    row(
        "late tick",
        |s| format!("more than {} ms late, on hardware", s.failsafe.hardware_late_ms),
        late,
        Mode::commanded,
        STATE_KNOWN,
    ),
    row(
        "slow loop",
        |s| {
            let period_ms = s.failsafe.period_factor * CONTROL_PERIOD_S * 1e3;
            format!("period above {period_ms} ms in {} ticks in a row, on hardware", s.failsafe.period_ticks)
        },
        slow,
        Mode::commanded,
        COMMANDS_SELDOM,
    ),
    row(
        "motor temperature",
        |s| format!("{} degrees Celsius", s.failsafe.motor_c),
        motor_hot,
        Mode::commanded,
        STATE_KNOWN,
    ),
    // Above the single motor: no command of ours takes all of them out of servo mode.
    row(
        "another commander",
        |s| {
            let [loss, torque] = [100.0 * s.consistency.loss_share, s.consistency.torque_n_m];
            format!(
                "{loss} % of the states of 1 s lost, over DDS more than {FOREIGN_COMMANDS} commands of another program in 1 s, no motor in servo \
                 mode, or a torque {torque} N m off, on hardware"
            )
        },
        other_commander,
        Mode::energised,
        MOTORS,
    ),
    row("motor mode", |_| "a motor reports no servo mode".to_owned(), motor_mode, energised_or_faulted, MOTORS),
    row(
        "joint angle",
        |s| format!("{} rad beyond a limit", s.failsafe.joint_margin_rad),
        joint_position,
        Mode::energised,
        MOTORS,
    ),
    row(
        "joint velocity",
        |s| format!("{} times the no-load speed", s.failsafe.velocity_factor),
        joint_velocity,
        Mode::energised,
        MOTORS,
    ),
    row(
        "joint torque",
        |s| format!("{} times the largest torque", s.failsafe.torque_factor),
        joint_torque,
        Mode::energised,
        MOTORS,
    ),
    row(
        "tilt",
        |s| {
            let limits = &s.failsafe;
            format!("{} rad standing; {:.1} rad while sitting down", limits.stance_tilt_rad, limits.tilt_rad)
        },
        tilt,
        standing_or_ramping,
        MOTORS,
    ),
    row("sensors", |_| "see \"Sensors against each other\", on hardware".to_owned(), sensors, Mode::energised, MOTORS),
    row(
        "link delay",
        |s| {
            let limits = &s.failsafe;
            let [land, warn, hold] = [limits.delay_land_ms, limits.delay_warn_ms, limits.delay_hold_ms];
            format!("grown by more than {land} ms (warning {warn} ms, HOLD {hold} ms), on hardware")
        },
        delay,
        Mode::energised,
        STATE_LATE,
    ),
    row(
        "operator lost",
        |s| {
            let [silent_s, warn_s] =
                [s.failsafe.operator_silent_ms, s.failsafe.operator_warn_ms].map(|ms| f64::from(ms) * 1e-3);
            format!("no heartbeat for {silent_s} s (warning {warn_s} s)")
        },
        operator_silent,
        Mode::energised,
        SIT_DOWN,
    ),
    row(
        "guard",
        |s| format!("no answer for {} ms, or ended", s.failsafe.guard_silent_ms),
        guard_silent,
        Mode::energised,
        SIT_DOWN,
    ),
    row(
        "remote silent",
        |s| format!("no answer for {} s, where one is needed, on hardware", f64::from(s.remote.silent_ms) * 1e-3),
        remote_silent,
        Mode::energised,
        SIT_DOWN,
    ),
];

/// One row of the table in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailsafeDescription {
    /// Cause.
    pub cause: &'static str,
    /// Limit.
    pub limit: String,
    /// Modes in which the cause is watched.
    pub watched: String,
    /// Actions on the ground, in the air, in the landing.
    pub actions: [FailsafeAction; 3],
}

/// Describes the table for the documentation. Allocates: not for the tick.
pub fn descriptions(settings: &ControlSettings) -> Vec<FailsafeDescription> {
    let watched = |modes: fn(Mode) -> bool| {
        let all = |known: fn(Mode) -> bool| Mode::ALL.iter().all(|&mode| modes(mode) == known(mode));
        if all(Mode::commanded) {
            "commanded".to_owned()
        } else if all(Mode::energised) {
            "energised".to_owned()
        } else if all(energised_or_faulted) {
            "energised, FAULT".to_owned()
        } else {
            let names: Vec<&str> = Mode::ALL.iter().filter(|&&mode| modes(mode)).map(|mode| mode.name()).collect();
            names.join(", ")
        }
    };
    let describe = |row: &FailsafeRow| FailsafeDescription {
        cause: row.name,
        limit: (row.limit)(settings),
        watched: watched(row.modes),
        actions: row.actions,
    };
    TABLE.iter().map(describe).collect()
}

/// Also reported when another fault is latched: the motors' power may have been cut. While disarmed it is an arming check.
const fn energised_or_faulted(mode: Mode) -> bool {
    mode.energised() || matches!(mode, Mode::Fault)
}

/// Modes in which tilt is a fault. In JUMP, SETTLE and REVIEW it is a fall (`running_trial::FallWatch`).
const fn standing_or_ramping(mode: Mode) -> bool {
    matches!(mode, Mode::StandUp | Mode::Ready | Mode::Countdown | Mode::SitDown)
}

/// Returns the strictest action of the rows that trip; of equal ones the first row's.
pub fn check(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<Trip> {
    let trips = TABLE.iter().filter(|row| (row.modes)(inputs.mode)).filter_map(|row| {
        let fault = (row.cause)(inputs, settings)?;
        Some(Trip { action: row.actions[inputs.phase as usize], fault })
    });
    trips.reduce(|strictest, trip| if trip.action > strictest.action { trip } else { strictest })
}

/// Returns the reason to refuse the next trial (HOLD); a running trial finishes.
///
/// 1. Battery below its limit, or, on hardware, without a charge between 0 and 100 percent.
/// 2. A motor at its warm limit, or, on hardware, one that does not measure.
/// 3. A remote control that is needed and silent.
/// 4. Delay of the link, `delay_growth_ms`, above its limit.
pub fn trial_inhibit(state: &RobotState, delay_growth_ms: f64, settings: &ControlSettings) -> Option<TrialInhibit> {
    let limits = &settings.failsafe;
    let measured_percent = reported_charge(state);
    if settings.hardware && measured_percent.is_nan() {
        return Some(TrialInhibit::BatteryUnreported);
    }
    if measured_percent < limits.battery_percent {
        return Some(TrialInhibit::BatteryLow { measured_percent, allowed_percent: limits.battery_percent });
    }
    let allowed_c = settings.arming.motor_measured_c;
    let unmeasured =
        state.motor_temperature_c.iter().position(|measured_c| measured_c.is_nan() || *measured_c < allowed_c);
    if let Some(joint) = unmeasured.filter(|_| settings.hardware) {
        return Some(TrialInhibit::MotorUnmeasured {
            joint: joint as u8,
            measured_c: state.motor_temperature_c[joint],
            allowed_c,
        });
    }
    let (joint, measured_c) = hottest(state);
    if measured_c >= limits.motor_warm_c {
        return Some(TrialInhibit::MotorWarm { joint, measured_c, allowed_c: limits.motor_warm_c });
    }
    if settings.misses_remote(state) {
        return Some(TrialInhibit::RemoteSilent);
    }
    let delayed = settings.hardware && delay_growth_ms > limits.delay_hold_ms;
    delayed.then_some(TrialInhibit::LinkDelay { measured_ms: delay_growth_ms, allowed_ms: limits.delay_hold_ms })
}

/// Returns the warning that precedes a failsafe: the state before a silent operator's console.
pub fn warning(inputs: &FailsafeInputs, settings: &ControlSettings) -> Option<FailsafeWarning> {
    let limits = &settings.failsafe;
    if inputs.mode.commanded() && inputs.state_age_ms > limits.state_age_warn_ms {
        Some(FailsafeWarning::StateAge { age_ms: inputs.state_age_ms, allowed_ms: limits.state_age_warn_ms })
    } else if inputs.mode.commanded() && settings.hardware && inputs.delay_growth_ms > limits.delay_warn_ms {
        Some(FailsafeWarning::LinkDelay { measured_ms: inputs.delay_growth_ms, allowed_ms: limits.delay_warn_ms })
    } else if inputs.mode.energised() && settings.hardware && inputs.loss_share > limits.loss_warn_share {
        Some(FailsafeWarning::StatesLost { measured_share: inputs.loss_share, allowed_share: limits.loss_warn_share })
    } else if inputs.mode.energised() && inputs.operator_silent_ms > limits.operator_warn_ms {
        Some(FailsafeWarning::OperatorQuiet {
            silent_ms: inputs.operator_silent_ms,
            allowed_ms: limits.operator_warn_ms,
        })
    } else {
        None
    }
}
