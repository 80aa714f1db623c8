//! Which feet are on the ground, from force sensors that are coarse and noisy.

use crate::control::settings::EstimatorSettings;
use crate::robot::PerLeg;

/// Contact per foot, with hysteresis in force and a least duration of a change.
///
/// One threshold would flicker: a rectified sensor shows noise in the air, and a landing foot bounces. A low-pass filter reports the
/// end of a push of 100 N ten milliseconds late; a leg that pushes on in the air turns the trunk, and seven more of the hundred
/// jumps of `benches/estimator.rs` fell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactGate {
    down: PerLeg<bool>,
    /// Time for which the sensor has reported the opposite, s.
    opposite_s: PerLeg<f64>,
    started: bool,
}

impl ContactGate {
    /// Updates the contacts with forces (N) measured `dt_s` after the last ones. The first forces set them at once.
    pub fn update(&mut self, foot_force: &PerLeg<f64>, dt_s: f64, settings: &EstimatorSettings) -> PerLeg<bool> {
        for ((down, opposite_s), force) in self.down.iter_mut().zip(&mut self.opposite_s).zip(foot_force) {
            let reported = *force >= if *down { settings.contact_off_n } else { settings.contact_on_n };
            *opposite_s = if reported == *down { 0.0 } else { *opposite_s + dt_s };
            // Half a millisecond of tolerance: sums of steps are rounded.
            if *opposite_s >= settings.contact_time_s - 5e-4 || !self.started {
                *down = reported;
                *opposite_s = 0.0;
            }
        }
        self.started = true;
        self.down
    }
}
