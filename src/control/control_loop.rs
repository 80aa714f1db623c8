//! The control thread's body: inputs from the channels, one tick, and what it gave to the channels. Called once a millisecond
//! by the engine's thread, and by a test or a bench as they like; nothing here allocates, locks or waits.

use super::cycle::{Cycle, Inputs};
use super::settings::{ControlSettings, PERIOD_S};
use crate::realtime::channel::{ControlEnd, SHOWN_EVERY};
use crate::realtime::clock::Clock;
use crate::realtime::thread::Instant;
use crate::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use crate::telemetry::{Command, Counters, Event, Mode, Snapshot, Tick};

/// The session is told the counters, and what speaks against arming, ten times a second and with every event.
const COUNTERS_EVERY: u64 = 100;

/// A control cycle at its ends of the channels.
pub struct ControlLoop {
    cycle: Cycle,
    end: ControlEnd,
    counters: Counters,
    beats: Beats,
    events_lost: bool,
    /// Time of the clock at which the pace began, ns; known from the first tick on.
    start_ns: Option<u64>,
}

impl ControlLoop {
    /// A body that has not ticked yet.
    pub fn new(settings: &ControlSettings, end: ControlEnd) -> ControlLoop {
        ControlLoop {
            cycle: Cycle::new(settings),
            end,
            counters: Counters::default(),
            beats: Beats::default(),
            events_lost: false,
            start_ns: None,
        }
    }

    /// One tick.
    pub fn tick<C: Clock, R: Robot + ?Sized>(&mut self, instant: Instant, clock: &C, robot: &mut R) -> &Tick {
        let ControlLoop { cycle, end, counters, start_ns, .. } = self;
        // A session that broke down takes no more events, though there is room for some.
        self.events_lost |= end.events.is_abandoned();
        let command = end.commands.pop().ok();
        if let Some(Command::Acknowledge { stops }) = command
            && matches!(cycle.mode(), Mode::Damped | Mode::Fault)
        {
            end.stop.acknowledge(stops);
        }
        // The instants count from the pace's start, the clock from its own.
        let passed_ns = instant.planned_ns + instant.lateness_ns;
        let time_ns = *start_ns.get_or_insert_with(|| clock.now_ns().saturating_sub(passed_ns)) + instant.planned_ns;
        let inputs = Inputs {
            time_ns,
            lateness_ns: instant.lateness_ns,
            stop: end.stop.is_set(),
            operator_silent_ms: self.beats.silent_ms(end.heartbeat.count(), time_ns),
            command,
            events_lost: self.events_lost,
        };
        let tick = *cycle.tick(&inputs, clock, robot);

        counters.late_ticks += u64::from(instant.lateness_ns as f64 > PERIOD_S * 1e9 / 2.0);
        counters.worst_lateness_ns = counters.worst_lateness_ns.max(instant.lateness_ns);
        counters.state_age_ms = cycle.state_age_ms();
        counters.link = robot.link();
        counters.ticks_not_recorded += u64::from(end.ticks.push(tick).is_err());
        if tick.number.is_multiple_of(SHOWN_EVERY) {
            counters.ticks_not_shown += u64::from(end.shown.push(tick).is_err());
        }
        let told = cycle.events().iter().next().is_some();
        if told || tick.number.is_multiple_of(COUNTERS_EVERY) {
            // Before the events: who hears that the robot is disarmed also knows what speaks against arming it.
            end.counters.write(*counters);
            end.readiness.write(cycle.readiness());
        }
        for event in cycle.events().iter() {
            counters.commands_refused += u64::from(matches!(event, Event::Refused { .. }));
            self.events_lost |= end.events.push(event).is_err();
        }
        end.snapshot.write(Snapshot { tick, counters: *counters });
        cycle.last()
    }

    /// Fetches the memory to which the next tick will be written, while nobody waits for it: the rings are long, so their next
    /// place was last touched seconds ago. To be called between ticks; one that it is not called for is right all the same.
    pub fn prepare(&mut self) {
        fetch_next(&mut self.end.ticks);
        if (self.cycle.last().number + 1).is_multiple_of(SHOWN_EVERY) {
            fetch_next(&mut self.end.shown);
        }
    }

    /// Does the cycle's usual course shortly before the next tick, on a copy and with a robot that is still as it was seen last:
    /// code and data are then in the processor's caches, from which a millisecond of other work drives them. Nothing comes of
    /// it. Of a thousand ticks the longest take a third less time with it (on the loopback: `quadfrog bench loop --with-link`,
    /// and `--unrehearsed`). Should it panic, the tick would have, and is treated so.
    pub fn rehearse<C: Clock>(&mut self, clock: &C, robot: &mut dyn Robot) {
        robot.rehearse();
        let last = self.cycle.last();
        let inputs = Inputs { time_ns: last.time_ns, ..Inputs::default() };
        let mut state = last.state;
        state.robot_time_ms = state.robot_time_ms.wrapping_add(1);
        let mut repeated = Repeated { state, link: robot.link() };
        // By the same kind of reference as the robot: a generic function for another type would be other code.
        let mut copy = self.cycle;
        std::hint::black_box(copy.tick(&inputs, clock, &mut repeated as &mut dyn Robot));
        self.prepare();
    }

    /// The mode in which the last tick ended.
    pub fn mode(&self) -> Mode {
        self.cycle.mode()
    }
}

/// A robot that is in the state in which it was last seen, whatever it is told.
struct Repeated {
    state: RobotState,
    link: Option<LinkStatus>,
}

impl Robot for Repeated {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        Ok(self.state)
    }
    fn write(&mut self, _: &JointCommand) -> Result<(), RobotError> {
        Ok(())
    }
    fn place(&mut self, _: &Placement) -> bool {
        false
    }
    fn link(&self) -> Option<LinkStatus> {
        self.link
    }
}

/// Writes to the next free place of a ring without filling it.
fn fetch_next(ring: &mut rtrb::Producer<Tick>) {
    if let Ok(mut place) = ring.write_chunk_uninit(1)
        && let Some(tick) = place.as_mut_slices().0.first_mut()
    {
        tick.write(Tick::default());
    }
}

/// How long the screen has been silent. A screen that was never heard has been silent for ever.
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
        if count == 0 {
            return u32::MAX;
        }
        u32::try_from(now_ns.saturating_sub(self.heard_ns) / 1_000_000).unwrap_or(u32::MAX)
    }
}
