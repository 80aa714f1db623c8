//! The wait-free channels over the real-time boundary. Each end of a ring or
//! buffer exists once: code without it cannot send. The STOP latch and the heartbeat can be cloned.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::telemetry::{Command, Counters, Event, Readiness, Snapshot, Tick};

/// Capacity of the ring of commands.
pub const COMMANDS: usize = 64;
/// Capacity of the recorder's ring, ticks: four seconds.
pub const TICKS: usize = 4096;
/// Capacity of the console's ring, decimated ticks.
pub const SHOWN_TICKS: usize = 1024;
/// Decimation of the ticks for the console's charts, which also have each tick in which the mode changes: the values at which a limit
/// trips are among them.
pub const SHOWN_EVERY: u64 = 5;
/// Capacity of the ring of events.
pub const EVENTS: usize = 256;

/// The STOP latch. Any thread sets it; the control thread reads it in every tick before it acts on failsafes or commands; an
/// acknowledgement clears it.
///
/// STOPs are counted, and an acknowledgement names the count that it answers: a newer STOP stays set.
#[derive(Debug, Clone, Default)]
pub struct StopLatch(Arc<Stops>);

#[derive(Debug, Default)]
struct Stops {
    pressed: AtomicU64,
    acknowledged: AtomicU64,
}

impl StopLatch {
    /// Sets STOP. Cannot queue, wait or fail.
    pub fn set(&self) {
        self.0.pressed.fetch_add(1, Ordering::AcqRel);
    }

    /// Number of STOPs since the start.
    pub fn count(&self) -> u64 {
        self.0.pressed.load(Ordering::Acquire)
    }

    /// Whether it is set.
    pub fn is_set(&self) -> bool {
        self.count() > self.0.acknowledged.load(Ordering::Acquire)
    }

    /// Acknowledges the first `stops` STOPs.
    pub fn acknowledge(&self, stops: u64) {
        self.0.acknowledged.fetch_max(stops, Ordering::AcqRel);
    }
}

/// A request towards less energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lowering {
    /// Sit down and disarm.
    SitDown,
    /// Cancel the countdown.
    Cancel,
}

/// The latch of sit down and cancel. The control thread acts in the tick in which it sees a press, apart from the queue of
/// commands: no lock, slow disk or busy session delays it. An arming or an approval from before a press is void.
#[derive(Debug, Clone, Default)]
pub struct LoweringLatch(Arc<Lowerings>);

#[derive(Debug, Default)]
struct Lowerings {
    presses: [AtomicU64; 2],
    newest_ns: AtomicU64,
}

impl LoweringLatch {
    /// Sets the latch at `time_ns` since the engine's start. Cannot queue, wait or fail.
    pub fn press(&self, lowering: Lowering, time_ns: u64) {
        self.0.newest_ns.fetch_max(time_ns, Ordering::AcqRel);
        self.0.presses[lowering as usize].fetch_add(1, Ordering::AcqRel);
    }

    /// Number of presses since the start.
    pub fn count(&self, lowering: Lowering) -> u64 {
        self.0.presses[lowering as usize].load(Ordering::Acquire)
    }

    /// Time of the newest press, ns since the engine's start; 0 without one.
    pub fn newest_ns(&self) -> u64 {
        self.0.newest_ns.load(Ordering::Acquire)
    }
}

/// Heartbeat counter of the operator's console.
#[derive(Debug, Clone, Default)]
pub struct Heartbeat(Arc<AtomicU64>);

impl Heartbeat {
    /// Counts one heartbeat.
    pub fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of heartbeats since the start.
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The control thread's ends.
pub struct ControlPorts {
    /// Commands of the session.
    pub commands: rtrb::Consumer<Command>,
    /// STOP.
    pub stop: StopLatch,
    /// Sit down and cancel.
    pub lowering: LoweringLatch,
    /// Heartbeat of the console.
    pub heartbeat: Heartbeat,
    /// Every tick, for the recorder.
    pub ticks: rtrb::Producer<Tick>,
    /// Every n-th tick, for the console.
    pub shown: rtrb::Producer<Tick>,
    /// The newest tick and the counters.
    pub snapshot: triple_buffer::Input<Snapshot>,
    /// The counters, for the session.
    pub counters: triple_buffer::Input<Counters>,
    /// Conditions of the next arming and the next trial, for the session.
    pub readiness: triple_buffer::Input<Readiness>,
    /// Events.
    pub events: rtrb::Producer<Event>,
}

/// The session's ends.
pub struct SessionPorts {
    /// Commands to the control thread.
    pub commands: rtrb::Producer<Command>,
    /// STOP, to detect one that came after an operator's request.
    pub stop: StopLatch,
    /// Sit down and cancel, to detect a press after an operator's request.
    pub lowering: LoweringLatch,
    /// Heartbeat of the console, to detect a missing console.
    pub heartbeat: Heartbeat,
    /// The newest counters.
    pub counters: triple_buffer::Output<Counters>,
    /// Conditions of the next arming and the next trial.
    pub readiness: triple_buffer::Output<Readiness>,
    /// Events.
    pub events: rtrb::Consumer<Event>,
}

/// The console's ends.
pub struct ConsolePorts {
    /// STOP.
    pub stop: StopLatch,
    /// Sit down and cancel.
    pub lowering: LoweringLatch,
    /// Heartbeat of this console.
    pub heartbeat: Heartbeat,
    /// Ticks for charts.
    pub shown: rtrb::Consumer<Tick>,
    /// The newest tick and the counters.
    pub snapshot: triple_buffer::Output<Snapshot>,
}

/// Creates all channels of one engine; the last is the recorder's end.
pub fn channels() -> (ControlPorts, SessionPorts, ConsolePorts, rtrb::Consumer<Tick>) {
    let (command_in, command_out) = rtrb::RingBuffer::new(COMMANDS);
    let (tick_in, tick_out) = rtrb::RingBuffer::new(TICKS);
    let (shown_in, shown_out) = rtrb::RingBuffer::new(SHOWN_TICKS);
    let (event_in, event_out) = rtrb::RingBuffer::new(EVENTS);
    let (snapshot_in, snapshot_out) = triple_buffer::triple_buffer(&Snapshot::default());
    let (counters_in, counters_out) = triple_buffer::triple_buffer(&Counters::default());
    let (readiness_in, readiness_out) = triple_buffer::triple_buffer(&Readiness::default());
    let (stop, lowering, heartbeat) = (StopLatch::default(), LoweringLatch::default(), Heartbeat::default());
    let control = ControlPorts {
        commands: command_out,
        stop: stop.clone(),
        lowering: lowering.clone(),
        heartbeat: heartbeat.clone(),
        ticks: tick_in,
        shown: shown_in,
        snapshot: snapshot_in,
        counters: counters_in,
        readiness: readiness_in,
        events: event_in,
    };
    let session = SessionPorts {
        commands: command_in,
        stop: stop.clone(),
        lowering: lowering.clone(),
        heartbeat: heartbeat.clone(),
        counters: counters_out,
        readiness: readiness_out,
        events: event_out,
    };
    let console = ConsolePorts { stop, lowering, heartbeat, shown: shown_out, snapshot: snapshot_out };
    (control, session, console, tick_out)
}
