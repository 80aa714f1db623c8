//! The control thread: once a millisecond, inputs from the channels, one tick, and what it gave to the channels.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::control::cycle::{Cycle, Inputs};
use crate::control::settings::{PERIOD_S, Settings};
use crate::realtime::channel::{ControlEnd, SHOWN_EVERY};
use crate::realtime::clock::Clock;
use crate::realtime::command::Command;
use crate::realtime::telemetry::{Counters, Event, Mode, Snapshot};
use crate::realtime::thread::pace;
use crate::robot::Robot;

/// The session is told the counters ten times a second.
const COUNTERS_EVERY: u64 = 100;

/// Runs until `closing` is set.
pub fn run<C: Clock>(settings: &Settings, mut end: ControlEnd, clock: &C, closing: &AtomicBool, robot: &mut dyn Robot) {
    let mut cycle = Cycle::new(settings);
    let mut counters = Counters::default();
    let mut beats = Beats::default();
    let mut events_lost = false;
    let start_ns = clock.now_ns();
    let period = Duration::from_secs_f64(PERIOD_S);
    let half_period_ns = period.as_nanos() as u64 / 2;
    let paced = pace(period, |instant| {
        let command = end.commands.pop().ok();
        if let Some(Command::Acknowledge { stops }) = command
            && matches!(cycle.mode(), Mode::Damped | Mode::Fault)
        {
            end.stop.acknowledge(stops);
        }
        let time_ns = start_ns + instant.planned_ns;
        let inputs = Inputs {
            time_ns,
            lateness_ns: instant.lateness_ns,
            stop: end.stop.is_set(),
            operator_silent_ms: beats.silent_ms(end.heartbeat.count(), time_ns),
            command,
            events_lost,
        };
        let tick = *cycle.tick(&inputs, clock, robot);

        counters.late_ticks += u64::from(instant.lateness_ns > half_period_ns);
        counters.worst_lateness_ns = counters.worst_lateness_ns.max(instant.lateness_ns);
        counters.state_age_ms = cycle.state_age_ms();
        counters.link = robot.link();
        counters.ticks_not_recorded += u64::from(end.ticks.push(tick).is_err());
        if tick.number.is_multiple_of(SHOWN_EVERY) {
            counters.ticks_not_shown += u64::from(end.shown.push(tick).is_err());
        }
        for event in cycle.events().iter() {
            counters.commands_refused += u64::from(matches!(event, Event::Refused { .. }));
            events_lost |= end.events.push(event).is_err();
        }
        end.snapshot.write(Snapshot { tick, counters });
        if tick.number.is_multiple_of(COUNTERS_EVERY) {
            end.counters.write(counters);
            end.readiness.write(cycle.readiness());
        }
        if closing.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    if let Err(error) = paced {
        // Without a clock there is no control: the panic hook tells the operator, the robot's own time-out damps.
        panic!("the control thread cannot read the monotonic clock: {error}");
    }
}

/// How long the screen has been silent. A screen that was never heard is as silent as one that is gone.
#[derive(Default)]
struct Beats {
    count: u64,
    heard_ns: u64,
}

impl Beats {
    fn silent_ms(&mut self, count: u64, now_ns: u64) -> u32 {
        if count != self.count {
            self.count = count;
            self.heard_ns = now_ns;
        }
        u32::try_from(now_ns.saturating_sub(self.heard_ns) / 1_000_000).unwrap_or(u32::MAX)
    }
}
