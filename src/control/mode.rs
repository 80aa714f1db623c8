//! The legal changes of mode: one function, tested as a table. Table and reasons: `research/operators.md` D.3.

use crate::telemetry::Mode;

/// What may change the mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// The robot answers.
    Heard,
    /// The operator takes control.
    TakeControl,
    /// The robot is let go of: it is only observed.
    Release,
    /// The operator energises.
    Arm,
    /// A ramp has reached its pose.
    PoseReached,
    /// The operator (or a watchdog that lands the robot) asks to sit down.
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
    /// A limit or a watchdog tripped.
    Fault,
    /// The operator has looked at the stopped robot.
    Acknowledge,
}

impl Trigger {
    /// All requests.
    pub const ALL: [Trigger; 16] = [
        Trigger::Heard,
        Trigger::TakeControl,
        Trigger::Release,
        Trigger::Arm,
        Trigger::PoseReached,
        Trigger::SitDown,
        Trigger::Approve,
        Trigger::Cancel,
        Trigger::CountdownOver,
        Trigger::Landed,
        Trigger::Settled,
        Trigger::EndReview,
        Trigger::Fell,
        Trigger::Stop,
        Trigger::Fault,
        Trigger::Acknowledge,
    ];
}

/// The mode after `request` in `mode`; none if that is not legal.
///
/// 1. STOP leads to damping from everywhere; only a fault, which damps already, keeps its own name.
/// 2. A fault latches from every mode in which something is sent.
/// 3. A robot that fell while energised is damped.
/// 4. Damped and faulted modes are left by acknowledgement alone, and to Disarmed alone.
/// 5. The only ways to more energy are Arm and Approve, and both begin with a key press.
pub fn next(mode: Mode, request: Trigger) -> Option<Mode> {
    use Mode::*;
    match (mode, request) {
        (Fault, Trigger::Stop) => Some(Fault),
        (_, Trigger::Stop) => Some(Damped),
        (Offline | Observe, Trigger::Fault) => None,
        (_, Trigger::Fault) => Some(Fault),
        (mode, Trigger::Fell) if mode.energised() => Some(Damped),
        (Offline, Trigger::Heard) => Some(Observe),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The whole machine as a table: each row a mode, each legal request with where it leads.
    #[test]
    fn every_pair_of_mode_and_request_is_in_the_table() {
        use Mode::*;
        use Trigger as R;
        let table: [(Mode, &[(Trigger, Mode)]); 12] = [
            (Offline, &[(R::Heard, Observe), (R::Stop, Damped)]),
            (Observe, &[(R::TakeControl, Disarmed), (R::Stop, Damped)]),
            (Disarmed, &[(R::Release, Observe), (R::Arm, StandUp), (R::Stop, Damped), (R::Fault, Fault)]),
            (
                StandUp,
                &[
                    (R::PoseReached, Ready),
                    (R::SitDown, SitDown),
                    (R::Fell, Damped),
                    (R::Stop, Damped),
                    (R::Fault, Fault),
                ],
            ),
            (
                Ready,
                &[
                    (R::Approve, Countdown),
                    (R::SitDown, SitDown),
                    (R::Fell, Damped),
                    (R::Stop, Damped),
                    (R::Fault, Fault),
                ],
            ),
            (
                Countdown,
                &[
                    (R::Cancel, Ready),
                    (R::CountdownOver, Jump),
                    (R::SitDown, SitDown),
                    (R::Fell, Damped),
                    (R::Stop, Damped),
                    (R::Fault, Fault),
                ],
            ),
            (Jump, &[(R::Landed, Settle), (R::Fell, Damped), (R::Stop, Damped), (R::Fault, Fault)]),
            (Settle, &[(R::Settled, Review), (R::Fell, Damped), (R::Stop, Damped), (R::Fault, Fault)]),
            (
                Review,
                &[
                    (R::EndReview, Ready),
                    (R::SitDown, SitDown),
                    (R::Fell, Damped),
                    (R::Stop, Damped),
                    (R::Fault, Fault),
                ],
            ),
            (SitDown, &[(R::PoseReached, Disarmed), (R::Fell, Damped), (R::Stop, Damped), (R::Fault, Fault)]),
            (Damped, &[(R::Acknowledge, Disarmed), (R::Stop, Damped), (R::Fault, Fault)]),
            (Fault, &[(R::Acknowledge, Disarmed), (R::Stop, Fault), (R::Fault, Fault)]),
        ];
        for (mode, legal) in table {
            for request in Trigger::ALL {
                let expected = legal.iter().find(|(r, _)| *r == request).map(|(_, to)| *to);
                assert_eq!(next(mode, request), expected, "{mode:?} {request:?}");
            }
        }
    }
}
