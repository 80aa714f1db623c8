//! Smooth dynamics against Pinocchio (`golden/dynamics.json`) and a fine reference integration (`golden/flight.json`).
//! `QUADFROG_GOLDEN` names another folder of golden data.

mod support;

use nalgebra::{Quaternion, UnitQuaternion};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Leg, Robot};
use quadfrog::sim::{DOF, RobotModel, SimConfig, SimState, Simulator};
use serde_json::Value;
use support::{Largest, golden};

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        _ => vec![value.as_f64().expect("a number")],
    }
}

fn array<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().expect("the right number of values")
}

fn state_of(case: &Value) -> SimState {
    let [w, x, y, z] = array(&case["base_quat_wxyz"]);
    SimState {
        position_world: array::<3>(&case["base_position"]).into(),
        world_from_body: UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        joint_position: array(&case["joint_q"]),
        velocity_body: array::<3>(&case["base_linvel_body"]).into(),
        angular_velocity_body: array::<3>(&case["base_angvel_body"]).into(),
        joint_velocity: array(&case["joint_v"]),
    }
}

/// The largest difference relative to the largest number of the quantity.
fn relative(found: &[f64], expected: &Value) -> f64 {
    let expected = numbers(expected);
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
    found.iter().zip(&expected).fold(0.0, |m: f64, (a, b)| {
        assert!(a.is_finite());
        m.max((a - b).abs() / scale)
    })
}

#[test]
fn golden_dynamics() {
    let model = RobotModel::new(&RobotDescription::embedded("go1").unwrap());
    compare_with_pinocchio(&model);
    compare_with_pinocchio(&model.with_baseline_instructions());
}

fn compare_with_pinocchio(model: &RobotModel) {
    let file = golden::<Value>("dynamics.json");
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty());
    let mut largest = (0.0, "nothing");
    for case in cases {
        let (state, expect) = (state_of(case), &case["expect"]);
        let mut compare = |what: &'static str, found: &[f64], expected: &Value| {
            let difference = relative(found, expected);
            if difference > largest.0 {
                largest = (difference, what);
            }
        };
        let a = model.forward_dynamics(&state, &array(&case["joint_tau"]));
        let a: Vec<f64> = a.linear_body.iter().chain(a.angular_body.iter()).chain(&a.joint).copied().collect();
        compare("acceleration", &a, &expect["acceleration_18"]);
        let mass = model.mass_matrix(&state);
        assert_eq!(mass.len(), DOF * DOF);
        compare("mass matrix", mass.transpose().as_slice(), &expect["mass_matrix_18x18"]);
        compare("bias", model.bias(&state).as_slice(), &expect["bias_18"]);
        let momentum = model.momentum(&state);
        compare("centre of mass", momentum.com_world.as_slice(), &expect["com_world"]);
        compare("its velocity", momentum.com_velocity_world.as_slice(), &expect["com_velocity_world"]);
        compare("angular momentum", momentum.angular_world.as_slice(), &expect["angular_momentum_about_com_world"]);
        let energy = model.energy(&state);
        compare("kinetic energy", &[energy.kinetic], &expect["kinetic_energy"]);
        compare("potential energy", &[energy.potential], &expect["potential_energy"]);
        for (leg, foot) in Leg::ALL.into_iter().zip(model.feet(&state)) {
            let expect = &expect["feet"][leg.name()];
            compare("foot position", foot.position_world.as_slice(), &expect["position_world"]);
            compare("foot velocity", foot.velocity_world.as_slice(), &expect["velocity_world"]);
            compare("foot Jacobian", foot.jacobian_world.transpose().as_slice(), &expect["jacobian_world_3x18"]);
        }
    }
    println!("golden_dynamics: {} cases, largest relative difference {:.1e} ({})", cases.len(), largest.0, largest.1);
    assert!(largest.0 < 1e-9, "{} differs by {:e}", largest.1, largest.0);
}

#[test]
fn golden_flight() {
    // The reference has no joint stops.
    let mut robot = RobotDescription::embedded("go1").unwrap();
    (robot.limits.min_position, robot.limits.max_position) = ([-1e3; 12], [1e3; 12]);
    let file = golden::<Value>("flight.json");
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty());
    let (mut metres, mut radians) = (Largest::default(), Largest::default());
    for (number, case) in cases.iter().enumerate() {
        let mut simulator = Simulator::new(&robot, &SimConfig::default()).unwrap();
        simulator.set_state(&state_of(&case["initial"]));
        let command = JointCommand::torques(&array(&case["joint_tau"]));
        for _ in 0..(1000.0 * case["seconds"].as_f64().unwrap()).round() as u32 {
            simulator.write(&command).unwrap();
        }
        let (found, expected) = (*simulator.state(), state_of(&case["final"]));
        metres.see((found.position_world - expected.position_world).norm(), || format!("case {number}"));
        let turned = found.world_from_body.angle_to(&expected.world_from_body);
        radians.see(turned, || format!("case {number}, orientation"));
        for (i, (a, b)) in found.joint_position.iter().zip(&expected.joint_position).enumerate() {
            radians.see(a - b, || format!("case {number}, joint {i}"));
        }
    }
    println!("golden_flight: {} cases, largest differences {metres} m, {radians} rad", cases.len());
    assert!(metres.value < 1e-3 && radians.value < 1e-3);
}
