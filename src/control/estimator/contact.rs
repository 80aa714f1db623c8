//! Which feet are on the ground, from force sensors that are coarse and noisy.

use crate::control::settings::EstimatorSettings;
use crate::robot::PerLeg;

/// Contact per foot: the smoothed force with hysteresis.
///
/// In the air a rectified sensor still shows its noise; on the ground a rocking robot unloads a foot for a moment. One
/// threshold would flicker in both cases, two do not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactGate {
    /// Smoothed force, N.
    force: PerLeg<f64>,
    down: PerLeg<bool>,
    started: bool,
}

impl ContactGate {
    /// Which feet are down after forces (N) that were measured `dt_s` after the last ones.
    pub fn update(&mut self, foot_force: &PerLeg<f64>, dt_s: f64, settings: &EstimatorSettings) -> PerLeg<bool> {
        // First-order low-pass, exact for a force that holds over dt: f += (1 - e^(-dt/T)) (f_measured - f).
        let share = if self.started { 1.0 - (-dt_s / settings.contact_time_s).exp() } else { 1.0 };
        self.started = true;
        for ((force, down), measured) in self.force.iter_mut().zip(&mut self.down).zip(foot_force) {
            *force += share * (measured - *force);
            *down = *force >= if *down { settings.contact_off_n } else { settings.contact_on_n };
        }
        self.down
    }
}
