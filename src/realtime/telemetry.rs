//! What is known: the modes, one tick's record, the newest snapshot, events and faults. Everything here is `Copy`.

use nalgebra::{UnitQuaternion, Vector3};

use crate::realtime::command::Command;
use crate::realtime::pre_arm::{CheckSet, Findings};
use crate::robot::{JointCommand, Joints, LEGS, LinkStatus, PerLeg, RobotState, joint_name};

/// What the machine is doing as a whole. One function, `control::mode::next`, owns the changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Mode {
    /// No state from the robot; nothing is sent.
    Offline,
    /// The robot is heard; nothing is sent.
    Observe,
    /// Damping is sent; the robot lies or is held.
    Disarmed,
    /// Timed ramp from the measured pose to the stance.
    StandUp,
    /// Standing in impedance control, waiting for an approved trial.
    Ready,
    /// A trial is approved: standing still before the impulse.
    Countdown,
    /// Impulse, flight and landing.
    Jump,
    /// Feet down, waiting until the robot is quiet.
    Settle,
    /// The trial is measured; the operator judges.
    Review,
    /// Timed ramp down to lying.
    SitDown,
    /// Stopped: damping, until acknowledged.
    Damped,
    /// Stopped by a fault: damping, until acknowledged.
    Fault,
}

impl Mode {
    /// All modes.
    pub const ALL: [Mode; 12] = [
        Mode::Offline,
        Mode::Observe,
        Mode::Disarmed,
        Mode::StandUp,
        Mode::Ready,
        Mode::Countdown,
        Mode::Jump,
        Mode::Settle,
        Mode::Review,
        Mode::SitDown,
        Mode::Damped,
        Mode::Fault,
    ];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            Mode::Offline => "OFFLINE",
            Mode::Observe => "OBSERVE",
            Mode::Disarmed => "DISARMED",
            Mode::StandUp => "STAND UP",
            Mode::Ready => "READY",
            Mode::Countdown => "COUNTDOWN",
            Mode::Jump => "JUMP",
            Mode::Settle => "SETTLE",
            Mode::Review => "REVIEW",
            Mode::SitDown => "SIT DOWN",
            Mode::Damped => "DAMPED",
            Mode::Fault => "FAULT",
        }
    }

    /// The mode of that name.
    pub fn from_name(name: &str) -> Option<Mode> {
        Mode::ALL.into_iter().find(|mode| mode.name() == name)
    }

    /// Whether the robot is sent commands in this mode, be it damping alone.
    pub const fn commanded(self) -> bool {
        !matches!(self, Mode::Offline | Mode::Observe)
    }

    /// Whether motors do more than damp in this mode.
    pub const fn energised(self) -> bool {
        matches!(
            self,
            Mode::StandUp | Mode::Ready | Mode::Countdown | Mode::Jump | Mode::Settle | Mode::Review | Mode::SitDown
        )
    }
}

/// Where in a jump the robot is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// On its feet, no profile.
    Stance,
    /// The oscillator is between pi and 2 pi: the force profile acts.
    Impulse,
    /// No foot on the ground.
    Flight,
    /// After the first touchdown of a flight, or after an impulse that did not leave the ground.
    Landing,
}

impl Phase {
    /// All phases.
    pub const ALL: [Phase; 4] = [Phase::Stance, Phase::Impulse, Phase::Flight, Phase::Landing];

    /// The word that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            Phase::Stance => "stance",
            Phase::Impulse => "impulse",
            Phase::Flight => "flight",
            Phase::Landing => "landing",
        }
    }

    /// The phase of that name.
    pub fn from_name(name: &str) -> Option<Phase> {
        Phase::ALL.into_iter().find(|phase| phase.name() == name)
    }
}

/// What the controller believes about the base and the feet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Position of the trunk's origin, world, m.
    pub position_world: Vector3<f64>,
    /// Velocity of the trunk's origin, world, m/s.
    pub velocity_world: Vector3<f64>,
    /// Rotation that takes body axes to world axes.
    pub orientation_world: UnitQuaternion<f64>,
    /// Angular velocity, body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Roll, pitch and yaw (z-y-x Euler angles), rad; yaw is unwrapped: full turns count.
    pub roll_pitch_yaw: Vector3<f64>,
    /// Whether each foot is on the ground.
    pub contact: PerLeg<bool>,
    /// Feet in their leg frames, m.
    pub foot_position_leg: PerLeg<Vector3<f64>>,
}

impl Default for Estimate {
    fn default() -> Self {
        Estimate {
            position_world: Vector3::zeros(),
            velocity_world: Vector3::zeros(),
            orientation_world: UnitQuaternion::identity(),
            angular_velocity_body: Vector3::zeros(),
            roll_pitch_yaw: Vector3::zeros(),
            contact: [false; LEGS],
            foot_position_leg: [Vector3::zeros(); LEGS],
        }
    }
}

/// How long the stages of a tick took, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StageTimes {
    /// From the planned start of the tick to its real start.
    pub lateness_ns: u32,
    /// Reading the robot.
    pub read_ns: u32,
    /// Estimating, watching, deciding and limiting.
    pub decide_ns: u32,
    /// Writing the command (for the simulator: its physics).
    pub write_ns: u32,
}

/// Everything that was known and done in one control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Count of ticks since the engine started.
    pub number: u64,
    /// Time since the engine started, ns.
    pub time_ns: u64,
    /// Mode in which the tick ended.
    pub mode: Mode,
    /// Phase of the jump.
    pub phase: Phase,
    /// Number of the trial that runs; none between trials.
    pub trial: Option<u32>,
    /// Time since the oscillator entered pi, s; negative before; zero between trials.
    pub trial_time_s: f64,
    /// Phase of the oscillator, rad.
    pub theta_rad: f64,
    /// What the robot reported.
    pub state: RobotState,
    /// What the controller made of it.
    pub estimate: Estimate,
    /// Joint torques that the controller asked for, before the limits, N m.
    pub torque_demanded: Joints,
    /// The command as sent, after the limits.
    pub command: JointCommand,
    /// Bit `i` set: the last gate changed the command of joint `i`.
    pub limited: u16,
    /// Time per stage.
    pub stages: StageTimes,
}

impl Default for Tick {
    fn default() -> Self {
        Tick {
            number: 0,
            time_ns: 0,
            mode: Mode::Offline,
            phase: Phase::Stance,
            trial: None,
            trial_time_s: 0.0,
            theta_rad: 0.0,
            state: RobotState::default(),
            estimate: Estimate::default(),
            torque_demanded: Joints::default(),
            command: JointCommand::default(),
            limited: 0,
            stages: StageTimes::default(),
        }
    }
}

/// What is counted since the engine started, so that no loss passes silently.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Ticks that started more than half a period late.
    pub late_ticks: u64,
    /// Largest lateness of a tick, ns.
    pub worst_lateness_ns: u64,
    /// Ticks that the recorder's ring could not take.
    pub ticks_not_recorded: u64,
    /// Ticks that the screen's ring could not take.
    pub ticks_not_shown: u64,
    /// Commands refused because they were not legal.
    pub commands_refused: u64,
    /// Age of the robot's newest valid state, ms.
    pub state_age_ms: u32,
    /// The link to the robot; none for the simulator.
    pub link: Option<LinkStatus>,
}

/// The newest tick and the counters: what a screen draws from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Snapshot {
    /// The newest tick.
    pub tick: Tick,
    /// What was counted so far.
    pub counters: Counters,
}

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

/// How a trial ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TrialEnd {
    /// Feet down and quiet.
    Settled,
    /// The cap ran out before it was quiet.
    NotQuiet,
    /// It fell.
    Fell(FallCause),
    /// STOP was pressed.
    Stopped,
    /// The countdown was cancelled.
    Cancelled,
    /// A fault ended it.
    Fault(Fault),
}

/// Why the mode changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cause {
    /// The operator's STOP.
    Stop,
    /// A command of the session.
    Command,
    /// The course of things: a ramp or a phase is over.
    Course,
    /// The robot began to answer.
    Connected,
    /// The robot fell.
    Fell(FallCause),
    /// A limit or a watchdog.
    Fault(Fault),
    /// The robot stood waiting for too long.
    Idle {
        /// Allowed, s.
        allowed_s: f64,
    },
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Cause::Stop => write!(f, "STOP"),
            Cause::Command => write!(f, "operator"),
            Cause::Course => write!(f, "done"),
            Cause::Connected => write!(f, "the robot answers"),
            Cause::Fell(cause) => write!(f, "fell: {cause}"),
            Cause::Fault(fault) => write!(f, "fault: {fault}"),
            Cause::Idle { allowed_s } => write!(f, "idle: nobody approved or judged anything for {allowed_s:.0} s"),
        }
    }
}

/// What the control thread tells the session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// The mode changed.
    Mode {
        /// From this mode.
        from: Mode,
        /// To this one.
        to: Mode,
        /// Why.
        cause: Cause,
        /// When, ns since the engine started.
        time_ns: u64,
    },
    /// A trial is over; its ticks can be measured.
    TrialEnded {
        /// Its number.
        trial: u32,
        /// Ticks that carry it, this one the last: who has fewer does not know the whole trial.
        ticks: u64,
        /// How it ended.
        end: TrialEnd,
    },
    /// A command was not carried out.
    Refused {
        /// The command.
        command: Command,
        /// The mode at that moment.
        mode: Mode,
        /// Why.
        because: Objection,
    },
}

/// Why the control thread does not carry out a command.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Objection {
    /// The present mode forbids it.
    #[error("not in this mode")]
    Mode,
    /// Checks of the pre-arm list fail.
    #[error("these checks fail: {0}")]
    Checks(CheckSet),
    /// What tripped is still so: acknowledging it would change nothing.
    #[error("it is still so: {0}")]
    Standing(Fault),
    /// A trial must not begin.
    #[error("{0}")]
    Hold(Hold),
    /// The mode changed between the key press and the command.
    #[error("the robot's mode changed after the key press; look again, and press again")]
    Stale,
    /// The key press is too old.
    #[error("the key press is {age_s:.0} s old, allowed {allowed_s:.0}; look again, and press again")]
    Expired {
        /// Its age, s.
        age_s: f64,
        /// Allowed, s.
        allowed_s: f64,
    },
    /// Nobody is known to watch: nothing begins to move.
    #[error("{}", if *.silent_ms == u32::MAX { "the operator's screen was never heard; wait until it is".to_owned() } else { format!("the operator's screen has been silent for {silent_ms} ms, allowed {allowed_ms}; look at its connection") })]
    OperatorSilent {
        /// Silence, ms; `u32::MAX` for a screen that was never heard.
        silent_ms: u32,
        /// Allowed, ms.
        allowed_ms: u32,
    },
    /// The session is ending.
    #[error("the session is ending")]
    Leaving,
}

/// What lets the running trial finish but forbids the next one.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Hold {
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
pub enum Caution {
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

/// What the control thread thinks of the next arming and the next trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readiness {
    /// How its checks of the pre-arm list stood when the robot was disarmed last.
    pub findings: Findings,
    /// What forbids the next trial.
    pub hold: Option<Hold>,
    /// The newest caution of the last second.
    pub caution: Option<Caution>,
}
