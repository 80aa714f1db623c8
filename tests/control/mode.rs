//! The table of legal changes of mode.

use quadfrog::control::mode::{Trigger, next};
use quadfrog::telemetry::Mode;

use strum::VariantArray;

/// Each row: a mode, whether a fall damps in it, the target of a fault, and its other legal triggers with their targets.
#[test]
fn every_pair_of_mode_and_trigger_is_in_the_table() {
    use Mode::*;
    use Trigger as T;
    type Row = (Mode, bool, Option<Mode>, &'static [(Trigger, Mode)]);
    let table: [Row; 12] = [
        (Offline, false, None, &[(T::Contact, Offline), (T::Connected, Observe)]),
        (Observe, false, None, &[(T::Contact, Observe), (T::TakeControl, Disarmed)]),
        (Disarmed, false, Some(Fault), &[(T::Release, Observe), (T::Arm, StandUp)]),
        (StandUp, true, Some(Fault), &[(T::PoseReached, Ready), (T::SitDown, SitDown)]),
        (Ready, true, Some(Fault), &[(T::Approve, Countdown), (T::SitDown, SitDown)]),
        (Countdown, true, Some(Fault), &[(T::Cancel, Ready), (T::CountdownOver, Jump), (T::SitDown, SitDown)]),
        (Jump, true, Some(Fault), &[(T::Landed, Settle)]),
        (Settle, true, Some(Fault), &[(T::Settled, Review)]),
        (Review, true, Some(Fault), &[(T::EndReview, Ready), (T::SitDown, SitDown)]),
        (SitDown, true, Some(Fault), &[(T::PoseReached, Disarmed)]),
        (Damped, false, Some(Fault), &[(T::Acknowledge, Disarmed)]),
        (Fault, false, Some(Fault), &[(T::Acknowledge, Disarmed)]),
    ];
    for (mode, falls, fault, legal) in table {
        for &trigger in Trigger::VARIANTS {
            let expected = match trigger {
                T::Stop => Some(if mode == Fault { Fault } else { Damped }),
                T::Fault => fault,
                T::Fell => falls.then_some(Damped),
                _ => legal.iter().find(|(r, _)| *r == trigger).map(|(_, to)| *to),
            };
            assert_eq!(next(mode, trigger), expected, "{mode:?} {trigger:?}");
        }
    }
}
