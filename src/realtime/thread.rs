//! Pacing: calls a body at absolute instants, one per period, and measures how late each call was; optionally with a
//! cache warm-up before each call.

use std::ops::ControlFlow;
use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// Start of one tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TickStart {
    /// Planned start since the loop began, ns.
    pub planned_ns: u64,
    /// Delay of the real start, ns.
    pub lateness_ns: u64,
}

impl TickStart {
    /// Returns the time that the loop skips after this tick, ns: whole periods, zero if it catches up with them.
    pub const fn skipped_ns(&self, period_ns: u64) -> u64 {
        if self.lateness_ns > FORGIVEN_PERIODS * period_ns {
            self.lateness_ns - self.lateness_ns % period_ns
        } else {
            0
        }
    }
}

/// A loop that is more periods behind than this (the process was suspended, the machine slept) skips them instead of catching up
/// without a pause.
const FORGIVEN_PERIODS: u64 = 20;

/// Offset of the control thread's ticks within the kernel's millisecond.
///
/// A kernel whose tick is a whole number of milliseconds (CONFIG_HZ 100, 250 or 1000) does its own periodic work at
/// whole milliseconds of the monotonic clock (Linux, `kernel/time/tick-common.c`, `tick_setup_device`). A control tick
/// at a whole millisecond would compete with it. At 750 us the kernel's work has ended, and the control tick ends before
/// the next kernel tick.
pub const CONTROL_TICK_OFFSET: Duration = Duration::from_micros(750);

/// Time between the start of the cache warm-up and the tick of the control thread: long enough for the warm-up to end,
/// short enough for the caches to stay warm. See [`crate::control::control_loop`].
pub const WARM_UP_LEAD: Duration = Duration::from_micros(100);
/// Time before the tick that a warm-up needs; with less there is none. It takes 8 us, in one of a thousand ticks 25 to
/// 40 us (loopback, `quadfrog bench loop --with-link`).
const WARM_UP_TIME: Duration = Duration::from_micros(40);
/// Consecutive warm-ups that end after the tick was due, after which they pause: the machine is too slow for them. One
/// or two are stalls that the warm-up did not cause.
const OVERRUNS: u32 = 3;
/// Length of that pause, ticks.
const RESTING_TICKS: u32 = 1000;

/// A task that is called once per period.
pub trait PeriodicTask {
    /// Cache warm-up, called shortly before a tick. It is left out if there is no time, so nothing may depend on it.
    fn warm_up(&mut self) {}

    /// Called once per period, until it breaks.
    fn tick(&mut self, instant: TickStart) -> ControlFlow<()>;
}

impl<F: FnMut(TickStart) -> ControlFlow<()>> PeriodicTask for F {
    fn tick(&mut self, instant: TickStart) -> ControlFlow<()> {
        self(instant)
    }
}

/// Calls `body` once per period until it breaks, each time `offset` after a whole period of the system's monotonic
/// clock.
///
/// # Errors
/// When the system's monotonic clock cannot be read or waited on.
pub fn pace(
    period: Duration,
    offset: Duration,
    mut body: impl FnMut(TickStart) -> ControlFlow<()>,
) -> Result<(), nix::Error> {
    pace_with_warm_up(period, offset, Duration::ZERO, &mut body)
}

/// As [`pace`], with a cache warm-up that starts `lead` before each tick, unless there is no time for it. The thread
/// sleeps between the two.
///
/// # Errors
/// When the system's monotonic clock cannot be read or waited on.
pub fn pace_with_warm_up(
    period: Duration,
    offset: Duration,
    lead: Duration,
    body: &mut (impl PeriodicTask + ?Sized),
) -> Result<(), nix::Error> {
    let [period_ns, offset_ns, lead_ns, needs_ns] =
        [period, offset, lead, WARM_UP_TIME].map(|time| time.as_nanos() as u64);
    let mut start_ns = monotonic_ns()?.next_multiple_of(period_ns) + offset_ns;
    let mut count = 0u64;
    let mut skipped_ns = 0;
    let (mut overruns, mut resting_ticks) = (0, 0);
    loop {
        let planned_ns = start_ns + count * period_ns;
        if resting_ticks > 0 {
            resting_ticks -= 1;
        } else if lead_ns > 0 && monotonic_ns()? + lead_ns < planned_ns {
            sleep_until(planned_ns - lead_ns)?;
            if monotonic_ns()? + needs_ns <= planned_ns {
                body.warm_up();
                overruns = if monotonic_ns()? > planned_ns { overruns + 1 } else { 0 };
                if overruns == OVERRUNS {
                    (overruns, resting_ticks) = (0, RESTING_TICKS);
                }
            }
        }
        sleep_until(planned_ns)?;
        let lateness_ns = monotonic_ns()?.saturating_sub(planned_ns);
        let instant = TickStart { planned_ns: count * period_ns + skipped_ns, lateness_ns };
        if body.tick(instant).is_break() {
            return Ok(());
        }
        count += 1;
        let whole_ns = instant.skipped_ns(period_ns);
        start_ns += whole_ns;
        skipped_ns += whole_ns;
    }
}

fn sleep_until(time_ns: u64) -> Result<(), nix::Error> {
    let wake = TimeSpec::new((time_ns / 1_000_000_000) as i64, (time_ns % 1_000_000_000) as i64);
    loop {
        match clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &wake) {
            Ok(_) => return Ok(()),
            // Woken early by a signal.
            Err(nix::Error::EINTR) => {}
            Err(error) => return Err(error),
        }
    }
}

fn monotonic_ns() -> Result<u64, nix::Error> {
    let now = clock_gettime(ClockId::CLOCK_MONOTONIC)?;
    Ok(now.tv_sec() as u64 * 1_000_000_000 + now.tv_nsec() as u64)
}
