//! Events from the control thread to the session, and its readiness for arming and trials.

use super::{
    ArmingCheckSet, ArmingFindings, Command, FailsafeWarning, FallCause, Fault, Mode, TransitionCause, TrialInhibit,
};

/// End of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TrialEnd {
    /// Feet down and quiet.
    Settled,
    /// Not quiet within the longest settling time.
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

/// An event of the control thread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// The mode changed.
    Mode {
        /// From this mode.
        from: Mode,
        /// To this one.
        to: Mode,
        /// Cause.
        cause: TransitionCause,
        /// Time, ns since the engine started.
        time_ns: u64,
    },
    /// A trial is over; its ticks can be measured.
    TrialEnded {
        /// Its number.
        trial: u32,
        /// Number of ticks of the trial, this one the last; a receiver with fewer has lost some.
        ticks: u64,
        /// Its end.
        end: TrialEnd,
    },
    /// A command was refused.
    Refused {
        /// The command.
        command: Command,
        /// The mode at the refusal.
        mode: Mode,
        /// Reason.
        because: CommandRefusal,
    },
}

/// Reason to refuse a command.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CommandRefusal {
    /// STOP is set.
    #[error("STOP is set; acknowledge it first")]
    Stopped,
    /// The mode forbids the command.
    #[error("not in this mode")]
    Mode,
    /// Arming checks fail.
    #[error("these arming checks fail: {0}")]
    Checks(ArmingCheckSet),
    /// The cause of the fault persists: an acknowledgement would change nothing.
    #[error("the cause persists: {0}")]
    Standing(Fault),
    /// The next trial is inhibited.
    #[error("{0}")]
    Inhibited(TrialInhibit),
    /// The mode changed between the key press and the command.
    #[error("the robot's mode changed after the key press; check the mode and press again")]
    Stale,
    /// The key press is too old.
    #[error("the key press is {age_s:.0} s old, limit {allowed_s:.0} s; check the robot and press again")]
    Expired {
        /// Its age, s.
        age_s: f64,
        /// Allowed, s.
        allowed_s: f64,
    },
    /// No heartbeat of the operator's screen.
    #[error("{}", if *.silent_ms == u32::MAX { "no heartbeat of the operator's screen yet; wait for the first".to_owned() } else { format!("no heartbeat of the operator's screen for {silent_ms} ms, limit {allowed_ms} ms; check its connection") })]
    OperatorSilent {
        /// Time since the last heartbeat, ms; `u32::MAX` before the first.
        silent_ms: u32,
        /// Allowed, ms.
        allowed_ms: u32,
    },
    /// The session is ending.
    #[error("the session is ending")]
    Leaving,
}

/// Conditions of the next arming and the next trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readiness {
    /// Arming findings of the last tick in DISARMED.
    pub findings: ArmingFindings,
    /// Reason to refuse the next trial.
    pub inhibit: Option<TrialInhibit>,
    /// The newest warning of the last second.
    pub warning: Option<FailsafeWarning>,
}
