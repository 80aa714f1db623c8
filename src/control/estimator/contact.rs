//! Which feet are on the ground, from force sensors that are coarse and noisy.

use crate::control::settings::EstimatorSettings;
use crate::robot::PerLeg;

/// Contact per foot: hysteresis in force, and a change must last.
///
/// In the air a rectified sensor still shows its noise, and a foot that lands bounces: one threshold would flicker. A low-pass
/// would not, but it sees the end of a push of 100 N ten milliseconds late, and a leg that is driven on in the air for so long
/// turns the trunk: seven more of the hundred jumps of `benches/estimator.rs` fell by it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactGate {
    down: PerLeg<bool>,
    /// For how long the sensor has said otherwise, s.
    otherwise_s: PerLeg<f64>,
    started: bool,
}

impl ContactGate {
    /// Which feet are down after forces (N) that were measured `dt_s` after the last ones. The first are taken as they are.
    pub fn update(&mut self, foot_force: &PerLeg<f64>, dt_s: f64, settings: &EstimatorSettings) -> PerLeg<bool> {
        for ((down, otherwise_s), force) in self.down.iter_mut().zip(&mut self.otherwise_s).zip(foot_force) {
            let says = *force >= if *down { settings.contact_off_n } else { settings.contact_on_n };
            *otherwise_s = if says == *down { 0.0 } else { *otherwise_s + dt_s };
            // Half a millisecond of grace: sums of steps are not exact.
            if *otherwise_s >= settings.contact_time_s - 5e-4 || !self.started {
                *down = says;
                *otherwise_s = 0.0;
            }
        }
        self.started = true;
        self.down
    }
}
