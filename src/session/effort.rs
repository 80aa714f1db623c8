//! Take-off and motor effort of a trial: pure functions of its recorded ticks.

use serde::{Deserialize, Serialize};

use crate::robot::{JOINT_NAMES, Joints};
use crate::telemetry::Tick;

/// Take-off, torques, powers and speeds of a trial, from its first impulse on.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct JumpEffort {
    /// Angle of the trunk's velocity above the horizontal when the longest flight begins, rad; 0 without a flight.
    pub takeoff_angle_rad: f64,
    /// Speed of the trunk then, m/s.
    pub takeoff_speed_m_s: f64,
    /// Largest torque of a hip, a thigh and a calf motor, N m, without sign.
    pub peak_torque_n_m: [f64; 3],
    /// The same after the longest flight.
    pub landing_torque_n_m: [f64; 3],
    /// Largest sum of the motors' positive mechanical powers, W.
    pub peak_power_w: f64,
    /// Largest positive mechanical power of one motor, W.
    pub joint_power_w: f64,
    /// Largest speed of a joint, rad/s, without sign.
    pub joint_speed_rad_s: f64,
}

/// Returns the effort of a trial; none if its ticks end before the first impulse.
pub fn effort(ticks: &[Tick]) -> Option<JumpEffort> {
    let first = ticks.iter().position(|tick| tick.trial_time_s >= 0.0 && tick.trial.is_some())?;
    let ticks = &ticks[first..];
    let (start, end) = longest_flight(ticks);
    let mut effort = JumpEffort::default();
    if end > start {
        let velocity = ticks[start].estimate.velocity_world;
        effort.takeoff_angle_rad = libm::atan2(velocity.z, velocity.xy().norm());
        effort.takeoff_speed_m_s = velocity.norm();
    }
    for (index, tick) in ticks.iter().enumerate() {
        let (torque, speed) = (&tick.state.joint_torque_n_m, &tick.state.joint_velocity_rad_s);
        raise(&mut effort.peak_torque_n_m, torque);
        if end > start && index >= end {
            raise(&mut effort.landing_torque_n_m, torque);
        }
        let powers = torque.iter().zip(speed).map(|(torque, speed)| (torque * speed).max(0.0));
        effort.peak_power_w = powers.clone().sum::<f64>().max(effort.peak_power_w);
        effort.joint_power_w = powers.fold(effort.joint_power_w, f64::max);
        effort.joint_speed_rad_s = speed.iter().fold(effort.joint_speed_rad_s, |most, speed| speed.abs().max(most));
    }
    Some(effort)
}

/// Raises the largest torque of each kind of joint.
fn raise(most: &mut [f64; 3], torque: &Joints) {
    for (joint, torque) in torque.iter().enumerate() {
        let kind = &mut most[joint % JOINT_NAMES.len()];
        *kind = kind.max(torque.abs());
    }
}

/// Returns the first tick of the longest time without a foot on the ground, and the first after it; equal without a flight.
fn longest_flight(ticks: &[Tick]) -> (usize, usize) {
    let (mut longest, mut start) = ((0, 0), 0);
    for (index, tick) in ticks.iter().enumerate() {
        if tick.estimate.contact.iter().any(|&down| down) {
            start = index + 1;
        } else if index + 1 - start > longest.1 - longest.0 {
            longest = (start, index + 1);
        }
    }
    longest
}
