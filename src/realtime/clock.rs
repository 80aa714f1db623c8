//! Clocks of the control cycle: the monotonic clock, or a constant one for simulated time.

use std::time::Instant;

use nix::time::{ClockId, clock_gettime};

/// Clock that measures the stages of a tick.
pub trait Clock {
    /// Time since the clock was created, ns.
    fn now_ns(&self) -> u64;

    /// Time on a clock that no time service speeds up or slows down, ns since any instant; none where there is no such clock.
    fn unslewed_ns(&self) -> Option<u64> {
        None
    }

    /// Lower and upper bound of the time for which the computer has been suspended since it was started, ns; none where it
    /// is not known.
    fn suspended_ns(&self) -> Option<[u64; 2]> {
        None
    }
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

    /// CLOCK_MONOTONIC_RAW: a time service slews CLOCK_MONOTONIC by 500 ppm and more (clock_gettime(2), adjtimex(2)).
    fn unslewed_ns(&self) -> Option<u64> {
        read_ns(ClockId::CLOCK_MONOTONIC_RAW)
    }

    fn suspended_ns(&self) -> Option<[u64; 2]> {
        suspended_ns()
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

/// Returns a lower and an upper bound of the time for which the computer has been suspended since it was started, ns; none
/// where the system does not report it. CLOCK_BOOTTIME counts that time, CLOCK_MONOTONIC does not (clock_gettime(2)); the
/// bounds differ by the time between the readings.
pub fn suspended_ns() -> Option<[u64; 2]> {
    let before = read_ns(ClockId::CLOCK_MONOTONIC)?;
    let since_boot = read_ns(ClockId::CLOCK_BOOTTIME)?;
    let after = read_ns(ClockId::CLOCK_MONOTONIC)?;
    Some([since_boot.saturating_sub(after), since_boot.saturating_sub(before)])
}

fn read_ns(clock: ClockId) -> Option<u64> {
    let now = clock_gettime(clock).ok()?;
    Some(now.tv_sec() as u64 * 1_000_000_000 + now.tv_nsec() as u64)
}

/// Detects suspensions of the computer.
#[derive(Debug, Clone, Copy, Default)]
pub struct SuspendWatch {
    /// Upper bound of the time suspended so far, ns.
    known_ns: Option<u64>,
}

impl SuspendWatch {
    /// Takes the bounds of [`suspended_ns`]; returns the time for which the computer was suspended since the last call that
    /// returned more than zero, ms: never more than it was, however long the readings took.
    pub fn observe(&mut self, [least, most]: [u64; 2]) -> u32 {
        let known = self.known_ns.map_or(most, |known| known.min(most));
        let new_ms = least.saturating_sub(known) / 1_000_000;
        self.known_ns = Some(if new_ms > 0 { most } else { known });
        u32::try_from(new_ms).unwrap_or(u32::MAX)
    }
}
