//! Quantities and curves of one recorded jump: pure functions of the trial's ticks.
//!
//! | quantity | equation |
//! |---|---|
//! | take-off | first tick of the first flight, the first absence of all feet of at least 20 ms |
//! | take-off velocity angle | atan2(v.z, sqrt(v.x^2 + v.y^2)) of the trunk's velocity v at take-off, from the horizontal |
//! | force angle | atan2(Fz, sqrt(Fx^2 + Fy^2)) of the amplitudes of a foot (paper, equation 2, and its remark on Fx 140 N, Fz 239 N) |
//! | power of a joint | tau omega of the reported torque and velocity |
//! | push power | largest sum over the joints of max(tau omega, 0), from the beginning of the impulse to take-off |
//!
//! Peak torques are the largest absolute reported torques of the four joints of a kind. On hardware torque and velocity
//! are those that the motors report.

use nalgebra::Vector3;
use serde::Serialize;

use super::figure::thinned;
use crate::control::foot_placement::SHORTEST_FLIGHT_S;
use crate::control::force_profile::amplitudes_leg;
use crate::robot::description::RobotDescription;
use crate::robot::{JOINTS, LEGS, PerLeg, ticks_in};
use crate::telemetry::Tick;
use crate::trial::{JumpParameters, Task};

/// Number of kinds of joints: hip, thigh, calf.
pub const KINDS: usize = 3;
/// Parts of a curve in which the lowest and the highest point are kept.
const PARTS: usize = 500;

/// Take-off, torque and power of one jump.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JumpQuantities {
    /// Take-off since the beginning of the impulse, s.
    pub takeoff_s: f64,
    /// Speed of the trunk at take-off, m/s.
    pub takeoff_speed_m_s: f64,
    /// Angle of that velocity from the horizontal, rad.
    pub takeoff_angle_rad: f64,
    /// Largest absolute torque of hip, thigh and calf from the beginning of the impulse to take-off, N m.
    pub push_torque_n_m: [f64; KINDS],
    /// The same from take-off to the end of the ticks: flight and landing.
    pub landing_torque_n_m: [f64; KINDS],
    /// Largest sum of the positive powers of all joints before take-off, W.
    pub push_power_w: f64,
    /// Largest power of one hip, thigh and calf before take-off, W.
    pub joint_power_w: [f64; KINDS],
}

impl JumpQuantities {
    /// Measures the first jump of a trial's ticks; none without an impulse or without a flight.
    pub fn of(ticks: &[Tick]) -> Option<JumpQuantities> {
        let ticks = begun(ticks);
        let takeoff = takeoff(ticks)?;
        let (push, rest) = ticks.split_at(takeoff);
        let velocity = rest[0].estimate.velocity_world;
        Some(JumpQuantities {
            takeoff_s: rest[0].trial_time_s,
            takeoff_speed_m_s: velocity.norm(),
            takeoff_angle_rad: elevation_rad(&velocity),
            push_torque_n_m: largest(push, torque),
            landing_torque_n_m: largest(rest, torque),
            push_power_w: push.iter().map(positive_power_w).fold(0.0, f64::max),
            joint_power_w: largest(push, power),
        })
    }
}

/// Returns the ticks from the beginning of the impulse on.
fn begun(ticks: &[Tick]) -> &[Tick] {
    let first = ticks.iter().position(|tick| tick.trial_time_s >= 0.0 && tick.trial.is_some());
    &ticks[first.unwrap_or(ticks.len())..]
}

/// Returns the index of the first tick of the first flight.
fn takeoff(ticks: &[Tick]) -> Option<usize> {
    let needed = ticks_in(SHORTEST_FLIGHT_S) as usize;
    let mut airborne = 0;
    ticks.iter().enumerate().find_map(|(at, tick)| {
        airborne = if tick.estimate.contact.iter().any(|&down| down) { 0 } else { airborne + 1 };
        (airborne == needed).then(|| at + 1 - needed)
    })
}

/// Angle of a vector from the horizontal, rad; upward positive.
fn elevation_rad(vector: &Vector3<f64>) -> f64 {
    vector.z.atan2(vector.x.hypot(vector.y))
}

/// Returns the angle of the profile's force from the horizontal, rad, for the front right foot; those of the others are
/// the same.
pub fn force_angle_rad(jump: &JumpParameters, task: Task) -> f64 {
    elevation_rad(&amplitudes_leg(jump, task)[0])
}

fn torque(tick: &Tick, joint: usize) -> f64 {
    tick.state.joint_torque_n_m[joint].abs()
}

fn power(tick: &Tick, joint: usize) -> f64 {
    tick.state.joint_torque_n_m[joint] * tick.state.joint_velocity_rad_s[joint]
}

/// Returns the sum of the positive powers of all joints, W.
fn positive_power_w(tick: &Tick) -> f64 {
    (0..JOINTS).map(|joint| power(tick, joint).max(0.0)).sum()
}

/// Returns the largest value of each kind of joint in one tick.
fn of_kinds(tick: &Tick, value: fn(&Tick, usize) -> f64) -> [f64; KINDS] {
    std::array::from_fn(|kind| (0..LEGS).map(|leg| value(tick, KINDS * leg + kind)).fold(0.0, f64::max))
}

fn largest(ticks: &[Tick], value: fn(&Tick, usize) -> f64) -> [f64; KINDS] {
    ticks.iter().fold([0.0; KINDS], |most, tick| {
        let kinds = of_kinds(tick, value);
        std::array::from_fn(|kind| most[kind].max(kinds[kind]))
    })
}

/// Curves of a trial over the time since the impulse began, s; thinned without loss of peaks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JumpCurves {
    /// Roll, rad.
    pub roll_rad: Vec<[f64; 2]>,
    /// Pitch, rad.
    pub pitch_rad: Vec<[f64; 2]>,
    /// Height of each foot above its height when the impulse began, world, m.
    pub foot_height_m: PerLeg<Vec<[f64; 2]>>,
    /// Largest absolute torque of the four hips, thighs and calves, N m.
    pub torque_n_m: [Vec<[f64; 2]>; KINDS],
    /// Sum of the positive powers of all joints, W.
    pub positive_power_w: Vec<[f64; 2]>,
}

impl JumpCurves {
    /// Returns the curves of a trial's ticks, from `before_s` before the impulse on; empty for ticks that end before it.
    pub fn of(ticks: &[Tick], robot: &RobotDescription, before_s: f64) -> JumpCurves {
        let Some(start) = begun(ticks).first() else { return JumpCurves::default() };
        let from = ticks.iter().position(|tick| tick.trial.is_some() && tick.trial_time_s >= -before_s).unwrap_or(0);
        let ticks = &ticks[from..];
        let curve = |value: &dyn Fn(&Tick) -> f64| {
            let points: Vec<[f64; 2]> = ticks.iter().map(|tick| [tick.trial_time_s, value(tick)]).collect();
            thinned(&points, PARTS)
        };
        let height = |tick: &Tick, leg: usize| {
            let foot_body = robot.legs[leg].joint_origin[0] + tick.estimate.foot_position_leg[leg];
            tick.estimate.position_world.z + (tick.estimate.world_from_body * foot_body).z
        };
        JumpCurves {
            roll_rad: curve(&|tick| tick.estimate.roll_pitch_yaw.x),
            pitch_rad: curve(&|tick| tick.estimate.roll_pitch_yaw.y),
            foot_height_m: std::array::from_fn(|leg| curve(&|tick| height(tick, leg) - height(start, leg))),
            torque_n_m: std::array::from_fn(|kind| curve(&|tick| of_kinds(tick, torque)[kind])),
            positive_power_w: curve(&positive_power_w),
        }
    }
}
