//! Temperature, battery, link and lateness of the last half hour, one value a second.

use std::collections::VecDeque;

use quadfrog::telemetry::{Counters, RecentLateness, Tick};

/// Seconds that are kept.
const CAPACITY: usize = 1800;

/// The worst values of a second; no number where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HealthSecond {
    /// Time since the engine started, s.
    pub second: u64,
    /// Temperature of the hottest motor, degrees Celsius.
    pub motor_c: f64,
    /// Charge of the battery, %.
    pub battery_percent: f64,
    /// Age of the robot's newest valid state, ms.
    pub state_age_ms: f64,
    /// Lateness of a tick, ms.
    pub lateness_ms: f64,
}

/// The newest seconds, oldest first.
#[derive(Debug, Clone, Default)]
pub struct HealthHistory {
    seconds: VecDeque<HealthSecond>,
}

impl HealthHistory {
    /// Adds one tick, with the counters of its time; `silent`: the robot sends no states. A tick older than the newest second clears
    /// the history first.
    pub fn push(&mut self, tick: &Tick, counters: &Counters, silent: bool) {
        // What a silent robot has sent last is no value of now.
        let state = Some(&tick.state).filter(|_| !silent);
        let hottest = state.map_or(0.0, |state| state.motor_temperature_c.iter().copied().fold(0.0, f64::max));
        let now = HealthSecond {
            second: tick.time_ns / 1_000_000_000,
            // A robot without sensors of temperature reports zero.
            motor_c: if hottest > 0.0 { hottest } else { f64::NAN },
            battery_percent: state.and_then(|state| state.battery).map_or(f64::NAN, |battery| battery.charge_percent),
            state_age_ms: counters.link.map_or(f64::NAN, |link| f64::from(link.state_age_ms)),
            lateness_ms: f64::from(tick.stages.lateness_ns) / 1e6,
        };
        match self.seconds.back_mut() {
            Some(newest) if newest.second == now.second => {
                // `max` and `min` ignore what is no number.
                newest.motor_c = newest.motor_c.max(now.motor_c);
                newest.battery_percent = newest.battery_percent.min(now.battery_percent);
                newest.state_age_ms = newest.state_age_ms.max(now.state_age_ms);
                newest.lateness_ms = newest.lateness_ms.max(now.lateness_ms);
                return;
            }
            Some(newest) if newest.second > now.second => self.seconds.clear(),
            _ => {}
        }
        if self.seconds.len() == CAPACITY {
            self.seconds.pop_front();
        }
        self.seconds.push_back(now);
    }

    /// Takes over the lateness of ticks that are not shown.
    pub fn see_lateness(&mut self, lateness: &RecentLateness) {
        for (second, worst_ns) in
            [(lateness.second, lateness.present_ns), (lateness.second.wrapping_sub(1), lateness.before_ns)]
        {
            if let Some(kept) = self.seconds.iter_mut().rev().take(3).find(|kept| kept.second == second) {
                kept.lateness_ms = kept.lateness_ms.max(worst_ns as f64 / 1e6);
            }
        }
    }

    /// Clears the history: time has jumped.
    pub fn clear(&mut self) {
        self.seconds.clear();
    }

    /// The seconds, oldest first.
    pub fn seconds(&self) -> impl DoubleEndedIterator<Item = &HealthSecond> + '_ {
        self.seconds.iter()
    }
}
