//! Faults, falls, warnings and what forbids the next trial: quantity, measured value and limit.

use crate::robot::joint_name;

/// Why the robot counts as fallen.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FallCause {
    /// A part other than the feet touched the ground (known in simulation only).
    #[error("a part other than the feet touched the ground")]
    BodyContact,
    /// Roll beyond the limit.
    #[error("roll {measured_rad:.2} rad, allowed {allowed_rad:.2}")]
    Roll {
        /// Measured, rad.
        measured_rad: f64,
        /// Allowed, rad.
        allowed_rad: f64,
    },
    /// Pitch beyond the limit.
    #[error("pitch {measured_rad:.2} rad, allowed {allowed_rad:.2}")]
    Pitch {
        /// Measured, rad.
        measured_rad: f64,
        /// Allowed, rad.
        allowed_rad: f64,
    },
}

/// A limit or a watchdog that tripped: what, where, measured and allowed.
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
    /// A joint is faster than it may be.
    JointVelocity {
        /// Index 0..12.
        joint: u8,
        /// Measured, rad/s.
        measured_rad_s: f64,
        /// Allowed, rad/s.
        allowed_rad_s: f64,
    },
    /// A joint's torque, as the motor estimates it, is larger than it may be.
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
    /// The robot has been silent for so long that its link counts as lost.
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
    /// The base is tilted too far for the mode.
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
    /// Too many ticks in a row came too long after the one before.
    Slow {
        /// Ticks in a row.
        ticks: u32,
        /// Time between the last two, ms.
        measured_ms: f64,
        /// Allowed, ms.
        allowed_ms: f64,
    },
    /// Standing up or sitting down did not reach its pose.
    PoseTimeout {
        /// Largest joint error left, rad.
        error_rad: f64,
    },
    /// The operator's screen has been silent for too long.
    OperatorLost {
        /// Silence, ms.
        silent_ms: u32,
    },
    /// The operator ended the session, or its terminal is gone, before the robot had landed.
    OperatorLeft,
    /// The command could not be sent.
    Send {
        /// The system's error number.
        errno: i32,
    },
    /// The ring of events is full: the session does not listen.
    EventsLost,
}

impl Fault {
    /// Whether the robot may have restarted, or somebody been at it: what the operator gave their word on before is then worth
    /// nothing, the low-level mode first of all. Such a fault is told also where another was told already.
    pub fn voids_the_word(&self) -> bool {
        matches!(self, Fault::Reboot | Fault::LinkLost { .. } | Fault::MotorMode { .. })
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let joint = |index: u8| joint_name(index as usize);
        match *self {
            Fault::NotFinite { what } => write!(f, "{what} is not a finite number"),
            Fault::JointPosition { joint: j, measured_rad, allowed_rad } => {
                write!(f, "{} at {measured_rad:.3} rad, allowed {allowed_rad:.3}", joint(j))
            }
            Fault::JointVelocity { joint: j, measured_rad_s, allowed_rad_s } => {
                write!(f, "{} at {measured_rad_s:.1} rad/s, allowed {allowed_rad_s:.1}", joint(j))
            }
            Fault::JointTorque { joint: j, measured_nm, allowed_nm } => {
                write!(f, "{} at {measured_nm:.1} N m, allowed {allowed_nm:.1}", joint(j))
            }
            Fault::StateAge { age_ms, allowed_ms } => {
                write!(f, "no state from the robot for {age_ms} ms, allowed {allowed_ms}")
            }
            Fault::LinkLost { age_ms, allowed_ms } => {
                write!(f, "the link to the robot is lost: no state for {age_ms} ms, allowed {allowed_ms}")
            }
            Fault::Corrupt { count, allowed } => {
                write!(f, "{count} states arrived corrupt within 5 s, allowed {allowed}")
            }
            Fault::Reboot => write!(f, "the robot's clock went backwards: it restarted"),
            Fault::MotorMode { joint: j } => write!(f, "motor {} left servo mode", joint(j)),
            Fault::MotorTemperature { joint: j, measured_c, allowed_c } => {
                write!(f, "motor {} at {measured_c:.0} degrees Celsius, allowed {allowed_c:.0}", joint(j))
            }
            Fault::Tilt { measured_rad, allowed_rad } => {
                write!(f, "tilted by {measured_rad:.2} rad, allowed {allowed_rad:.2}")
            }
            Fault::Late { measured_ms, allowed_ms } => {
                write!(f, "control thread {measured_ms:.1} ms late, allowed {allowed_ms:.1}")
            }
            Fault::Slow { ticks, measured_ms, allowed_ms } => {
                write!(f, "{ticks} control periods in a row of {measured_ms:.1} ms, allowed {allowed_ms:.1}")
            }
            Fault::PoseTimeout { error_rad } => write!(f, "the pose was not reached: {error_rad:.2} rad missing"),
            Fault::OperatorLost { silent_ms } => {
                write!(f, "operator lost: the operator's screen was silent for {silent_ms} ms")
            }
            Fault::OperatorLeft => write!(f, "operator lost: the session ended before the robot had landed"),
            Fault::Send { errno } => write!(f, "the command could not be sent (error {errno})"),
            Fault::EventsLost => write!(f, "the session does not take events"),
        }
    }
}

/// What lets the running trial finish but forbids the next one.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TrialInhibit {
    /// The battery is low.
    #[error("battery at {measured_percent:.0} %, at least {allowed_percent:.0} % for a jump; charge or change it")]
    BatteryLow {
        /// Measured, percent.
        measured_percent: f64,
        /// Allowed at least, percent.
        allowed_percent: f64,
    },
    /// A motor is warm.
    #[error("motor {} at {measured_c:.0} degrees Celsius, allowed below {allowed_c:.0} for a jump; sit down and wait", joint_name(*.joint as usize))]
    MotorWarm {
        /// Index 0..12.
        joint: u8,
        /// Measured, degrees Celsius.
        measured_c: f64,
        /// Allowed below, degrees Celsius.
        allowed_c: f64,
    },
}

/// What is worth a word before a watchdog trips.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FailsafeWarning {
    /// The robot's state is getting old.
    #[error("no state from the robot for {age_ms} ms, usual are {allowed_ms}")]
    StateAge {
        /// Age, ms.
        age_ms: u32,
        /// Usual at most, ms.
        allowed_ms: u32,
    },
    /// The operator's screen is quiet.
    #[error("the operator's screen has been silent for {silent_ms} ms, usual are {allowed_ms}")]
    OperatorQuiet {
        /// Silence, ms.
        silent_ms: u32,
        /// Usual at most, ms.
        allowed_ms: u32,
    },
}
