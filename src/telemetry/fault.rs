//! Faults, falls, warnings and trial inhibits: quantity, measured value and limit.

use crate::robot::joint_name;

/// Cause of a fall.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FallCause {
    /// A part other than the feet touched the ground (known in simulation only).
    #[error("a part other than the feet touched the ground")]
    BodyContact,
    /// Roll beyond the limit.
    #[error("roll {}", Exceeds { measured: *measured_rad, limit: *allowed_rad, unit: "rad", digits: 3 })]
    Roll {
        /// Measured, rad.
        measured_rad: f64,
        /// Allowed, rad.
        allowed_rad: f64,
    },
    /// Pitch beyond the limit.
    #[error("pitch {}", Exceeds { measured: *measured_rad, limit: *allowed_rad, unit: "rad", digits: 3 })]
    Pitch {
        /// Measured, rad.
        measured_rad: f64,
        /// Allowed, rad.
        allowed_rad: f64,
    },
}

/// Cause of a failsafe or of a fault of the last gate: quantity, joint, measured value, limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// A measured or commanded number is not finite.
    NotFinite {
        /// The quantity.
        what: &'static str,
    },
    /// A joint is beyond its hard limit.
    JointPosition {
        /// Index 0..12.
        joint: u8,
        /// Measured, rad.
        measured_rad: f64,
        /// Allowed, rad.
        allowed_rad: f64,
    },
    /// A joint exceeds its largest velocity.
    JointVelocity {
        /// Index 0..12.
        joint: u8,
        /// Measured, rad/s.
        measured_rad_s: f64,
        /// Allowed, rad/s.
        allowed_rad_s: f64,
    },
    /// A joint's torque, as the motor estimates it, exceeds its limit.
    JointTorque {
        /// Index 0..12.
        joint: u8,
        /// Measured, N m.
        measured_nm: f64,
        /// Allowed, N m.
        allowed_nm: f64,
    },
    /// The robot's state is too old.
    StateAge {
        /// Age, ms.
        age_ms: u32,
        /// Allowed, ms.
        allowed_ms: u32,
    },
    /// No state for longer than the limit of a lost link.
    LinkLost {
        /// Age of its newest state, ms.
        age_ms: u32,
        /// Allowed, ms.
        allowed_ms: u32,
    },
    /// Too many datagrams arrive corrupt.
    Corrupt {
        /// In the last five seconds.
        count: u32,
        /// Allowed.
        allowed: u32,
    },
    /// The robot's clock went backwards.
    Reboot,
    /// A motor left servo mode.
    MotorMode {
        /// Index 0..12.
        joint: u8,
    },
    /// A motor is too hot.
    MotorTemperature {
        /// Index 0..12.
        joint: u8,
        /// Measured, degrees Celsius.
        measured_c: f64,
        /// Allowed, degrees Celsius.
        allowed_c: f64,
    },
    /// Roll or pitch exceeds the limit of the mode.
    Tilt {
        /// Measured, rad.
        measured_rad: f64,
        /// Allowed, rad.
        allowed_rad: f64,
    },
    /// The control thread is too late.
    Late {
        /// Measured period or lateness, ms.
        measured_ms: f64,
        /// Allowed, ms.
        allowed_ms: f64,
    },
    /// Too many ticks in a row had too long a period.
    Slow {
        /// Ticks in a row.
        ticks: u32,
        /// Last period, ms.
        measured_ms: f64,
        /// Allowed, ms.
        allowed_ms: f64,
    },
    /// Standing up or sitting down did not reach its pose.
    PoseTimeout {
        /// Largest joint error left, rad.
        error_rad: f64,
    },
    /// No heartbeat of the operator's screen for too long.
    OperatorLost {
        /// Silence, ms.
        silent_ms: u32,
    },
    /// The session ended, or its terminal was lost, before the robot had landed.
    OperatorLeft,
    /// The command could not be sent.
    Send {
        /// `errno` of the system.
        errno: i32,
    },
    /// The ring of events is full or abandoned.
    EventsLost,
}

impl Fault {
    /// Whether the fault voids the operator's confirmations: the robot may have restarted, which ends low-level mode, or a person
    /// may have been at it. Such a fault is reported also when another one is latched.
    pub fn voids_confirmations(&self) -> bool {
        matches!(self, Fault::Reboot | Fault::LinkLost { .. } | Fault::MotorMode { .. })
    }
}

/// "1.004 rad exceeds 1.000 rad": at least `digits` decimals, more where both numbers would print alike.
struct Exceeds {
    measured: f64,
    limit: f64,
    unit: &'static str,
    digits: usize,
}

impl std::fmt::Display for Exceeds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Exceeds { measured, limit, unit, digits } = *self;
        let alike = |digits: &usize| format!("{:.digits$}", measured.abs()) == format!("{:.digits$}", limit.abs());
        let digits = (digits..9).find(|digits| !alike(digits)).unwrap_or(digits);
        write!(f, "{measured:.digits$} {unit} exceeds {limit:.digits$} {unit}")
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let joint = |index: u8| joint_name(index as usize);
        match *self {
            Fault::NotFinite { what } => write!(f, "{what} is not a finite number"),
            Fault::JointPosition { joint: j, measured_rad: measured, allowed_rad: limit } => {
                write!(f, "{} at {}", joint(j), Exceeds { measured, limit, unit: "rad", digits: 3 })
            }
            Fault::JointVelocity { joint: j, measured_rad_s: measured, allowed_rad_s: limit } => {
                write!(f, "{} at {}", joint(j), Exceeds { measured, limit, unit: "rad/s", digits: 1 })
            }
            Fault::JointTorque { joint: j, measured_nm: measured, allowed_nm: limit } => {
                write!(f, "{} at {}", joint(j), Exceeds { measured, limit, unit: "N m", digits: 1 })
            }
            Fault::StateAge { age_ms, allowed_ms } => {
                write!(f, "no state from the robot for {age_ms} ms, limit {allowed_ms} ms")
            }
            Fault::LinkLost { age_ms, allowed_ms } => {
                write!(f, "link to the robot lost: no state for {age_ms} ms, limit {allowed_ms} ms")
            }
            Fault::Corrupt { count, allowed } => {
                write!(f, "{count} states with a wrong checksum within 5 s, limit {allowed}")
            }
            Fault::Reboot => write!(f, "the robot restarted: its clock went backwards"),
            Fault::MotorMode { joint: j } => write!(f, "motor {} left servo mode", joint(j)),
            Fault::MotorTemperature { joint: j, measured_c, allowed_c } => {
                write!(f, "motor {} at {measured_c:.0} degrees Celsius, limit {allowed_c:.0}", joint(j))
            }
            Fault::Tilt { measured_rad: measured, allowed_rad: limit } => {
                write!(f, "tilt {}", Exceeds { measured, limit, unit: "rad", digits: 3 })
            }
            Fault::Late { measured_ms: measured, allowed_ms: limit } => {
                write!(f, "control thread late: {}", Exceeds { measured, limit, unit: "ms", digits: 1 })
            }
            Fault::Slow { ticks, measured_ms: measured, allowed_ms: limit } => {
                let exceeds = Exceeds { measured, limit, unit: "ms", digits: 1 };
                write!(f, "{ticks} control periods in a row too long: {exceeds}")
            }
            Fault::PoseTimeout { error_rad } => {
                write!(f, "pose not reached in time: joint error {error_rad:.3} rad")
            }
            Fault::OperatorLost { silent_ms } => {
                write!(f, "operator lost: no heartbeat of the operator's screen for {silent_ms} ms")
            }
            Fault::OperatorLeft => write!(f, "operator lost: the session ended before the robot had landed"),
            Fault::Send { errno } => write!(f, "the command could not be sent (error {errno})"),
            Fault::EventsLost => write!(f, "the session does not take events"),
        }
    }
}

/// Reason to refuse the next trial; a running one finishes.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TrialInhibit {
    /// The battery is low.
    #[error("battery at {measured_percent:.0} %, a jump needs {allowed_percent:.0} %; charge or change it")]
    BatteryLow {
        /// Measured, percent.
        measured_percent: f64,
        /// Allowed at least, percent.
        allowed_percent: f64,
    },
    /// A motor is warm.
    #[error("motor {} at {measured_c:.0} degrees Celsius, a jump needs less than {allowed_c:.0}; sit down and wait", joint_name(*.joint as usize))]
    MotorWarm {
        /// Index 0..12.
        joint: u8,
        /// Measured, degrees Celsius.
        measured_c: f64,
        /// Allowed below, degrees Celsius.
        allowed_c: f64,
    },
}

/// Warning before a failsafe trips.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FailsafeWarning {
    /// The robot's newest state is old.
    #[error("no state from the robot for {age_ms} ms, usually at most {allowed_ms} ms")]
    StateAge {
        /// Age, ms.
        age_ms: u32,
        /// Usual at most, ms.
        allowed_ms: u32,
    },
    /// The operator's screen sends no heartbeat.
    #[error("no heartbeat of the operator's screen for {silent_ms} ms, usually at most {allowed_ms} ms")]
    OperatorQuiet {
        /// Silence, ms.
        silent_ms: u32,
        /// Usual at most, ms.
        allowed_ms: u32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measured_value_and_limit_never_print_alike() {
        let fall = |measured_rad| FallCause::Pitch { measured_rad, allowed_rad: 1.0 }.to_string();
        assert_eq!(fall(1.004), "pitch 1.004 rad exceeds 1.000 rad");
        assert_eq!(fall(-1.000_04), "pitch -1.00004 rad exceeds 1.00000 rad");
    }
}
