//! The clock of a computer that a time service slews, against the robot's.

use std::cell::Cell;

use crate::bench::shipped;
use crate::robots::LinkedRobot;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::realtime::channel::channels;
use quadfrog::realtime::clock::Clock;
use quadfrog::realtime::thread::TickStart;
use quadfrog::telemetry::{Command, Event, Mode, Permit};
use quadfrog::trial::Backend;

/// A computer whose ticks follow a slewed clock; the other clock is set by the test.
#[derive(Default)]
struct SlewedComputer {
    unslewed_ns: Cell<u64>,
}

impl Clock for SlewedComputer {
    fn now_ns(&self) -> u64 {
        0
    }
    fn unslewed_ns(&self) -> Option<u64> {
        Some(self.unslewed_ns.get())
    }
}

/// Regression: where a time service slewed the computer's clock by 500 ppm, the delay of a sound link seemed to grow by 0.4 ms each second:
/// no trial was approved after 12 s, and the robot sat down after 25 s.
#[test]
fn a_slewed_clock_is_no_growth_of_the_links_delay() {
    for tick_ns in [1_000_500, 999_500] {
        let (config, description, mut settings) = shipped(Backend::Hardware);
        settings.idle_s = 0.0;
        let mut robot = LinkedRobot::lying(&description, &config.simulator);
        let computer = SlewedComputer::default();
        let (control, mut session, console, _ticks) = channels();
        let mut body = ControlLoop::new(&settings, control);
        let (mut count, mut mode_changes) = (0, 0);
        let mut warnings = Vec::new();
        let mut ticks = |body: &mut ControlLoop, most: u64, command: Option<fn(Permit) -> Command>| {
            let permit = Permit { mode_changes, given_ns: count * tick_ns };
            command.into_iter().for_each(|command| session.commands.push(command(permit)).unwrap());
            for _ in 0..most {
                console.heartbeat.beat();
                count += 1;
                computer.unslewed_ns.set(count * 1_000_000);
                body.tick(TickStart { planned_ns: count * tick_ns, lateness_ns: 0 }, &computer, &mut robot);
                warnings.extend(session.readiness.read().warning);
                while let Ok(event) = session.events.pop() {
                    mode_changes += u64::from(matches!(event, Event::Mode { .. }));
                }
            }
        };
        ticks(&mut body, 10, None);
        ticks(&mut body, 1500, Some(|_| Command::TakeControl));
        ticks(&mut body, 3000, Some(Command::Arm));
        assert_eq!(body.mode(), Mode::Ready);
        ticks(&mut body, 60_000, None);
        assert_eq!(body.mode(), Mode::Ready);
        assert!(warnings.is_empty(), "{:?}", warnings.first());
    }
}
