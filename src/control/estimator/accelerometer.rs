//! The accelerometer's samples. One beyond the largest possible value is no measurement: the last possible one holds.

use nalgebra::Vector3;

use crate::control::settings::ConsistencyLimits;
use crate::robot::{GRAVITY, Imu};
use crate::telemetry::Fault;

/// Most impossible samples in a row. Beyond the shipped limit the simulated landings have two.
pub const MOST_IN_A_ROW: u32 = 5;
/// Most impossible samples within the time constant of their count, which is 1 s.
pub const MOST_RECENT: f64 = 10.0;
const RECENT_S: f64 = 1.0;

/// The last possible specific force, and the impossible ones since.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Accelerometer {
    /// Body axes, m/s^2.
    possible_body: Option<Vector3<f64>>,
    /// Largest component of the last impossible sample, m/s^2.
    impossible_m_s2: f64,
    /// Impossible samples in a row, and within the last second.
    in_a_row: u32,
    recent: f64,
}

impl Accelerometer {
    /// Takes the sample of a new state, `dt_s` after the last one; returns whether it is possible. `most_m_s2` is the largest component;
    /// none for a simulator, whose sensors have no faults.
    pub fn update(&mut self, imu: &Imu, dt_s: f64, most_m_s2: Option<f64>) -> bool {
        self.recent *= (1.0 - dt_s / RECENT_S).max(0.0);
        let largest_m_s2 = imu.accel_body.amax();
        let possible = most_m_s2.is_none_or(|most| largest_m_s2 <= most);
        if possible {
            self.possible_body = Some(imu.accel_body);
            self.in_a_row = 0;
        } else {
            // Before the first one: that of a robot at rest.
            let resting = || imu.world_from_body.inverse_transform_vector(&Vector3::new(0.0, 0.0, GRAVITY));
            self.possible_body.get_or_insert_with(resting);
            self.impossible_m_s2 = largest_m_s2;
            self.in_a_row = self.in_a_row.saturating_add(1);
            self.recent += 1.0;
        }
        possible
    }

    /// The last possible specific force, body axes, m/s^2; zero before the first state.
    pub fn body(&self) -> Vector3<f64> {
        self.possible_body.unwrap_or_default()
    }

    /// The fault of too many impossible samples.
    pub fn fault(&self, limits: &ConsistencyLimits) -> Option<Fault> {
        (self.in_a_row > MOST_IN_A_ROW || self.recent > MOST_RECENT).then_some(Fault::Acceleration {
            measured_m_s2: self.impossible_m_s2,
            allowed_m_s2: limits.accel_most_m_s2,
            states: self.in_a_row.max(self.recent.round() as u32),
        })
    }
}
