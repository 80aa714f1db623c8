//! The legal changes of mode: one function, tested as a table. Table and reasons: `docs/safety.md`.

use crate::telemetry::Mode;

/// Cause that may change the mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::VariantArray)]
pub enum Trigger {
    /// The first state arrived.
    Connected,
    /// The operator asks for control of a robot that has not answered: it is called.
    Contact,
    /// The operator takes control.
    TakeControl,
    /// An observer has acknowledged its STOP: the robot is only observed again.
    Release,
    /// The operator arms the robot.
    Arm,
    /// A ramp has reached its pose.
    PoseReached,
    /// The operator, or a failsafe that lands the robot, sits it down.
    SitDown,
    /// An approved trial is to run.
    Approve,
    /// The countdown is cancelled.
    Cancel,
    /// The countdown is over.
    CountdownOver,
    /// The feet are down after the jump.
    Landed,
    /// The trial is over and can be measured.
    Settled,
    /// The verdict is given.
    EndReview,
    /// The robot fell.
    Fell,
    /// The operator's STOP.
    Stop,
    /// A failsafe or the last gate tripped, or a ramp timed out.
    Fault,
    /// The operator acknowledged DAMPED or FAULT.
    Acknowledge,
}

/// Returns the mode after `trigger` in `mode`; none if the change is not legal.
///
/// 1. STOP leads to DAMPED from every mode but FAULT, which damps already.
/// 2. A fault latches from every mode in which commands are sent.
/// 3. A robot that fell while energised is damped.
/// 4. DAMPED and FAULT are left by an acknowledgement only, to DISARMED only.
/// 5. Only `Arm` and `Approve` lead to more energy; both begin with a key press.
pub fn next(mode: Mode, trigger: Trigger) -> Option<Mode> {
    use Mode::*;
    match (mode, trigger) {
        (Fault, Trigger::Stop) => Some(Fault),
        (_, Trigger::Stop) => Some(Damped),
        (Offline | Observe, Trigger::Fault) => None,
        (_, Trigger::Fault) => Some(Fault),
        (mode, Trigger::Fell) if mode.energised() => Some(Damped),
        (Offline, Trigger::Connected) => Some(Observe),
        // Called, the robot answers; the first state may have arrived by itself meanwhile.
        (Offline | Observe, Trigger::Contact) => Some(mode),
        (Observe, Trigger::TakeControl) => Some(Disarmed),
        (Disarmed, Trigger::Release) => Some(Observe),
        (Disarmed, Trigger::Arm) => Some(StandUp),
        (StandUp, Trigger::PoseReached) => Some(Ready),
        (Ready, Trigger::Approve) => Some(Countdown),
        (Countdown, Trigger::Cancel) => Some(Ready),
        (Countdown, Trigger::CountdownOver) => Some(Jump),
        (Jump, Trigger::Landed) => Some(Settle),
        (Settle, Trigger::Settled) => Some(Review),
        (Review, Trigger::EndReview) => Some(Ready),
        (StandUp | Ready | Countdown | Review, Trigger::SitDown) => Some(SitDown),
        (SitDown, Trigger::PoseReached) => Some(Disarmed),
        (Damped | Fault, Trigger::Acknowledge) => Some(Disarmed),
        _ => None,
    }
}
