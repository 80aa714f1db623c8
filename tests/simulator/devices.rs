//! Motors and sensors: each setting has the effect given in `config/simulator.toml`.

use nalgebra::Vector3;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{GRAVITY, JointCommand, Placement, Robot, RobotState};
use quadfrog::sim::{ActuatorKind, SimConfig, SimError, SimState, Simulator, TerrainKind};

fn go1() -> RobotDescription {
    RobotDescription::embedded("go1").unwrap()
}

/// High in the air at rest, joints in the middle of their ranges.
fn floating(config: &SimConfig) -> Simulator {
    let mut simulator = Simulator::new(&go1(), config).unwrap();
    let joint_position = std::array::from_fn(|i| [0.0, 1.2, -1.8][i % 3]);
    simulator.set_state(&SimState {
        position_world: Vector3::new(0.0, 0.0, 50.0),
        joint_position,
        ..SimState::default()
    });
    simulator
}

fn hardware_like() -> SimConfig {
    let mut config = SimConfig::default();
    config.actuator.kind = ActuatorKind::HardwareLike;
    config
}

/// Lying still for `ticks`.
fn lying(config: &SimConfig, seed: u64, ticks: u32) -> Vec<RobotState> {
    let robot = go1();
    let mut simulator = Simulator::new(&robot, config).unwrap();
    simulator.place(&Placement { joint_position: robot.lying_position, lying: true, seed });
    (0..ticks)
        .map(|_| {
            simulator.write(&JointCommand::damping(2.0)).unwrap();
            simulator.read().unwrap()
        })
        .collect()
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt())
}

#[test]
fn ideal_torques_are_clamped_to_the_limits() {
    let mut simulator = floating(&SimConfig::default());
    simulator.write(&JointCommand::torques(&[100.0; 12])).unwrap();
    assert_eq!(simulator.read().unwrap().joint_torque_n_m, go1().limits.max_torque);
    simulator.write(&JointCommand::torques(&[3.0; 12])).unwrap();
    assert_eq!(simulator.read().unwrap().joint_torque_n_m, [3.0; 12]);
}

/// Damping much stiffer than inertia over step is stable and stops the motion.
#[test]
fn stiff_damping_is_stable() {
    for config in [SimConfig::default(), hardware_like()] {
        let mut simulator = floating(&config);
        let mut state = *simulator.state();
        state.joint_velocity = [5.0; 12];
        simulator.set_state(&state);
        for _ in 0..1000 {
            simulator.write(&JointCommand::damping(10.0)).unwrap();
        }
        let fastest = simulator.state().joint_velocity.iter().fold(0.0_f64, |m, dq| m.max(dq.abs()));
        assert!(fastest < 0.1, "still {fastest} rad/s");
    }
}

#[test]
fn hardware_torque_lags() {
    let config = hardware_like();
    let mut simulator = floating(&config);
    let wanted = 1.0;
    for tick in 1..=8 {
        simulator.write(&JointCommand::torques(&[wanted; 12])).unwrap();
        let expected = wanted * (1.0 - (-f64::from(tick) * 1e-3 / config.actuator.hardware_like.torque_lag_s).exp());
        let found = simulator.read().unwrap().joint_torque_n_m[0];
        assert!((found - expected).abs() < 1e-9, "{found} N m after {tick} ms where {expected} was due");
    }
}

#[test]
fn hardware_torque_falls_with_speed() {
    let mut config = hardware_like();
    config.actuator.hardware_like.torque_lag_s = 0.0;
    let limits = go1().limits;
    let torque_at = |share: f64, torque: f64| {
        let mut simulator = floating(&config);
        let mut state = *simulator.state();
        state.joint_velocity[1] = share * limits.max_velocity[1];
        simulator.set_state(&state);
        let mut command = [0.0; 12];
        command[1] = torque;
        let mut one = config.clone();
        one.step.contact_substeps = 1;
        let mut fast = Simulator::new(&go1(), &one).unwrap();
        fast.set_state(&state);
        fast.write(&JointCommand::torques(&command)).unwrap();
        fast.read().unwrap().joint_torque_n_m[1]
    };
    let most = limits.max_torque[1];
    assert_eq!(torque_at(0.5, 100.0), most, "below 60 % of the no-load speed");
    assert!((torque_at(0.8, 100.0) - 0.5 * most).abs() < 1e-9, "halfway from 60 to 100 %");
    assert_eq!(torque_at(1.1, 100.0), 0.0, "above the no-load speed");
    assert_eq!(torque_at(1.1, -100.0), -most, "braking");
}

/// Dry friction holds a joint up to its torque; with more torque the joint moves.
#[test]
fn dry_friction_holds_small_torques() {
    let mut config = hardware_like();
    config.actuator.hardware_like.viscous_friction_nm_s = 0.0;
    let friction = config.actuator.hardware_like.dry_friction_nm;
    let moved = |torque: f64| {
        // Free fall: no weight on the joints.
        let mut simulator = floating(&config);
        let start = simulator.state().joint_position[2];
        let mut command = [0.0; 12];
        command[2] = torque;
        for _ in 0..100 {
            simulator.write(&JointCommand::torques(&command)).unwrap();
        }
        (simulator.state().joint_position[2] - start).abs()
    };
    assert!(moved(0.9 * friction) < 1e-6);
    assert!(moved(2.0 * friction) > 1e-2);
}

#[test]
fn at_rest_the_accelerometer_shows_gravity() {
    let state = *lying(&SimConfig::default(), 0, 2000).last().unwrap();
    assert!((state.imu.accel_body - Vector3::new(0.0, 0.0, GRAVITY)).norm() < 0.05, "{}", state.imu.accel_body);
    let mut simulator = floating(&SimConfig::default());
    simulator.write(&JointCommand::default()).unwrap();
    // Nearly zero in free fall.
    assert!(simulator.read().unwrap().imu.accel_body.norm() < 0.5);
}

#[test]
fn noise_has_the_configured_size() {
    let mut config = SimConfig::default();
    config.sensors.enabled = true;
    let states = lying(&config, 3, 6000);
    let gyro: Vec<f64> = states[2000..].iter().map(|s| s.imu.gyro_body.x).collect();
    let (bias, deviation) = mean_and_deviation(&gyro);
    assert!((deviation / config.sensors.gyro_noise_rad_s - 1.0).abs() < 0.1, "gyro noise {deviation}");
    assert!(bias.abs() < 5.0 * config.sensors.gyro_bias_rad_s && bias != 0.0, "gyro bias {bias}");
    let speed: Vec<f64> = states[2000..].iter().map(|s| s.joint_velocity_rad_s[4]).collect();
    let (_, deviation) = mean_and_deviation(&speed);
    assert!((deviation / config.sensors.joint_velocity_noise_rad_s - 1.0).abs() < 0.1, "velocity noise {deviation}");
    let step = config.sensors.encoder_step_rad;
    for q in states[5999].joint_position_rad {
        assert!((q / step - (q / step).round()).abs() < 1e-6, "{q} rad is between two encoder steps");
    }
    // The biases differ between seeds and are equal for the same seed.
    assert_eq!(lying(&config, 3, 10), states[..10]);
    assert_ne!(lying(&config, 4, 10)[9].imu.gyro_body, states[9].imu.gyro_body);
}

#[test]
fn delay_is_that_many_ticks_and_spares_the_truth() {
    let mut config = SimConfig::default();
    config.sensors.enabled = true;
    config.sensors.delay_ms = 7;
    let robot = go1();
    let mut simulator = Simulator::new(&robot, &config).unwrap();
    simulator.place(&Placement { joint_position: robot.lying_position, lying: true, seed: 0 });
    for tick in 1..100_u32 {
        simulator.write(&JointCommand::default()).unwrap();
        let state = simulator.read().unwrap();
        assert_eq!(state.robot_time_ms, tick.saturating_sub(7));
        assert_eq!(state.truth.unwrap().position_world, simulator.state().position_world);
    }
}

#[test]
fn a_motor_holds_its_position() {
    let mut simulator = floating(&SimConfig::default());
    let mut command = JointCommand::hold(&[0.0; 12], 40.0, 1.0);
    command.motor[1].position_rad = 1.5;
    command.motor[2].position_rad = -1.0;
    for _ in 0..1500 {
        simulator.write(&command).unwrap();
    }
    let q = simulator.state().joint_position;
    assert!((q[1] - 1.5).abs() < 0.01 && (q[2] + 1.0).abs() < 0.01, "{q:?}");
}

/// Regression: the torque-speed curve panicked at a velocity that is no number. The control finds such a state itself.
#[test]
fn a_state_that_is_not_finite_is_reported() {
    for kind in [TerrainKind::Flat, TerrainKind::Steps, TerrainKind::Blocks] {
        for value in [f64::NAN, f64::INFINITY] {
            let mut config = hardware_like();
            config.terrain.kind = kind;
            config.terrain.blocks.loose = true;
            let mut simulator = Simulator::new(&go1(), &config).unwrap();
            simulator.set_state(&SimState { joint_velocity: [value; 12], ..SimState::default() });
            for _ in 0..20 {
                simulator.write(&JointCommand::damping(2.0)).unwrap();
            }
            assert!(!simulator.read().unwrap().joint_velocity_rad_s[0].is_finite());
        }
    }
}

#[test]
fn a_wrong_configuration_is_refused_by_name() {
    let shipped = include_str!("../../config/simulator.toml");
    let with = |from: &str, to: &str| {
        assert!(shipped.contains(from), "{from}");
        SimConfig::from_toml(&shipped.replacen(from, to, 1)).unwrap_err().to_string()
    };
    assert!(with("contact_substeps = 2", "contact_substeps = 0").contains("step.contact_substeps = 0"));
    assert!(with("\nfriction = 1.0", "\nfriction = -1.0").contains("terrain.friction = -1"));
    assert!(with("delay_ms = 0", "delay_ms = 21").contains("sensors.delay_ms = 21"));
    assert!(with("max_sweeps", "max_sweps").contains("max_sweps"));
    assert!(with("kind = \"flat\"", "kind = \"moon\"").contains("moon"));
    assert!(matches!(SimConfig::from_toml("[step]"), Err(SimError::Syntax { .. })));
}
