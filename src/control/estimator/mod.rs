//! Estimate of the base and the feet.
//!
//! In simulation it may be the simulator's true state. On hardware, and in simulation if `objective = "estimate"`, it comes from
//! the sensors: orientation from the inertial unit; position and velocity from a Kalman filter (`filter`) of the accelerometer and
//! the standing legs (`contact`), in flight of the accelerometer alone.
//!
//! Yaw is that of the inertial unit, with its drift: no other sensor measures it.

mod accelerometer;
mod contact;
pub mod covariance;
mod filter;

use nalgebra::Vector3;

pub use contact::ContactGate;
pub use filter::{Filter, FootOdometry};

use super::command_gate;
use super::settings::{ConsistencyLimits, ControlSettings, ObjectiveSource};
use crate::robot::kinematics::FootPosition;
use crate::robot::rotation::roll_pitch_yaw;
use crate::robot::{PerLeg, RobotState, Truth, leg_of, robot_time_passed};
use crate::telemetry::{Estimate, Fault};
use accelerometer::Accelerometer;
pub use accelerometer::{MOST_IN_A_ROW, MOST_RECENT};

/// Estimator with its state from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimator {
    estimate: Estimate,
    /// Whether there was an orientation, from which yaw is unwrapped.
    started: bool,
    contact: ContactGate,
    accelerometer: Accelerometer,
    odometry: Option<Odometry>,
}

/// The filter and the time of its last state.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Odometry {
    filter: Filter,
    robot_time_ms: u32,
    /// Time since a foot was last on the ground, s.
    airborne_s: f64,
}

impl Estimator {
    /// Resets everything, after a placement.
    pub fn reset(&mut self) {
        *self = Estimator::default();
    }

    /// The filter; none before the first state, or with the simulator's true state.
    pub fn filter(&self) -> Option<&Filter> {
        self.odometry.as_ref().map(|odometry| &odometry.filter)
    }

    /// The specific force that is integrated, body axes, m/s^2: the last possible one.
    pub fn accel_body(&self) -> Vector3<f64> {
        self.accelerometer.body()
    }

    /// The fault of an accelerometer with too many impossible values.
    pub fn accelerometer_fault(&self, limits: &ConsistencyLimits) -> Option<Fault> {
        self.accelerometer.fault(limits)
    }

    /// Updates the estimate with a state and the feet at its joint angles. A repeated state, or one with a number that is not finite
    /// (a failsafe stops the robot), changes nothing.
    pub fn update(&mut self, state: &RobotState, feet: &PerLeg<FootPosition>, settings: &ControlSettings) -> &Estimate {
        let previous_yaw = self.estimate.roll_pitch_yaw.z;
        match &state.truth {
            Some(truth) if settings.objective == ObjectiveSource::Truth => {
                self.estimate.contact = truth.foot_force_world.map(|force| force.z >= settings.contact_force_n);
                self.copy_truth(truth);
            }
            _ if command_gate::finite(state).is_ok() => self.fuse_sensors(state, feet, settings),
            _ => return &self.estimate,
        }
        let estimate = &mut self.estimate;
        estimate.foot_position_leg = feet.map(|foot| foot.position_leg);
        let (roll, pitch, yaw) = roll_pitch_yaw(&estimate.world_from_body);
        // Unwrap: the yaw nearest to the previous one, so that a turn of more than pi counts in full.
        let turn = yaw - previous_yaw;
        let unwrapped = if self.started {
            previous_yaw + turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round()
        } else {
            yaw
        };
        if !unwrapped.is_finite() {
            // A failsafe stops the robot; the yaw of later states stays valid.
            estimate.roll_pitch_yaw = Vector3::new(roll, pitch, previous_yaw);
            return &self.estimate;
        }
        self.started = true;
        estimate.roll_pitch_yaw = Vector3::new(roll, pitch, unwrapped);
        &self.estimate
    }

    fn copy_truth(&mut self, truth: &Truth) {
        let estimate = &mut self.estimate;
        estimate.position_world = truth.position_world;
        estimate.velocity_world = truth.velocity_world;
        estimate.world_from_body = truth.world_from_body;
        estimate.angular_velocity_body = truth.angular_velocity_body;
    }

    fn fuse_sensors(&mut self, state: &RobotState, feet: &PerLeg<FootPosition>, settings: &ControlSettings) {
        let estimate = &mut self.estimate;
        estimate.world_from_body = state.imu.world_from_body;
        estimate.angular_velocity_body = state.imu.gyro_body;
        let world_from_body = state.imu.world_from_body.to_rotation_matrix().into_inner();
        let unit_world = world_from_body * settings.imu_origin_body;
        let motions = foot_motions(state, feet, settings);
        let weights = &settings.estimator;

        let most_m_s2 = settings.hardware.then_some(settings.consistency.accel_most_m_s2);
        let passed_ms = |odometry: &Odometry| robot_time_passed(state.robot_time_ms, odometry.robot_time_ms);
        // A clock that goes back belongs to another or a restarted robot: start again.
        let filter = match self.odometry.as_mut().filter(|odometry| passed_ms(odometry) >= 0) {
            Some(odometry) => {
                let dt_s = f64::from(passed_ms(odometry)) * 1e-3;
                if dt_s == 0.0 {
                    return;
                }
                odometry.robot_time_ms = state.robot_time_ms;
                estimate.contact = self.contact.update(&state.foot_force_n, dt_s, weights);
                let standing = estimate.contact.contains(&true);
                odometry.airborne_s = if standing { 0.0 } else { odometry.airborne_s + dt_s };
                let measured = self.accelerometer.update(&state.imu, dt_s, most_m_s2);
                let accel_body = self.accelerometer.body();
                let filter = &mut odometry.filter;
                if odometry.airborne_s > weights.longest_flight_s {
                    filter.rest(weights);
                } else {
                    filter.predict(&accel_body, measured, &world_from_body, &motions, dt_s, weights);
                    filter.correct(&motions, &estimate.contact, dt_s, weights);
                }
                &*filter
            }
            None => {
                self.contact = ContactGate::default();
                self.accelerometer = Accelerometer::default();
                self.accelerometer.update(&state.imu, 0.0, most_m_s2);
                estimate.contact = self.contact.update(&state.foot_force_n, 0.0, weights);
                // The world's origin is the ground under the trunk; the lowest foot stands on it.
                let lowest = motions.iter().map(|motion| motion.offset_world.z).fold(f64::INFINITY, f64::min);
                let start = Vector3::new(unit_world.x, unit_world.y, settings.foot_radius - lowest);
                let mut filter = Filter::new(&start, weights);
                filter.correct(&motions, &estimate.contact, 0.0, weights);
                let begun = Odometry { filter, robot_time_ms: state.robot_time_ms, airborne_s: 0.0 };
                &self.odometry.insert(begun).filter
            }
        };
        // From the unit to the trunk's origin: p - R r, v - R (omega x r).
        let lever = state.imu.gyro_body.cross(&settings.imu_origin_body);
        estimate.position_world = filter.position_world() - unit_world;
        estimate.velocity_world = filter.velocity_world() - world_from_body * lever;
    }
}

/// Motion of each foot relative to the inertial unit, and of a rolling foot over the ground.
fn foot_motions(state: &RobotState, feet: &PerLeg<FootPosition>, settings: &ControlSettings) -> PerLeg<FootOdometry> {
    let rotation = state.imu.world_from_body;
    let gyro_body = state.imu.gyro_body;
    std::array::from_fn(|leg| {
        let (q, dq) = (leg_of(&state.joint_position_rad, leg), leg_of(&state.joint_velocity_rad_s, leg));
        let offset_body = settings.hip_origin_body[leg] + feet[leg].position_leg - settings.imu_origin_body;
        let velocity_body = gyro_body.cross(&offset_body) + feet[leg].jacobian_leg * dq;
        // The calf turns about the hip's x axis and about the y axis that the hip has turned by q1.
        let (s1, c1) = libm::sincos(q.x);
        let swing = dq.y + dq.z;
        let calf_rate_world = rotation * (gyro_body + Vector3::new(dq.x, c1 * swing, s1 * swing));
        FootOdometry {
            offset_world: rotation * offset_body,
            velocity_world: rotation * velocity_body,
            // A ball on level ground: omega x r, r from the point of contact up to the centre.
            rolling_world: calf_rate_world.cross(&Vector3::new(0.0, 0.0, settings.foot_radius)),
        }
    })
}
