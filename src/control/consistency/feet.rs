//! Foot sensors: sum of the forces against the weight in stance, contact against free fall and against the landing.

use super::inputs::ConsistencyInputs;
use super::leaky::kept;
use crate::control::settings::ControlSettings;
use crate::robot::{GRAVITY, PerLeg};
use crate::telemetry::Mode;

/// Time constant of the averaged sum, s.
const LOAD_S: f64 = 0.1;
/// Averaged specific force above which something carries the robot, as a share of gravity.
const CARRIED_SHARE: f64 = 0.5;
/// Share of the weight below which the feet do not carry the robot.
const UNLOADED_SHARE: f64 = 0.15;

/// History of the foot sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct FootLoads {
    /// Averaged sum of the forces, N, and specific force, m/s^2.
    load_n: f64,
    accel_m_s2: f64,
    /// Times for which the sum has been outside of its limits in stance, for which the robot has been carried without
    /// load on its feet, and for which each foot has been down in free fall, s.
    load_error_s: f64,
    unsupported_s: f64,
    contact_in_free_fall_s: PerLeg<f64>,
}

impl FootLoads {
    pub fn begin(inputs: &ConsistencyInputs) -> FootLoads {
        let accel_m_s2 = inputs.accel_body.norm();
        FootLoads { load_n: inputs.state.foot_force_n.iter().sum(), accel_m_s2, ..FootLoads::default() }
    }

    pub fn update(&mut self, inputs: &ConsistencyInputs, dt_s: f64, settings: &ControlSettings) {
        let limits = &settings.consistency;
        let accel_m_s2 = inputs.accel_body.norm();
        let share = kept(dt_s, LOAD_S);
        self.load_n = self.load_n * share + inputs.state.foot_force_n.iter().sum::<f64>() * (1.0 - share);
        self.accel_m_s2 = self.accel_m_s2 * share + accel_m_s2 * (1.0 - share);
        let lasts = |time_s: f64, holds: bool| if holds { time_s + dt_s } else { 0.0 };

        let standing = matches!(inputs.mode, Mode::Ready | Mode::Countdown);
        let [least, most] =
            [limits.foot_load_least_share, limits.foot_load_most_share].map(|share| share * settings.weight_n);
        let outside = !(least..=most).contains(&self.load_n);
        self.load_error_s = lasts(self.load_error_s, standing && outside);

        let carried = self.accel_m_s2 > CARRIED_SHARE * GRAVITY;
        let unloaded = self.load_n < UNLOADED_SHARE * settings.weight_n;
        let landed = matches!(inputs.mode, Mode::Jump | Mode::Settle | Mode::Review);
        self.unsupported_s = lasts(self.unsupported_s, landed && carried && unloaded);

        let falling = inputs.mode.energised() && accel_m_s2 < limits.free_fall_m_s2;
        for (time_s, down) in self.contact_in_free_fall_s.iter_mut().zip(&inputs.estimate.contact) {
            *time_s = lasts(*time_s, falling && *down);
        }
    }

    pub fn load_n(&self) -> f64 {
        self.load_n
    }

    pub fn load_error_s(&self) -> f64 {
        self.load_error_s
    }

    pub fn unsupported_s(&self) -> f64 {
        self.unsupported_s
    }

    /// The longest time of a foot.
    pub fn contact_in_free_fall_s(&self) -> f64 {
        self.contact_in_free_fall_s.into_iter().fold(0.0, f64::max)
    }
}
