//! The inertial unit: stuck values, gravity against the orientation, orientation against the gyroscope.

use nalgebra::Vector3;

use super::inputs::StateStep;
use super::leaky::kept;
use crate::robot::rotation::{angle_between, scaled_axis};
use crate::robot::{GRAVITY, Imu};

/// Time constant of the averaged accelerometer at rest, s.
const REST_S: f64 = 0.25;
/// Time constant with which the accelerometer corrects the upward direction from the gyroscope, s. A landing that
/// deviates by 0.5 rad for 0.1 s turns it by 0.025 rad.
const CORRECTION_S: f64 = 2.0;
/// The same while the robot is not energised: a person may have turned it where no state arrived.
const RESTING_CORRECTION_S: f64 = 0.2;
/// Largest deviation of the specific force's magnitude from gravity at which it corrects, m/s^2.
const CORRECTING_M_S2: f64 = 1.5;
/// Time constant of the sum of the orientation's rotation less that of the gyroscope, s.
const TURN_S: f64 = 0.2;
/// Angular velocity that a long gap may hide, rad/s. Largest rest of 60 simulated jumps: 0.045 rad after 15 ms, 0.067 rad after 20 ms.
const HIDDEN_RAD_S: f64 = 5.0;

/// History of the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct InertialUnit {
    /// States in a row with the same angular velocity, specific force and orientation, each by itself.
    repeated: [u32; 3],
    /// Averaged specific force, body axes, m/s^2.
    accel_body: Vector3<f64>,
    /// Upward direction from gyroscope and accelerometer, body axes, and from the orientation.
    up_body: Vector3<f64>,
    reported_up_body: Vector3<f64>,
    /// Rotation of the orientation less that of the gyroscope, rad.
    turn_error: Vector3<f64>,
}

fn reported_up(imu: &Imu) -> Vector3<f64> {
    imu.world_from_body.inverse_transform_vector(&Vector3::z())
}

impl InertialUnit {
    /// Begins with the specific force as the upward direction, if its magnitude is about that of gravity.
    pub fn begin(imu: &Imu, accel_body: &Vector3<f64>) -> InertialUnit {
        let magnitude = accel_body.norm();
        let at_rest = (magnitude - GRAVITY).abs() < CORRECTING_M_S2;
        let reported_up_body = reported_up(imu);
        InertialUnit {
            repeated: [0; 3],
            // Not the first measurement: one sample, of a robot that was just laid down, is no average.
            accel_body: reported_up_body * GRAVITY,
            up_body: if at_rest { accel_body / magnitude } else { reported_up_body },
            reported_up_body,
            turn_error: Vector3::zeros(),
        }
    }

    /// `accel_body` is the specific force of the estimator.
    pub fn update(&mut self, last: &Imu, now: &Imu, accel_body: &Vector3<f64>, step: &StateStep, energised: bool) {
        let same = [
            last.gyro_body == now.gyro_body,
            last.accel_body == now.accel_body,
            last.world_from_body.coords == now.world_from_body.coords,
        ];
        for (count, same) in self.repeated.iter_mut().zip(same) {
            *count = if same { count.saturating_add(1) } else { 0 };
        }
        let share = kept(step.dt_s, REST_S);
        self.accel_body = self.accel_body * share + accel_body * (1.0 - share);
        self.reported_up_body = reported_up(now);
        let turn = last.world_from_body.inverse() * now.world_from_body;
        if step.is_compared {
            let measured = (last.gyro_body + now.gyro_body) * (0.5 * step.dt_s);
            let reported = scaled_axis(&turn);
            // Of the reported turn a gap hides as much as the gyroscope's change allows; the rest is an error.
            let allowed_rad = step.allowance_rad((now.gyro_body - last.gyro_body).norm(), HIDDEN_RAD_S);
            let turned = measured + (reported - measured).cap_magnitude(allowed_rad);
            // d(R^T z)/dt = -omega x R^T z, to the second order: a gap may turn by 0.3 rad.
            let change = turned.cross(&self.up_body);
            self.up_body += turned.cross(&change) * 0.5 - change;
            self.turn_error = self.turn_error * kept(step.dt_s, TURN_S) + reported - turned;
        } else {
            self.up_body = turn.inverse_transform_vector(&self.up_body);
        }
        let magnitude = accel_body.norm();
        if (magnitude - GRAVITY).abs() < CORRECTING_M_S2 {
            let time_s = if energised { CORRECTION_S } else { RESTING_CORRECTION_S };
            let share = kept(step.dt_s, time_s);
            self.up_body = self.up_body * share + accel_body * ((1.0 - share) / magnitude);
        }
        self.up_body.try_normalize_mut(1e-9);
    }

    pub fn repeated_states(&self) -> u32 {
        self.repeated.into_iter().max().unwrap_or(0)
    }

    /// Deviation of the averaged specific force's magnitude from gravity.
    pub fn gravity_error_m_s2(&self) -> f64 {
        (self.accel_body.norm() - GRAVITY).abs()
    }

    /// Angle from the averaged specific force to the orientation's upward direction.
    pub fn resting_tilt_error_rad(&self) -> f64 {
        angle_between(&self.accel_body, &self.reported_up_body)
    }

    /// Angle from the upward direction by gyroscope and accelerometer to that of the orientation.
    pub fn tilt_error_rad(&self) -> f64 {
        angle_between(&self.up_body, &self.reported_up_body)
    }

    pub fn turn_error_rad(&self) -> f64 {
        self.turn_error.norm()
    }
}
