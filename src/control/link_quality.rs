//! Quality of the link over the last second: delay, losses, age of the states.

use crate::robot::recent_count::RecentCount;
use crate::robot::{LinkStatus, robot_time_passed};

/// States in a row that must be late: a burst after a stall holds a few late ones.
const STATES: usize = 5;
/// Blocks of 0.1 s in a second.
const BLOCKS: usize = 10;
/// Ticks in a block.
const BLOCK_TICKS: u32 = 100;

/// Quality of the link; all zero for a robot without one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkQuality {
    /// Robot time since the first state, and at the newest one, ms.
    robot_ms: i64,
    newest_ms: u32,
    /// Least local time minus robot time so far, ns; it rises with the clocks' largest drift. None before the first state.
    least_ns: Option<f64>,
    updated_ns: u64,
    /// Local time minus robot time above `least_ns` of the newest states, ms.
    growth_ms: [f64; STATES],
    next: usize,
    /// Totals of the link at the last tick.
    received: u64,
    lost: u64,
    recent_received: RecentCount,
    recent_lost: RecentCount,
    /// Largest age of the newest state in each of the last blocks, ms; the current block first.
    oldest_ms: [u32; BLOCKS + 1],
    block_ticks: u32,
}

impl LinkQuality {
    /// Records one tick; to be called once per tick, after reading the robot. `now_ns` is the local time at which the tick began, of a
    /// clock that is not slewed, `drift_ppm` the clocks' largest drift, parts per million. When the robot's clock restarts or stands still,
    /// the delay is measured anew.
    pub fn update(
        &mut self,
        now_ns: u64,
        robot_time_ms: u32,
        state_age_ms: u32,
        link: Option<LinkStatus>,
        drift_ppm: f64,
    ) {
        if let Some(link) = link {
            self.count(&link, state_age_ms);
            if state_age_ms == 0 {
                self.measure_delay(now_ns, robot_time_ms, drift_ppm);
            }
        }
    }

    fn count(&mut self, link: &LinkStatus, state_age_ms: u32) {
        self.recent_received.advance();
        self.recent_lost.advance();
        let new = |total: u64, before: u64| u32::try_from(total.saturating_sub(before)).unwrap_or(u32::MAX);
        self.recent_received.add(new(link.received, self.received));
        self.recent_lost.add(new(link.lost, self.lost));
        // A state that arrives after a newer one is no longer counted as lost.
        for _ in link.lost..self.lost {
            self.recent_lost.take_back();
        }
        (self.received, self.lost) = (link.received, link.lost);
        if self.block_ticks == BLOCK_TICKS {
            self.block_ticks = 0;
            self.oldest_ms.copy_within(..BLOCKS, 1);
            self.oldest_ms[0] = 0;
        }
        self.block_ticks += 1;
        self.oldest_ms[0] = self.oldest_ms[0].max(state_age_ms);
    }

    fn measure_delay(&mut self, now_ns: u64, robot_time_ms: u32, drift_ppm: f64) {
        let passed_ms = robot_time_passed(robot_time_ms, self.newest_ms);
        let known = self.least_ns.filter(|_| passed_ms > 0);
        self.newest_ms = robot_time_ms;
        self.robot_ms = if known.is_some() { self.robot_ms + i64::from(passed_ms) } else { 0 };
        let offset_ns = now_ns as f64 - self.robot_ms as f64 * 1e6;
        let drift_ns = now_ns.saturating_sub(self.updated_ns) as f64 * drift_ppm * 1e-6;
        self.updated_ns = now_ns;
        let least_ns = known.map_or(offset_ns, |least_ns| (least_ns + drift_ns).min(offset_ns));
        self.least_ns = Some(least_ns);
        if known.is_none() {
            self.growth_ms = [0.0; STATES];
        }
        self.growth_ms[self.next] = (offset_ns - least_ns) * 1e-6;
        self.next = (self.next + 1) % STATES;
    }

    /// Growth of the link's delay, ms: local time minus robot time above its least value, the smallest of the newest states.
    pub fn delay_growth_ms(&self) -> f64 {
        self.growth_ms.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Share of the states of the last second that were lost, 0 to 1.
    pub fn loss_share(&self) -> f64 {
        let (received, lost) = (self.recent_received.last_second().0, self.recent_lost.last_second().0);
        if lost == 0 { 0.0 } else { f64::from(lost) / f64::from(lost.saturating_add(received)) }
    }

    /// Largest age of the newest state in the last second, ms.
    pub fn oldest_ms(&self) -> u32 {
        self.oldest_ms.iter().copied().max().unwrap_or_default()
    }
}
