//! The leg controller against torques computed independently of this project (`docs/method.md`).

mod support;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quadfrog::control::force_profile::amplitudes_leg;
use quadfrog::control::leg::{self, LegTarget};
use quadfrog::robot::kinematics::LegGeometry;
use quadfrog::robot::{Joints, PerLeg};
use quadfrog::telemetry::Estimate;
use quadfrog::trial::{Gains, JumpParameters, Task};
use serde::Deserialize;

#[derive(Deserialize)]
struct File {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
#[allow(non_snake_case, reason = "field names of the golden file")]
struct Case {
    task: String,
    theta_rad: f64,
    Fx_n: f64,
    Fy_n: f64,
    Fz_n: f64,
    vmc: bool,
    contact: [bool; 4],
    base_quat_wxyz: [f64; 4],
    joint_q: Joints,
    joint_v: Joints,
    expect: Expect,
}

#[derive(Deserialize)]
struct Expect {
    torque_unclamped_nm: Joints,
    feet: [ExpectFoot; 4],
}

#[derive(Deserialize)]
struct ExpectFoot {
    position_leg: [f64; 3],
    velocity_leg: [f64; 3],
    jacobian_leg_3x3: [[f64; 3]; 3],
}

/// Torques within 1e-9 N m, foot positions, velocities and Jacobians likewise.
#[test]
fn golden_controller() {
    let file: File = support::golden("controller.json");
    let geometry = LegGeometry { abduction: 0.08, thigh: 0.213, calf: 0.213 };
    let (mut torque, mut feet_difference) = (support::Largest::default(), support::Largest::default());
    for (number, case) in file.cases.iter().enumerate() {
        let task: Task = case.task.parse().unwrap_or_else(|_| panic!("unknown task {}", case.task));
        let jump = JumpParameters { f0_hz: 1.0, f1_hz: 0.0, fx_n: case.Fx_n, fy_n: case.Fy_n, fz_n: case.Fz_n };
        let target = LegTarget {
            gains: Gains { kp: 400.0, kd: 8.0, kd_joint: 0.8, k_att: 200.0 },
            stance_leg: Vector3::new(0.0, 0.14, -0.25),
            vmc: case.vmc,
            attitude_rate_gain: 0.0,
            foot_offset_leg: PerLeg::default(),
            amplitudes_leg: amplitudes_leg(&jump, task),
            theta_rad: case.theta_rad,
        };
        let [w, x, y, z] = case.base_quat_wxyz;
        let orientation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let estimate = Estimate { world_from_body: orientation, contact: case.contact, ..Estimate::default() };
        let feet = leg::feet(&geometry, &case.joint_q);
        let torques = leg::torques(&target, &feet, &case.joint_v, &estimate);
        for (joint, (torque_n_m, expected)) in torques.iter().zip(&case.expect.torque_unclamped_nm).enumerate() {
            torque.see(torque_n_m - expected, || format!("case {number} joint {joint}"));
        }
        for (leg, expect) in case.expect.feet.iter().enumerate() {
            let velocity = feet[leg].jacobian_leg * quadfrog::robot::leg_of(&case.joint_v, leg);
            for axis in 0..3 {
                let place = || format!("case {number} leg {leg} axis {axis}");
                feet_difference.see(feet[leg].position_leg[axis] - expect.position_leg[axis], place);
                feet_difference.see(velocity[axis] - expect.velocity_leg[axis], place);
                for column in 0..3 {
                    let difference = feet[leg].jacobian_leg[(axis, column)] - expect.jacobian_leg_3x3[axis][column];
                    feet_difference.see(difference, place);
                }
            }
        }
    }
    println!(
        "golden_controller: {} cases, torques differ by at most {torque} N m, feet by {feet_difference}",
        file.cases.len()
    );
    assert!(!file.cases.is_empty());
    assert!(torque.value < 1e-9, "torques differ by {torque}");
    assert!(feet_difference.value < 1e-9, "feet differ by {feet_difference}");
}
