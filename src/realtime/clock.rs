//! Clocks of the control cycle: the monotonic clock, or a constant one for simulated time.

use std::time::Instant;

/// Clock that measures the stages of a tick.
pub trait Clock {
    /// Time since the clock was created, ns.
    fn now_ns(&self) -> u64;
}

/// The machine's monotonic clock.
#[derive(Debug, Clone, Copy)]
pub struct MonotonicClock {
    start: Instant,
}

impl MonotonicClock {
    /// A clock that starts now.
    pub fn start() -> MonotonicClock {
        MonotonicClock { start: Instant::now() }
    }
}

impl Clock for MonotonicClock {
    fn now_ns(&self) -> u64 {
        self.start.elapsed().as_nanos() as u64
    }
}

/// A constant clock: the stages of a simulated tick take no time, so the same seed gives the same ticks.
#[derive(Debug, Clone, Copy, Default)]
pub struct SimulatedClock;

impl Clock for SimulatedClock {
    fn now_ns(&self) -> u64 {
        0
    }
}
