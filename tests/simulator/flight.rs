//! Properties of motion without contact: momentum and energy are conserved, the error decreases with the step at the integrator's
//! order.

use nalgebra::{UnitQuaternion, Vector3};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{GRAVITY, JointCommand, Robot};
use quadfrog::sim::{ActuatorKind, ContactLaw, SimConfig, SimState, Simulator, TerrainKind};

/// A limp robot that tumbles high up, without joint stops.
fn tumbling(flight_substeps: u32) -> Simulator {
    let mut robot = RobotDescription::embedded("go1").unwrap();
    (robot.limits.min_position, robot.limits.max_position) = ([-1e3; 12], [1e3; 12]);
    let mut config = SimConfig::default();
    config.step.flight_substeps = flight_substeps;
    let mut simulator = Simulator::new(&robot, &config).unwrap();
    simulator.set_state(&SimState {
        position_world: Vector3::new(0.3, -0.2, 5.0),
        world_from_body: UnitQuaternion::from_euler_angles(0.4, -0.3, 1.0),
        joint_position: std::array::from_fn(|i| [0.1, 0.8, -1.6][i % 3]),
        velocity_body: Vector3::new(1.0, -0.5, 0.8),
        angular_velocity_body: Vector3::new(3.0, -4.0, 5.0),
        joint_velocity: std::array::from_fn(|i| if i % 2 == 0 { 6.0 } else { -4.0 }),
    });
    simulator
}

/// Momentum is kept by construction, to rounding; the energy to the order of the step.
#[test]
fn momentum_and_energy_are_kept() {
    let mut simulator = tumbling(1);
    let before = (simulator.model().momentum(simulator.state()), simulator.model().energy(simulator.state()).total());
    for _ in 0..500 {
        simulator.write(&JointCommand::default()).unwrap();
    }
    let after = (simulator.model().momentum(simulator.state()), simulator.model().energy(simulator.state()).total());
    let turned = (after.0.angular_world - before.0.angular_world).norm() / before.0.angular_world.norm();
    let gained = (after.1 - before.1).abs() / before.1;
    println!("in 0.5 s: angular momentum {turned:.1e}, energy {gained:.1e} relative");
    assert!(turned < 1e-10);
    assert!(gained < 1e-6);
}

/// Torques that change in each tick, as a controller's do, between limbs that turn at up to 40 rad/s: they are internal.
#[test]
fn changing_torques_leave_the_momentum_and_the_parabola_of_the_centre_of_mass() {
    let mut simulator = tumbling(1);
    let before = simulator.model().momentum(simulator.state());
    let mut fastest: f64 = 0.0;
    for tick in 0..500 {
        let torque = std::array::from_fn(|i| 3.0 * (f64::from(tick) * 0.05 + i as f64).sin());
        simulator.write(&JointCommand::torques(&torque)).unwrap();
        fastest = simulator.state().joint_velocity.iter().fold(fastest, |most, speed| speed.abs().max(most));
    }
    let after = simulator.model().momentum(simulator.state());
    let turned = (after.angular_world - before.angular_world).norm() / before.angular_world.norm();
    let fall = Vector3::new(0.0, 0.0, -0.5 * GRAVITY);
    let velocity = (after.com_velocity_world - before.com_velocity_world - fall).norm();
    let place = before.com_world + before.com_velocity_world * 0.5 + fall * 0.25;
    let beside = (after.com_world - place).norm();
    println!(
        "joints up to {fastest:.0} rad/s: angular momentum {turned:.1e} relative, {velocity:.1e} m/s, {beside:.1e} m"
    );
    assert!(fastest > 20.0, "the limbs hardly move");
    assert!(turned < 1e-10 && velocity < 1e-10 && beside < 1e-10);
}

#[test]
fn the_error_falls_with_the_third_power_of_the_step() {
    let after = |substeps: u32| {
        let mut simulator = tumbling(substeps);
        for _ in 0..200 {
            simulator.write(&JointCommand::default()).unwrap();
        }
        simulator.state().joint_position
    };
    let reference = after(16);
    let error = |substeps| {
        let found = after(substeps);
        found.iter().zip(&reference).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    let (whole, half) = (error(1), error(2));
    let order = (whole / half).log2();
    println!("error {whole:.1e} rad at 1 ms, {half:.1e} at 0.5 ms: order {order:.2}");
    assert!((2.7..3.3).contains(&order));
}

/// The same seed and commands give the same bits, also from a used simulator and from a copy.
#[test]
fn a_run_repeats_bit_for_bit() {
    let run = |simulator: &mut Simulator| {
        let robot = RobotDescription::embedded("go1").unwrap();
        let placement = quadfrog::robot::Placement { joint_position: robot.lying_position, lying: true, seed: 7 };
        simulator.place(&placement);
        let mut bits = Vec::new();
        for tick in 0..600 {
            let torque = std::array::from_fn(|i| 15.0 * (f64::from(tick) * 0.02 + i as f64).sin());
            simulator.write(&JointCommand::torques(&torque)).unwrap();
            let state = simulator.read().unwrap();
            bits.extend(state.joint_position_rad.iter().chain(state.imu.accel_body.iter()).map(|x| x.to_bits()));
        }
        bits
    };
    let mut config = SimConfig::default();
    config.sensors.enabled = true;
    let robot = RobotDescription::embedded("go1").unwrap();
    let mut simulator = Simulator::new(&robot, &config).unwrap();
    let first = run(&mut simulator);
    assert_eq!(first, run(&mut simulator));
    assert_eq!(first, run(&mut simulator.clone()));
    let in_thread = std::thread::spawn(move || run(&mut Simulator::new(&robot, &config).unwrap()));
    assert_eq!(first, in_thread.join().unwrap());
}

/// A robot that tumbles, falls on its legs and its trunk, and is moved by its motors, with dry friction and lag in its joints.
#[test]
fn the_widest_and_the_baseline_instructions_give_the_same_bits() {
    let mut config = SimConfig::default();
    config.actuator.kind = ActuatorKind::HardwareLike;
    wide_and_baseline_are_equal(&config);
}

/// The same on blocks that slide under the robot, with the convex contact law.
#[test]
fn the_widest_and_the_baseline_instructions_give_the_same_bits_on_loose_blocks() {
    let mut config = SimConfig::default();
    config.contact.law = ContactLaw::Convex;
    config.terrain.kind = TerrainKind::Blocks;
    config.terrain.blocks.loose = true;
    wide_and_baseline_are_equal(&config);
}

fn wide_and_baseline_are_equal(config: &SimConfig) {
    let robot = RobotDescription::embedded("go1").unwrap();
    let mut wide = Simulator::new(&robot, config).unwrap();
    wide.set_state(&SimState { position_world: Vector3::new(0.0, 0.0, 1.5), ..*tumbling(1).state() });
    let mut baseline = wide.clone().with_baseline_instructions();
    let bits = |simulator: &Simulator| {
        let SimState { position_world, world_from_body, joint_position, velocity_body, joint_velocity, .. } =
            simulator.state();
        let trunk = position_world.iter().chain(world_from_body.coords.iter()).chain(velocity_body.iter());
        trunk.chain(joint_position).chain(joint_velocity).map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    let mut touched = 0;
    for tick in 0..2000 {
        let torque = std::array::from_fn(|i| 15.0 * (f64::from(tick) * 0.03 + i as f64).sin());
        for simulator in [&mut wide, &mut baseline] {
            simulator.write(&JointCommand::torques(&torque)).unwrap();
        }
        assert_eq!(bits(&wide), bits(&baseline), "after {tick} ms");
        touched += usize::from(wide.contact_count() > 0);
    }
    assert!(0 < touched && touched < 2000, "{touched} ms with contacts");
}
