//! The phase oscillator and the half-sine force profile (paper, equations 1 and 2).

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use crate::robot::{LEGS, Leg, PerLeg};
use crate::trial::{JumpParameters, Task};

/// The oscillator as a function of the time since it entered theta = pi, so that no error of integration adds up.
///
/// theta_dot = 2 pi f0 while pi <= theta < 2 pi (impulse), 2 pi f1 while 0 <= theta < pi (off phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// Frequency of the impulse phase, Hz.
    pub f0_hz: f64,
    /// Frequency of the off phase, Hz; zero holds the oscillator after one impulse (single jump).
    pub f1_hz: f64,
}

impl Oscillator {
    /// Duration of one impulse, s: T_impulse = 1 / (2 f0).
    pub fn impulse_s(&self) -> f64 {
        0.5 / self.f0_hz
    }

    /// From one impulse to the next, s: T_impulse + T_off, with T_off = 1 / (2 f1); infinite for a single jump.
    pub fn period_s(&self) -> f64 {
        self.impulse_s() + if self.f1_hz > 0.0 { 0.5 / self.f1_hz } else { f64::INFINITY }
    }

    /// The phase theta in [0, 2 pi), rad, at `time_s` since theta first was pi. Before that, and after the impulse of
    /// a single jump, the oscillator rests at zero.
    pub fn theta_rad(&self, time_s: f64) -> f64 {
        if time_s < 0.0 {
            return 0.0;
        }
        let period = self.period_s();
        let in_period = if period.is_finite() { time_s % period } else { time_s };
        let impulse = self.impulse_s();
        if in_period < impulse { PI + TAU * self.f0_hz * in_period } else { TAU * self.f1_hz * (in_period - impulse) }
    }
}

/// Force of the profile that a foot exerts, leg frame, N:
/// F = `[Fx Fy Fz]` sin(theta) if sin(theta) < 0, else 0.
pub fn force_leg(amplitude_leg: &Vector3<f64>, theta_rad: f64) -> Vector3<f64> {
    amplitude_leg * libm::sin(theta_rad).min(0.0)
}

/// Returns the amplitude across the direction of `task`: optional, and the only one that may be negative. `Fx` is positive
/// forward in every task, `Fy` of a forward jump to the left (`docs/method.md`, "Amplitude signs").
pub const fn second_direction(task: Task) -> &'static str {
    match task {
        Task::Forward => "Fy",
        Task::LateralLeft | Task::LateralRight | Task::TwistCcw | Task::TwistCw => "Fx",
    }
}

/// Returns the amplitude `[Fx Fy Fz]` of each foot with the signs of `task` (`docs/method.md`, "Amplitude signs"): the
/// force that the foot exerts divided by sin(theta), leg frame, N.
pub fn amplitudes_leg(jump: &JumpParameters, task: Task) -> PerLeg<Vector3<f64>> {
    let mut amplitudes = [Vector3::zeros(); LEGS];
    for (amplitude, leg) in amplitudes.iter_mut().zip(Leg::ALL) {
        let y_sign = match task {
            Task::Forward | Task::LateralLeft => 1.0,
            Task::LateralRight => -1.0,
            Task::TwistCcw => leg.front_sign(),
            Task::TwistCw => -leg.front_sign(),
        };
        *amplitude = Vector3::new(jump.fx_n, y_sign * jump.fy_n, jump.fz_n);
    }
    amplitudes
}
