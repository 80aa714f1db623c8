//! Mode of the machine, phase of a jump and cause of a change of mode.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

use super::{FallCause, Fault, TrialInhibit};

/// Mode of the machine; `control::mode::next` decides its changes. The order is the number in recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "UPPERCASE")]
pub enum Mode {
    /// No state from the robot; no joint command is sent.
    #[default]
    Offline,
    /// States arrive; nothing is sent.
    Observe,
    /// Damping is sent; the robot lies or is held.
    Disarmed,
    /// Timed ramp from the measured pose to the stance.
    #[strum(serialize = "STAND UP")]
    StandUp,
    /// Standing in impedance control, waiting for an approved trial.
    Ready,
    /// A trial is approved: standing still before the impulse.
    Countdown,
    /// Impulse and flight, until the touchdown after the last impulse; between jumps in a row also landing.
    Jump,
    /// Landing: standing until the robot is quiet.
    Settle,
    /// The trial is measured; the operator gives the verdict.
    Review,
    /// Timed ramp down to lying.
    #[strum(serialize = "SIT DOWN")]
    SitDown,
    /// Stopped: damping, until acknowledged.
    Damped,
    /// Stopped by a fault: damping, until acknowledged.
    Fault,
}

impl Mode {
    /// All values in order.
    pub const ALL: &'static [Mode] = Self::VARIANTS;

    /// Name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether the robot is sent commands in this mode, at least damping.
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

/// Phase of a jump. The order is the number in recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Phase {
    /// Feet on the ground, no force profile.
    #[default]
    Stance,
    /// The oscillator is between pi and 2 pi: the force profile acts.
    Impulse,
    /// No foot on the ground.
    Flight,
    /// After the first touchdown of a flight.
    Landing,
}

impl Phase {
    /// All values in order.
    pub const ALL: &'static [Phase] = Self::VARIANTS;

    /// Name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Cause of a change of mode.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the name of the field holds its unit")]
pub enum TransitionCause {
    /// The operator's STOP.
    Stop,
    /// A command of the session.
    Command,
    /// A ramp or a phase of the trial is over.
    StepFinished,
    /// The first state arrived.
    Connected,
    /// The robot fell.
    Fell(FallCause),
    /// A failsafe, the last gate, or a ramp that timed out.
    Fault(Fault),
    /// The robot waited for too long in READY or REVIEW.
    Idle { allowed_s: f64 },
    /// The countdown was cancelled: the robot was not ready for the jump.
    NotReady(TrialInhibit),
}

impl std::fmt::Display for TransitionCause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            TransitionCause::Stop => write!(f, "STOP"),
            TransitionCause::Command => write!(f, "request"),
            TransitionCause::StepFinished => write!(f, "done"),
            TransitionCause::Connected => write!(f, "the robot answers"),
            TransitionCause::Fell(cause) => write!(f, "fell: {cause}"),
            TransitionCause::Fault(fault) => write!(f, "{fault}"),
            TransitionCause::NotReady(inhibit) => write!(f, "not ready: {inhibit}"),
            TransitionCause::Idle { allowed_s } => write!(f, "idle: no approval or verdict for {allowed_s:.0} s"),
        }
    }
}
