//! The wait-free channels over the real-time boundary. Each endpoint is handed out once: whoever was not given one cannot
//! send.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::telemetry::{Command, Counters, Event, Readiness, Snapshot, Tick};

/// Commands that may wait.
pub const COMMANDS: usize = 64;
/// Ticks that may wait for the recorder: four seconds.
pub const TICKS: usize = 4096;
/// Decimated ticks that may wait for the screen.
pub const SHOWN_TICKS: usize = 1024;
/// Every n-th tick goes to the screen's charts.
pub const SHOWN_EVERY: u64 = 5;
/// Events that may wait for the session.
pub const EVENTS: usize = 256;

/// STOP: anyone sets it, control reads it first in every tick, and it is cleared by an acknowledgement alone.
///
/// Stops are counted, and an acknowledgement names the stops that it has seen: a newer STOP outlives it.
#[derive(Debug, Clone, Default)]
pub struct StopLatch(Arc<Stops>);

#[derive(Debug, Default)]
struct Stops {
    pressed: AtomicU64,
    acknowledged: AtomicU64,
}

impl StopLatch {
    /// Stops. Cannot queue, wait or fail.
    pub fn set(&self) {
        self.0.pressed.fetch_add(1, Ordering::AcqRel);
    }

    /// How often it was pressed.
    pub fn count(&self) -> u64 {
        self.0.pressed.load(Ordering::Acquire)
    }

    /// Whether it is set.
    pub fn is_set(&self) -> bool {
        self.count() > self.0.acknowledged.load(Ordering::Acquire)
    }

    /// The control thread takes note that somebody has looked after the first `stops` of them.
    pub fn acknowledge(&self, stops: u64) {
        self.0.acknowledged.fetch_max(stops, Ordering::AcqRel);
    }
}

/// A sign of life of the operator's screen.
#[derive(Debug, Clone, Default)]
pub struct Heartbeat(Arc<AtomicU64>);

impl Heartbeat {
    /// The screen is alive.
    pub fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// How often it was said to be.
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The control thread's ends.
pub struct ControlEnd {
    /// What the session asks.
    pub commands: rtrb::Consumer<Command>,
    /// STOP.
    pub stop: StopLatch,
    /// The screen's sign of life.
    pub heartbeat: Heartbeat,
    /// Every tick, for the recorder.
    pub ticks: rtrb::Producer<Tick>,
    /// Every n-th tick, for the screen.
    pub shown: rtrb::Producer<Tick>,
    /// The newest tick and the counters.
    pub snapshot: triple_buffer::Input<Snapshot>,
    /// The counters, for the session.
    pub counters: triple_buffer::Input<Counters>,
    /// What speaks against the next arming and the next trial, for the session.
    pub readiness: triple_buffer::Input<Readiness>,
    /// What happened.
    pub events: rtrb::Producer<Event>,
}

/// The session's ends.
pub struct SessionEnd {
    /// What it asks.
    pub commands: rtrb::Producer<Command>,
    /// STOP, to see whether one came after a wish.
    pub stop: StopLatch,
    /// The screen's sign of life, to see whether there is a screen at all.
    pub heartbeat: Heartbeat,
    /// The newest counters.
    pub counters: triple_buffer::Output<Counters>,
    /// What the control thread has against the next arming and the next trial.
    pub readiness: triple_buffer::Output<Readiness>,
    /// What happened.
    pub events: rtrb::Consumer<Event>,
}

/// The screen's ends.
pub struct ScreenEnd {
    /// STOP.
    pub stop: StopLatch,
    /// Its sign of life.
    pub heartbeat: Heartbeat,
    /// Ticks for charts.
    pub shown: rtrb::Consumer<Tick>,
    /// The newest tick and the counters.
    pub snapshot: triple_buffer::Output<Snapshot>,
}

/// All channels of one engine; the last is the recorder's end.
pub fn channels() -> (ControlEnd, SessionEnd, ScreenEnd, rtrb::Consumer<Tick>) {
    let (command_in, command_out) = rtrb::RingBuffer::new(COMMANDS);
    let (tick_in, tick_out) = rtrb::RingBuffer::new(TICKS);
    let (shown_in, shown_out) = rtrb::RingBuffer::new(SHOWN_TICKS);
    let (event_in, event_out) = rtrb::RingBuffer::new(EVENTS);
    let (snapshot_in, snapshot_out) = triple_buffer::triple_buffer(&Snapshot::default());
    let (counters_in, counters_out) = triple_buffer::triple_buffer(&Counters::default());
    let (readiness_in, readiness_out) = triple_buffer::triple_buffer(&Readiness::default());
    let (stop, heartbeat) = (StopLatch::default(), Heartbeat::default());
    let control = ControlEnd {
        commands: command_out,
        stop: stop.clone(),
        heartbeat: heartbeat.clone(),
        ticks: tick_in,
        shown: shown_in,
        snapshot: snapshot_in,
        counters: counters_in,
        readiness: readiness_in,
        events: event_in,
    };
    let session = SessionEnd {
        commands: command_in,
        stop: stop.clone(),
        heartbeat: heartbeat.clone(),
        counters: counters_out,
        readiness: readiness_out,
        events: event_out,
    };
    let screen = ScreenEnd { stop, heartbeat, shown: shown_out, snapshot: snapshot_out };
    (control, session, screen, tick_out)
}
