//! What the controller believes about the base and the feet.
//!
//! In simulation it may be the simulator's own truth. Elsewhere, and in simulation if `objective = "estimate"`, it comes
//! from the sensors: the orientation is the inertial unit's; position and velocity are a Kalman filter's (`filter`), which
//! holds the accelerometer against the legs that stand (`contact`); in flight the trunk moves as the accelerometer says.
//!
//! Yaw is what the inertial unit reports. Nothing on the robot can correct it, so its drift is the estimate's.

mod contact;
mod covariance;
mod filter;

use nalgebra::Vector3;

pub use contact::ContactGate;
pub use filter::{Filter, FootMotion};

use super::limits;
use super::settings::{ControlSettings, ObjectiveSource};
use crate::robot::kinematics::Foot;
use crate::robot::{PerLeg, RobotState, Truth, leg_of, robot_time_passed};
use crate::telemetry::Estimate;

/// Acceleration of free fall, m/s^2.
pub const GRAVITY: f64 = 9.81;

/// Keeps what an estimate needs from one tick to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimator {
    estimate: Estimate,
    /// An orientation was seen: yaw counts on from it.
    started: bool,
    contact: ContactGate,
    odometry: Option<Odometry>,
}

/// The filter, and what it last heard.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Odometry {
    filter: Filter,
    robot_time_ms: u32,
    /// Time since a foot was last on the ground, s.
    airborne_s: f64,
}

impl Estimator {
    /// Forgets everything: the robot was put somewhere else.
    pub fn reset(&mut self) {
        *self = Estimator::default();
    }

    /// The filter, where it runs.
    pub fn filter(&self) -> Option<&Filter> {
        self.odometry.as_ref().map(|odometry| &odometry.filter)
    }

    /// The estimate after one more state; `feet` belong to its joint angles. A state that was seen already changes nothing,
    /// nor does one with a number that is not finite (the watchdog stops the robot).
    pub fn update(&mut self, state: &RobotState, feet: &PerLeg<Foot>, settings: &ControlSettings) -> &Estimate {
        let previous_yaw = self.estimate.roll_pitch_yaw.z;
        match &state.truth {
            Some(truth) if settings.objective == ObjectiveSource::Truth => {
                self.estimate.contact = truth.foot_force_world.map(|force| force.z >= settings.contact_force_n);
                self.believe(truth);
            }
            _ if limits::finite(state).is_ok() => self.sense(state, feet, settings),
            _ => return &self.estimate,
        }
        let estimate = &mut self.estimate;
        estimate.foot_position_leg = feet.map(|foot| foot.position_leg);
        let (roll, pitch, yaw) = estimate.orientation_world.euler_angles();
        // Unwrap: the yaw nearest to the previous one, so that a turn of more than pi counts in full.
        let turn = yaw - previous_yaw;
        let unwrapped = if self.started {
            previous_yaw + turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round()
        } else {
            yaw
        };
        if !unwrapped.is_finite() {
            // The watchdog stops the robot; one bad number must not spoil every later yaw.
            estimate.roll_pitch_yaw = Vector3::new(roll, pitch, previous_yaw);
            return &self.estimate;
        }
        self.started = true;
        estimate.roll_pitch_yaw = Vector3::new(roll, pitch, unwrapped);
        &self.estimate
    }

    fn believe(&mut self, truth: &Truth) {
        let estimate = &mut self.estimate;
        estimate.position_world = truth.position_world;
        estimate.velocity_world = truth.velocity_world;
        estimate.orientation_world = truth.orientation_world;
        estimate.angular_velocity_body = truth.angular_velocity_body;
    }

    fn sense(&mut self, state: &RobotState, feet: &PerLeg<Foot>, settings: &ControlSettings) {
        let estimate = &mut self.estimate;
        estimate.orientation_world = state.imu.orientation_world;
        estimate.angular_velocity_body = state.imu.gyro_body;
        let world_from_body = state.imu.orientation_world.to_rotation_matrix().into_inner();
        let unit_world = world_from_body * settings.imu_origin_body;
        let motions = foot_motions(state, feet, settings);
        let chosen = &settings.estimator;

        let passed_ms = |odometry: &Odometry| robot_time_passed(state.robot_time_ms, odometry.robot_time_ms);
        // A clock that goes back is another robot's, or a restarted one's: begin anew.
        let filter = match self.odometry.as_mut().filter(|odometry| passed_ms(odometry) >= 0) {
            Some(odometry) => {
                let dt_s = f64::from(passed_ms(odometry)) * 1e-3;
                if dt_s == 0.0 {
                    return;
                }
                odometry.robot_time_ms = state.robot_time_ms;
                estimate.contact = self.contact.update(&state.foot_force, dt_s, chosen);
                let standing = estimate.contact.contains(&true);
                odometry.airborne_s = if standing { 0.0 } else { odometry.airborne_s + dt_s };
                let filter = &mut odometry.filter;
                if odometry.airborne_s > chosen.longest_flight_s {
                    filter.rest(chosen);
                } else {
                    filter.predict(&state.imu.accel_body, &world_from_body, &motions, dt_s, chosen);
                    filter.correct(&motions, &estimate.contact, dt_s, chosen);
                }
                &*filter
            }
            None => {
                self.contact = ContactGate::default();
                estimate.contact = self.contact.update(&state.foot_force, 0.0, chosen);
                // The world's origin is the ground under the trunk; the lowest foot stands on it.
                let lowest = motions.iter().map(|motion| motion.offset_world.z).fold(f64::INFINITY, f64::min);
                let start = Vector3::new(unit_world.x, unit_world.y, settings.foot_radius - lowest);
                let mut filter = Filter::new(&start, chosen);
                filter.correct(&motions, &estimate.contact, 0.0, chosen);
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

/// How each foot moves relative to the inertial unit, and over the ground if it rolls there.
fn foot_motions(state: &RobotState, feet: &PerLeg<Foot>, settings: &ControlSettings) -> PerLeg<FootMotion> {
    let rotation = state.imu.orientation_world;
    let gyro_body = state.imu.gyro_body;
    std::array::from_fn(|leg| {
        let (q, dq) = (leg_of(&state.joint_position, leg), leg_of(&state.joint_velocity, leg));
        let offset_body = settings.hip_origin_body[leg] + feet[leg].position_leg - settings.imu_origin_body;
        let velocity_body = gyro_body.cross(&offset_body) + feet[leg].jacobian_leg * dq;
        // The calf turns about the hip's x axis and about the y axis that the hip has turned by q1.
        let (s1, c1) = q.x.sin_cos();
        let swing = dq.y + dq.z;
        let calf_rate_world = rotation * (gyro_body + Vector3::new(dq.x, c1 * swing, s1 * swing));
        FootMotion {
            offset_world: rotation * offset_body,
            velocity_world: rotation * velocity_body,
            // A ball on level ground: omega x r, r from the point of contact up to the centre.
            rolling_world: calf_rate_world.cross(&Vector3::new(0.0, 0.0, settings.foot_radius)),
        }
    })
}
