//! Events from the control thread to the session, and the state of its arming checks.

use super::{
    ArmingCheckSet, ArmingFindings, Command, FailsafeWarning, FallCause, Fault, Mode, TransitionCause, TrialInhibit,
};

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
        cause: TransitionCause,
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
        because: CommandRefusal,
    },
}

/// Why the control thread does not carry out a command.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CommandRefusal {
    /// The present mode forbids it.
    #[error("not in this mode")]
    Mode,
    /// Checks of the pre-arm list fail.
    #[error("these checks fail: {0}")]
    Checks(ArmingCheckSet),
    /// What tripped is still so: acknowledging it would change nothing.
    #[error("it is still so: {0}")]
    Standing(Fault),
    /// A trial must not begin.
    #[error("{0}")]
    Inhibited(TrialInhibit),
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

/// What the control thread thinks of the next arming and the next trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readiness {
    /// How its checks of the pre-arm list stood when the robot was disarmed last.
    pub findings: ArmingFindings,
    /// What forbids the next trial.
    pub hold: Option<TrialInhibit>,
    /// The newest caution of the last second.
    pub caution: Option<FailsafeWarning>,
}
