//! Take-off and motor effort of a trial from its ticks.

use nalgebra::Vector3;
use quadfrog::session::effort::{JumpEffort, effort};
use quadfrog::telemetry::Tick;

/// A tick at `time_s`, on four feet or on none, with the torque and speed of one joint.
fn tick(time_s: f64, down: bool, joint: usize, torque_n_m: f64, speed_rad_s: f64) -> Tick {
    let mut tick = Tick { trial: Some(0), trial_time_s: time_s, ..Tick::default() };
    tick.estimate.contact = [down; 4];
    tick.estimate.velocity_world = Vector3::new(3.0 * time_s, 0.0, 4.0 * time_s);
    tick.state.joint_torque_n_m[joint] = torque_n_m;
    tick.state.joint_velocity_rad_s[joint] = speed_rad_s;
    tick
}

#[test]
fn takeoff_is_the_start_of_the_longest_flight_and_landing_torque_what_follows_it() {
    let ticks = [
        // The countdown does not count.
        tick(-1.0, true, 0, 90.0, 90.0),
        tick(0.0, true, 1, -20.0, 10.0),
        tick(0.1, false, 1, 5.0, 0.0),
        tick(0.2, true, 2, 30.0, -2.0),
        tick(1.0, false, 0, 3.0, -40.0),
        tick(1.1, false, 0, 3.0, 7.0),
        tick(1.2, true, 5, -8.0, -6.0),
    ];
    let JumpEffort {
        takeoff_angle_rad,
        takeoff_speed_m_s,
        peak_torque_n_m,
        landing_torque_n_m,
        peak_power_w,
        joint_power_w,
        joint_speed_rad_s,
    } = effort(&ticks).unwrap();
    assert!((takeoff_angle_rad - (4.0_f64 / 3.0).atan()).abs() < 1e-12);
    assert!((takeoff_speed_m_s - 5.0).abs() < 1e-12);
    assert_eq!(peak_torque_n_m, [3.0, 20.0, 30.0]);
    assert_eq!(landing_torque_n_m, [0.0, 0.0, 8.0]);
    assert_eq!((peak_power_w, joint_power_w, joint_speed_rad_s), (48.0, 48.0, 40.0));
}

#[test]
fn powers_of_joints_add_up_and_braking_is_no_power() {
    let mut both = tick(0.0, true, 0, 2.0, 3.0);
    both.state.joint_torque_n_m[4] = -5.0;
    both.state.joint_velocity_rad_s[4] = -2.0;
    both.state.joint_torque_n_m[8] = 7.0;
    both.state.joint_velocity_rad_s[8] = -9.0;
    let found = effort(&[both]).unwrap();
    assert_eq!((found.peak_power_w, found.joint_power_w), (16.0, 10.0));
    // Without a flight there is no take-off and no landing.
    assert_eq!((found.takeoff_angle_rad, found.takeoff_speed_m_s, found.landing_torque_n_m), (0.0, 0.0, [0.0; 3]));
}

#[test]
fn a_trial_without_impulse_has_no_effort() {
    assert_eq!(effort(&[tick(-0.5, true, 0, 1.0, 1.0)]), None);
    assert_eq!(effort(&[]), None);
}
