//! Sensor errors: noise and bias of the inertial unit, encoder steps, resolution of the foot forces, delay. Drawn once
//! per control period from the trial's seed.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::config::SensorConfig;
use super::streams;
use crate::robot::RobotState;
use crate::robot::rotation::from_scaled_axis;

/// Longest delay, ms.
pub(super) const MAX_DELAY: usize = 20;
/// Time constant of the orientation's random drift, ms. Assumption: the order of an attitude filter's time constant.
const ORIENTATION_DRIFT_MS: f64 = 1000.0;

/// The sensors and their errors.
#[derive(Debug, Clone)]
pub(super) struct Sensors {
    config: SensorConfig,
    random: ChaCha8Rng,
    gyro_bias: Vector3<f64>,
    accel_bias: Vector3<f64>,
    /// Error of the orientation as a rotation vector, body axes, rad.
    tilt: Vector3<f64>,
    /// Ring of the last measured states.
    past: [RobotState; MAX_DELAY + 1],
    measured: usize,
}

impl Sensors {
    pub fn new(config: &SensorConfig) -> Sensors {
        Sensors {
            config: *config,
            random: streams::random(0, streams::SENSORS),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            tilt: Vector3::zeros(),
            past: [RobotState::default(); MAX_DELAY + 1],
            measured: 0,
        }
    }

    /// Starts a trial: draws the biases and discards past states.
    pub fn reset(&mut self, seed: u64) {
        self.random = streams::random(seed, streams::SENSORS);
        self.measured = 0;
        let config = self.config;
        self.gyro_bias = self.normal(config.gyro_bias_rad_s);
        self.accel_bias = self.normal(config.accel_bias_m_s2);
        self.tilt = self.normal(config.orientation_noise_rad);
    }

    /// Returns the reported state for the true state `exact`; called once per control period, and for each state that is set while a
    /// robot is placed. `truth` stays exact and is not delayed.
    pub fn measure(&mut self, exact: &RobotState) -> RobotState {
        if !self.config.enabled {
            return *exact;
        }
        let now = self.distort(exact);
        let slots = self.past.len();
        self.past[self.measured % slots] = now;
        let age = (self.config.delay_ms as usize).min(self.measured);
        let old = self.past[(self.measured - age) % slots];
        self.measured += 1;
        RobotState { truth: exact.truth, ..old }
    }

    fn distort(&mut self, exact: &RobotState) -> RobotState {
        let config = self.config;
        let mut state = *exact;
        state.imu.gyro_body += self.gyro_bias + self.normal(config.gyro_noise_rad_s);
        state.imu.accel_body += self.accel_bias + self.normal(config.accel_noise_m_s2);
        // Ornstein-Uhlenbeck: e' = e (1 - dt/T) + sigma sqrt(2 dt/T) n keeps the standard deviation sigma.
        let share = 1.0 / ORIENTATION_DRIFT_MS;
        self.tilt = self.tilt * (1.0 - share) + self.normal(config.orientation_noise_rad * (2.0 * share).sqrt());
        state.imu.world_from_body *= from_scaled_axis(self.tilt);
        for q in &mut state.joint_position_rad {
            *q = rounded(*q, config.encoder_step_rad);
        }
        for dq in &mut state.joint_velocity_rad_s {
            *dq += self.sample(config.joint_velocity_noise_rad_s);
        }
        for force in &mut state.foot_force_n {
            let noisy = *force + self.sample(config.foot_force_noise_n);
            *force = rounded(noisy.max(0.0), config.foot_force_step_n);
        }
        state
    }

    fn sample(&mut self, deviation: f64) -> f64 {
        // In single precision: in the tails the logarithm of the C library counts, whose last bit is not that of every machine.
        let n: f32 = StandardNormal.sample(&mut self.random);
        deviation * f64::from(n)
    }

    fn normal(&mut self, deviation: f64) -> Vector3<f64> {
        let mut sample = || self.sample(deviation);
        Vector3::new(sample(), sample(), sample())
    }
}

/// Rounds `x` to whole steps; a step of zero means no rounding.
fn rounded(x: f64, step: f64) -> f64 {
    if step > 0.0 { (x / step).round() * step } else { x }
}
