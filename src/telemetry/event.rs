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
    /// The control thread refused it before its countdown.
    Refused(CommandRefusal),
    /// A fault ended it.
    Fault(Fault),
    /// The countdown was cancelled: the robot was not ready for the jump.
    NotReady(TrialInhibit),
    /// Jumps in a row ended before the last one: something inhibits jumps.
    Held(TrialInhibit),
    /// Jumps in a row ended before the last one: the operator sits the robot down.
    SatDown,
}

impl From<CommandRefusal> for TrialEnd {
    /// The end of a trial that the control thread refused.
    fn from(because: CommandRefusal) -> TrialEnd {
        match because {
            CommandRefusal::Inhibited(inhibit) => TrialEnd::NotReady(inhibit),
            refusal => TrialEnd::Refused(refusal),
        }
    }
}

/// An event of the control thread.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the fields are named for their types; `time_ns` counts from the start of the engine")]
pub enum Event {
    /// The mode changed.
    Mode { from: Mode, to: Mode, cause: TransitionCause, time_ns: u64 },
    /// A trial is over; its ticks can be measured. This tick is the last of `ticks`: a receiver with fewer has lost some.
    TrialEnded { trial: u32, ticks: u64, end: TrialEnd },
    /// A simulated robot that lay fallen, or with unfolded legs, was laid on its belly at the origin, to be armed.
    SetUpright,
    /// A command was refused in this mode.
    Refused { command: Command, mode: Mode, because: CommandRefusal },
}

/// Reason to refuse a command. After a semicolon its message has the remedy of that moment.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant, the name of a field holds its unit")]
pub enum CommandRefusal {
    #[error("STOP is set; acknowledge it first")]
    Stopped,
    #[error("not in this mode")]
    Mode,
    #[error("these arming checks fail: {0}")]
    Checks(ArmingCheckSet),
    #[error("the cause persists: {0}")]
    FaultPersists(Fault),
    #[error("{0}")]
    Inhibited(TrialInhibit),
    #[error("the robot's mode changed after the key press; check the mode and press again")]
    Stale,
    #[error("the key press is {age_s:.1} s old, limit {allowed_s:.1} s; check the robot and press again")]
    Expired { age_s: f64, allowed_s: f64 },
    /// `silent_ms` is `u32::MAX` before the first heartbeat.
    #[error("{}", if *.silent_ms == u32::MAX { "no heartbeat of the operator's console yet; wait for the first".to_owned() } else { format!("no heartbeat of the operator's console for {silent_ms} ms, limit {allowed_ms} ms; check its connection") })]
    OperatorSilent { silent_ms: u32, allowed_ms: u32 },
    #[error("the session is ending")]
    Leaving,
    #[error("sit down or cancel was pressed after it; check the robot and press again")]
    Lowered,
    #[error("this key press was answered before; check the robot and press again")]
    Answered,
}

impl CommandRefusal {
    /// Returns its message without the remedy.
    pub fn without_remedy(&self) -> String {
        let message = self.to_string();
        message.split_once("; ").map_or(message.clone(), |(reason, _)| reason.to_owned())
    }
}

/// Conditions of the next arming and the next trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readiness {
    /// Arming findings of the last tick in DISARMED.
    pub findings: ArmingFindings,
    /// Reason to refuse the next trial.
    pub inhibit: Option<TrialInhibit>,
    /// In READY: condition of a jump that does not hold at present, on hardware.
    pub unready: Option<TrialInhibit>,
    /// The newest warning of the last second.
    pub warning: Option<FailsafeWarning>,
}
