//! Mode of the machine, phase of a jump and cause of a change of mode.

use super::{FallCause, Fault};

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

/// Why the mode changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TransitionCause {
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

impl std::fmt::Display for TransitionCause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            TransitionCause::Stop => write!(f, "STOP"),
            TransitionCause::Command => write!(f, "operator"),
            TransitionCause::Course => write!(f, "done"),
            TransitionCause::Connected => write!(f, "the robot answers"),
            TransitionCause::Fell(cause) => write!(f, "fell: {cause}"),
            TransitionCause::Fault(fault) => write!(f, "fault: {fault}"),
            TransitionCause::Idle { allowed_s } => {
                write!(f, "idle: nobody approved or judged anything for {allowed_s:.0} s")
            }
        }
    }
}
