//! The control loop: inputs from the channels, one tick of the cycle, results to the channels. Nothing here allocates, locks or
//! waits.
//!
//! **Cache warm-up.** The other work of a millisecond evicts the tick's code and data from the processor's caches, and a tick with
//! cold caches takes longer. Therefore [`ControlLoop::warm_up`], 0.1 ms before each tick of a real robot, runs a tick on a copy of
//! the cycle with the last state and discards the result; [`Robot::warm_up`] does the same for the system calls of the link. It
//! changes no result (`tests/control/warm_up.rs`). The longest of a thousand ticks take a third less time with it (loopback:
//! `quadfrog bench loop --with-link`, compared with `--without-warm-up`).

use super::cycle::{Cycle, TickInputs};
use super::settings::ControlSettings;
use crate::realtime::channel::{ControlPorts, Lowering, LoweringLatch, SHOWN_EVERY};
use crate::realtime::clock::{Clock, SuspendWatch};
use crate::realtime::thread::TickStart;
use crate::robot::{CONTROL_PERIOD_S, JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use crate::telemetry::{Command, Counters, Event, Mode, RecentLateness, Snapshot, Tick, TrialInhibit};

/// Ticks between two updates of counters and readiness for the session; every event causes one too.
const COUNTERS_EVERY: u64 = 100;

/// A control cycle with its channels.
pub struct ControlLoop {
    cycle: Cycle,
    end: ControlPorts,
    counters: Counters,
    lateness: RecentLateness,
    /// The reason for which a trial would not be approved, as of the last readiness.
    unready: Option<TrialInhibit>,
    heartbeat: HeartbeatWatch,
    lowering: LoweringWatch,
    events_lost: bool,
    suspend: SuspendWatch,
    /// Time for which the guard has not answered, ms.
    guard_silent_ms: u32,
    /// Clock time of the loop's start, ns; known from the first tick on.
    start_ns: Option<u64>,
}

impl ControlLoop {
    /// A loop before its first tick.
    pub fn new(settings: &ControlSettings, end: ControlPorts) -> ControlLoop {
        ControlLoop {
            cycle: Cycle::new(settings),
            end,
            counters: Counters::default(),
            lateness: RecentLateness::default(),
            unready: None,
            heartbeat: HeartbeatWatch::default(),
            lowering: LoweringWatch::default(),
            events_lost: false,
            suspend: SuspendWatch::default(),
            guard_silent_ms: 0,
            start_ns: None,
        }
    }

    /// Runs one tick.
    pub fn tick<C: Clock, R: Robot + ?Sized>(&mut self, start: TickStart, clock: &C, robot: &mut R) -> &Tick {
        let ControlLoop { cycle, end, counters, start_ns, .. } = self;
        // The ring is abandoned when the session thread has panicked, even into a ring with space.
        self.events_lost |= end.events.is_abandoned();
        // Before the queue, whose next command may be one that energises.
        let command = self.lowering.next(&end.lowering).or_else(|| end.commands.pop().ok());
        if let Some(Command::Acknowledge { stops }) = command
            && matches!(cycle.mode(), Mode::Damped | Mode::Fault)
        {
            end.stop.acknowledge(stops);
        }
        // `TickStart` counts from the loop's start, the clock from its own.
        let passed_ns = start.planned_ns + start.lateness_ns;
        let time_ns = *start_ns.get_or_insert_with(|| clock.now_ns().saturating_sub(passed_ns)) + start.planned_ns;
        let inputs = TickInputs {
            time_ns,
            lateness_ns: start.lateness_ns,
            unslewed_ns: clock.unslewed_ns(),
            stop: end.stop.is_set(),
            operator_silent_ms: self.heartbeat.silent_ms(end.heartbeat.count(), time_ns),
            command,
            events_lost: self.events_lost,
            suspended_ms: clock.suspended_ns().map_or(0, |bounds| self.suspend.observe(bounds)),
            guard_silent_ms: self.guard_silent_ms,
        };
        let mode = cycle.mode();
        let tick = *cycle.tick(&inputs, clock, robot);

        counters.late_ticks += u64::from(start.lateness_ns as f64 > CONTROL_PERIOD_S * 1e9 / 2.0);
        counters.worst_lateness_ns = counters.worst_lateness_ns.max(start.lateness_ns);
        self.lateness.see(time_ns, start.lateness_ns);
        counters.state_age_ms = cycle.state_age_ms();
        counters.link = robot.link();
        counters.ticks_not_recorded += u64::from(end.ticks.push(tick).is_err());
        if tick.number.is_multiple_of(SHOWN_EVERY) || tick.mode != mode {
            counters.ticks_not_shown += u64::from(end.shown.push(tick).is_err());
        }
        let has_events = cycle.events().iter().next().is_some();
        if has_events || tick.number.is_multiple_of(COUNTERS_EVERY) {
            // Before the events, so that a session that receives DISARMED reads current findings.
            end.counters.write(*counters);
            let readiness = cycle.readiness();
            self.unready = readiness.inhibit.or(readiness.unready);
            end.readiness.write(readiness);
        }
        for event in cycle.events().iter() {
            counters.commands_refused += u64::from(matches!(event, Event::Refused { .. }));
            self.events_lost |= end.events.push(event).is_err();
        }
        end.snapshot.write(Snapshot { tick, counters: *counters, unready: self.unready, lateness: self.lateness });
        cycle.last()
    }

    /// Prefetches the memory of the next tick in the rings, whose next slot was last used seconds ago. Optional; to be called
    /// between ticks.
    pub fn prepare(&mut self) {
        fetch_next(&mut self.end.ticks);
        if (self.cycle.last().number + 1).is_multiple_of(SHOWN_EVERY) {
            fetch_next(&mut self.end.shown);
        }
    }

    /// Warms the caches: runs one tick on a copy of the cycle and discards the result. A panic is treated as one of the
    /// tick.
    pub fn warm_up<C: Clock>(&mut self, clock: &C, robot: &mut dyn Robot) {
        robot.warm_up();
        let last = self.cycle.last();
        let inputs = TickInputs { time_ns: last.time_ns, unslewed_ns: clock.unslewed_ns(), ..TickInputs::default() };
        let mut state = last.state;
        state.robot_time_ms = state.robot_time_ms.wrapping_add(1);
        let mut repeated = LastState { state, link: robot.link() };
        // `&mut dyn Robot` as in the tick: a generic function for another type would be other code.
        let mut copy = self.cycle;
        std::hint::black_box(copy.tick(&inputs, clock, &mut repeated as &mut dyn Robot));
        self.prepare();
    }

    /// Sets the time for which the guard has not answered, ms, as of the next tick; `u32::MAX` when it is gone.
    pub fn set_guard_silent(&mut self, silent_ms: u32) {
        self.guard_silent_ms = silent_ms;
    }

    /// The mode in which the last tick ended.
    pub fn mode(&self) -> Mode {
        self.cycle.mode()
    }
}

/// A robot that repeats one state and ignores commands.
struct LastState {
    state: RobotState,
    link: Option<LinkStatus>,
}

impl Robot for LastState {
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

/// Writes to the next free slot of a ring without publishing it.
fn fetch_next(ring: &mut rtrb::Producer<Tick>) {
    if let Ok(mut place) = ring.write_chunk_uninit(1)
        && let Some(tick) = place.as_mut_slices().0.first_mut()
    {
        tick.write(Tick::default());
    }
}

/// Presses of sit down and cancel that were carried out.
#[derive(Default)]
struct LoweringWatch {
    sit_downs: u64,
    cancels: u64,
}

impl LoweringWatch {
    /// Returns the command of a new press; sit down comes first.
    fn next(&mut self, latch: &LoweringLatch) -> Option<Command> {
        let (sit_downs, cancels) = (latch.count(Lowering::SitDown), latch.count(Lowering::Cancel));
        if sit_downs != self.sit_downs {
            self.sit_downs = sit_downs;
            Some(Command::SitDown)
        } else if cancels != self.cancels {
            self.cancels = cancels;
            Some(Command::Cancel)
        } else {
            None
        }
    }
}

/// Time-out of the operator console's heartbeat.
#[derive(Default)]
struct HeartbeatWatch {
    count: u64,
    changed_ns: u64,
}

impl HeartbeatWatch {
    /// Returns the time since the last heartbeat, ms; `u32::MAX` before the first.
    fn silent_ms(&mut self, count: u64, now_ns: u64) -> u32 {
        if count != self.count {
            self.count = count;
            self.changed_ns = now_ns;
        }
        if count == 0 {
            return u32::MAX;
        }
        u32::try_from(now_ns.saturating_sub(self.changed_ns) / 1_000_000).unwrap_or(u32::MAX)
    }
}
