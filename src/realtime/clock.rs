//! Time: the machine's monotonic clock, or one that stands still for simulated time.

use std::time::Instant;

/// Where the cycle reads the time from, to time its stages.
pub trait Clock {
    /// Time since the clock was made, ns.
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

/// A clock that does not move: in simulated time nothing takes time, and the same seed gives the same ticks.
#[derive(Debug, Clone, Copy, Default)]
pub struct SimulatedClock;

impl Clock for SimulatedClock {
    fn now_ns(&self) -> u64 {
        0
    }
}
