//! Steps and blocks: feet touch them, the same seed gives the same blocks, loose blocks move when pushed.

use crate::support::Largest;
use nalgebra::Vector3;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Leg, Placement, Robot};
use quadfrog::sim::{ActuatorKind, BodyKind, SimConfig, SimState, Simulator, TerrainKind};

fn config(kind: TerrainKind) -> SimConfig {
    let mut config = SimConfig::default();
    config.terrain.kind = kind;
    config
}

fn stand(config: &SimConfig, seed: u64) -> (Simulator, JointCommand) {
    let robot = RobotDescription::embedded("go1").unwrap();
    let joint_position = robot.leg_geometry.stance(&Vector3::new(0.0, 0.12, -0.26), &robot.lying_position);
    let mut simulator = Simulator::new(&robot, config).unwrap();
    simulator.place(&Placement { joint_position, lying: false, seed });
    (simulator, JointCommand::hold(&joint_position, 100.0, 3.0))
}

/// Regression: on ground of 2 m and more the robot was placed inside it.
#[test]
fn a_robot_is_placed_on_high_ground_and_not_inside_it() {
    let mut config = config(TerrainKind::Steps);
    config.terrain.steps.start_m = -3.0;
    config.terrain.steps.rise_m = 0.2;
    config.terrain.steps.run_m = 0.2;
    config.terrain.steps.count = 12;
    let (simulator, _) = stand(&config, 0);
    let gap = simulator.smallest_gap();
    assert!(gap.abs() < 1e-9 && simulator.state().position_world.z > 2.4, "{gap} m");
}

/// Regression: beside a wall the robot was lowered by the distance to the wall, 200 times: a riser 0.2 mm ahead of the front feet left
/// it hanging 94 mm above the floor, and of 4,000 seeds of blocks five by up to 21 mm.
#[test]
fn a_robot_beside_a_wall_is_placed_on_the_floor() {
    let mut steps = config(TerrainKind::Steps);
    steps.terrain.steps.rise_m = 0.15;
    for ahead in [0.005, 5e-4, 2e-4, 1e-6] {
        steps.terrain.steps.start_m = 0.1881 + 0.02 + ahead;
        let (simulator, _) = stand(&steps, 0);
        let feet = simulator.model().feet(simulator.state()).map(|foot| foot.position_world.z - 0.02);
        assert!(feet[2].abs() < 1e-9 && simulator.smallest_gap() > -1e-9, "{ahead} m ahead: {feet:?}");
    }
    let blocks = config(TerrainKind::Blocks);
    for seed in [107, 548, 800, 1508, 3128] {
        let (mut simulator, _) = stand(&blocks, seed);
        let mut state = *simulator.state();
        state.position_world.z -= 3e-4;
        simulator.set_state(&state);
        let gap = simulator.smallest_gap();
        assert!(gap < -1e-6, "seed {seed}: it can be lowered, {gap} m are left");
    }
}

/// Regression: the height from which the robot was lowered took no account of its size and of the slope: at 1.49 rad it was placed 17 cm
/// in the ground, eight times as large 1.04 m, and thrown out at 40 m/s.
#[test]
fn a_large_robot_and_one_at_a_steep_slope_are_placed_on_the_ground() {
    let mut slope = config(TerrainKind::Slope);
    for (angle, heading) in [(1.0, 0.6), (1.45, 3.1), (1.49, -2.5)] {
        (slope.terrain.slope.angle_rad, slope.terrain.slope.heading_rad) = (angle, heading);
        let (simulator, _) = stand(&slope, 0);
        assert!(simulator.smallest_gap().abs() < 1e-9, "{angle} rad: {} m", simulator.smallest_gap());
    }
    let mut large = RobotDescription::embedded("go1").unwrap();
    for leg in &mut large.legs {
        leg.joint_origin.iter_mut().for_each(|origin| *origin *= 8.0);
        leg.foot_origin *= 8.0;
    }
    let mut simulator = Simulator::new(&large, &SimConfig::default()).unwrap();
    simulator.place(&Placement { joint_position: [0.0; 12], lying: false, seed: 0 });
    assert!(simulator.smallest_gap().abs() < 1e-9, "{} m", simulator.smallest_gap());
}

/// Regression: a state in the ground or beyond a joint stop threw the robot out, with 119 m/s and 134 rad/s.
#[test]
fn a_robot_leaves_ground_and_stops_that_it_was_set_into_slowly() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let mut simulator = Simulator::new(&robot, &SimConfig::default()).unwrap();
    let mut state = SimState { joint_position: robot.lying_position, ..SimState::default() };
    simulator.set_state(&state);
    simulator.write(&JointCommand::default()).unwrap();
    let speed = simulator.state().velocity_body.norm();
    assert!(speed < 5.0, "{speed} m/s");
    state.position_world.z = 3.0;
    state.joint_position[0] = robot.limits.max_position[0] + 0.34;
    simulator.set_state(&state);
    simulator.write(&JointCommand::default()).unwrap();
    let speed = simulator.state().joint_velocity[0];
    assert!((-5.1..0.0).contains(&speed), "{speed} rad/s");
}

#[test]
fn on_steps_the_front_feet_stand_higher() {
    let mut config = config(TerrainKind::Steps);
    config.terrain.steps.start_m = 0.0;
    config.terrain.steps.rise_m = 0.05;
    config.terrain.steps.run_m = 2.0;
    let (mut simulator, command) = stand(&config, 0);
    for _ in 0..2000 {
        simulator.write(&command).unwrap();
    }
    let feet = simulator.model().feet(simulator.state());
    let bottom = |leg: Leg| feet[leg as usize].position_world.z - 0.02;
    for (leg, height) in [(Leg::FR, 0.05), (Leg::FL, 0.05), (Leg::RR, 0.0), (Leg::RL, 0.0)] {
        assert!((bottom(leg) - height).abs() < 1e-4, "{} at {} m", leg.name(), bottom(leg));
    }
    assert_eq!(simulator.read().unwrap().truth.unwrap().foot_contact, [true; 4]);
}

/// A foot that is pushed against a riser stops.
#[test]
fn a_riser_is_a_wall() {
    let mut config = config(TerrainKind::Steps);
    // The riser 5 mm ahead of the front feet, too high to step on.
    config.terrain.steps.start_m = 0.1881 + 0.02 + 0.005;
    config.terrain.steps.rise_m = 0.15;
    config.terrain.friction = 0.1;
    let (mut simulator, mut command) = stand(&config, 0);
    // The thighs swing the front feet forward against the riser.
    for leg in [Leg::FR, Leg::FL] {
        command.motor[3 * leg as usize + 1].position_rad -= 0.15;
    }
    for _ in 0..1500 {
        simulator.write(&command).unwrap();
        for foot in &simulator.model().feet(simulator.state())[..2] {
            let front = foot.position_world.x + 0.02;
            assert!(front < config.terrain.steps.start_m + 5e-4, "the foot is {front} m ahead, inside the step");
        }
    }
}

#[test]
fn blocks_are_those_of_the_seed() {
    let blocks = |seed| stand(&config(TerrainKind::Blocks), seed).0.terrain_boxes().collect::<Vec<_>>();
    let first = blocks(1);
    let expected = SimConfig::default().terrain.blocks;
    assert_eq!(first.len(), expected.count as usize);
    assert_eq!(first, blocks(1));
    assert_ne!(first, blocks(2));
    // Overlapping blocks are stacked: some tops are higher than one block, all by whole blocks.
    let thickness = expected.thickness_m;
    assert!(first.iter().all(|b| b.top < (f64::from(expected.layers) + 0.5) * thickness));
    assert!(first.iter().any(|b| b.top > 1.5 * thickness));
    assert!(first.iter().all(|b| (b.top / thickness - (b.top / thickness).round()).abs() < 1e-9));
}

#[test]
fn a_robot_stands_on_blocks() {
    // Sometimes a calf touches a block's edge while its foot is in the air.
    let mut on_feet = 0;
    for seed in 0..20 {
        let (mut simulator, command) = stand(&config(TerrainKind::Blocks), seed);
        assert!(simulator.smallest_gap().abs() < 1e-6, "seed {seed}: placed {} m off", simulator.smallest_gap());
        for _ in 0..4000 {
            simulator.write(&command).unwrap();
        }
        let state = simulator.read().unwrap();
        let truth = state.truth.unwrap();
        assert!(truth.velocity_world.norm() < 0.05, "seed {seed}: moves at {}", truth.velocity_world.norm());
        let standing = truth.foot_contact.iter().filter(|&&contact| contact).count();
        let (roll, pitch, _) = truth.world_from_body.euler_angles();
        assert!(roll.abs() < 0.4 && pitch.abs() < 0.4, "seed {seed}: tilted by {roll} and {pitch} rad");
        on_feet += usize::from(standing >= 3);
        assert!(simulator.smallest_gap() > -1e-3, "seed {seed}: {} m deep", -simulator.smallest_gap());
    }
    assert!(on_feet >= 15, "only {on_feet} of 20 stood on three feet or more");
}

/// A foot that is dragged over a loose block moves it; a fixed block does not move.
#[test]
fn loose_blocks_move_when_kicked() {
    let moved = |loose: bool| {
        let mut config = config(TerrainKind::Blocks);
        config.terrain.blocks.loose = loose;
        config.terrain.blocks.count = 80;
        config.terrain.blocks.reach_m = 0.5;
        let (mut simulator, command) = stand(&config, 4);
        let before: Vec<_> = simulator.terrain_boxes().collect();
        for tick in 0..2000_u32 {
            let mut kick = command;
            let swing = 0.4 * (f64::from(tick) * 0.02).sin();
            for leg in 0..4 {
                kick.motor[3 * leg + 1].position_rad += swing;
            }
            simulator.write(&kick).unwrap();
        }
        assert!(simulator.state().is_finite());
        let moved = simulator
            .terrain_boxes()
            .zip(before)
            .map(|(now, then)| (now.center[0] - then.center[0]).hypot(now.center[1] - then.center[1]));
        moved.fold(0.0, f64::max)
    };
    assert_eq!(moved(false), 0.0);
    assert!(moved(true) > 0.01, "moved {} m", moved(true));
}

/// A sliding block does not stop in mid-slide when the robot has left the ground. (Regression: with damping in the motors it did.)
#[test]
fn loose_blocks_slide_on_while_the_robot_is_in_the_air() {
    let mut config = config(TerrainKind::Blocks);
    config.terrain.blocks.loose = true;
    config.terrain.blocks.count = 80;
    config.terrain.blocks.reach_m = 0.5;
    config.terrain.blocks.floor_friction = 0.01;
    let (mut simulator, command) = stand(&config, 4);
    for tick in 0..2000_u32 {
        let mut kick = command;
        let swing = 0.4 * (f64::from(tick) * 0.02).sin();
        (0..4).for_each(|leg| kick.motor[3 * leg + 1].position_rad += swing);
        simulator.write(&kick).unwrap();
    }
    let centers = |simulator: &Simulator| simulator.terrain_boxes().map(|b| b.center).collect::<Vec<_>>();
    let mut state = *simulator.state();
    state.position_world.z += 3.0;
    simulator.set_state(&state);
    let before = centers(&simulator);
    for _ in 0..100 {
        simulator.write(&command).unwrap();
    }
    assert_eq!(simulator.contact_count(), 0);
    assert_ne!(before, centers(&simulator));
}

/// Regression: a contact took a loose block for fixed within a step and gave it the momentum of the leg; a block of 60 g hit the other
/// legs at 50 m/s and more, and robots were thrown out at up to 90 m/s or left the finite numbers.
#[test]
fn loose_blocks_do_not_throw_a_flailing_robot() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let (mut fastest_trunk, mut fastest_block) = (Largest::default(), Largest::default());
    for (seed, mass_kg) in (0..12).zip([0.06, 0.06, 0.06, 0.06, 0.01, 1.0].into_iter().cycle()) {
        let mut config = config(TerrainKind::Blocks);
        config.terrain.blocks.loose = true;
        config.terrain.blocks.count = 500;
        config.terrain.blocks.mass_kg = mass_kg;
        config.actuator.kind = ActuatorKind::HardwareLike;
        let mut simulator = Simulator::new(&robot, &config).unwrap();
        simulator.place(&Placement { joint_position: robot.lying_position, lying: true, seed });
        let centers = |simulator: &Simulator| simulator.terrain_boxes().map(|b| b.center).collect::<Vec<_>>();
        let mut before = centers(&simulator);
        for tick in 0..1500 {
            let t = f64::from(tick) * 0.001 + 0.05 * seed as f64;
            let torques = std::array::from_fn(|i| 25.0 * (7.0 * t + i as f64).sin());
            simulator.write(&JointCommand::torques(&torques)).unwrap();
            let place = || format!("seed {seed}, tick {tick}, blocks of {mass_kg} kg");
            fastest_trunk.see(simulator.state().velocity_body.norm(), place);
            if tick % 10 == 9 {
                let after = centers(&simulator);
                for (a, b) in before.iter().zip(&after) {
                    fastest_block.see((a[0] - b[0]).hypot(a[1] - b[1]) / 0.01, place);
                }
                before = after;
            }
        }
    }
    println!("trunk at most {fastest_trunk} m/s, blocks {fastest_block} m/s");
    // On level ground the trunk reaches 3 m/s and the joints 60 rad/s, which is 12 m/s at the foot of a straight leg.
    assert!(fastest_trunk.value < 6.0 && fastest_block.value < 12.0);
}

#[test]
fn an_area_holds_the_centres_of_thousands_of_blocks() {
    let mut config = config(TerrainKind::Blocks);
    config.terrain.blocks.count = 4000;
    config.terrain.blocks.area_m = Some([-1.0, 60.0, -4.0, 4.0]);
    let (simulator, _) = stand(&config, 0);
    let boxes: Vec<_> = simulator.terrain_boxes().collect();
    assert_eq!(boxes.len(), 4000);
    assert!(boxes.iter().all(|b| (-1.0..=60.0).contains(&b.center[0]) && b.center[1].abs() <= 4.0));
    // Everywhere in the corridor, not only around the start.
    for x in 0..60 {
        let strip = f64::from(x) - 0.5..f64::from(x) + 0.5;
        assert!(boxes.iter().filter(|b| strip.contains(&b.center[0])).count() > 20, "at x = {x} m");
    }
}

#[test]
fn a_square_area_lays_the_blocks_of_its_reach() {
    let square = config(TerrainKind::Blocks);
    let mut area = square.clone();
    let reach_m = square.terrain.blocks.reach_m;
    area.terrain.blocks.area_m = Some([-reach_m, reach_m, -reach_m, reach_m]);
    let boxes = |config: &SimConfig| stand(config, 3).0.terrain_boxes().collect::<Vec<_>>();
    assert_eq!(boxes(&square), boxes(&area));
}

/// Simulates two seconds in which the hips swing; returns the last state and all reported accelerations.
fn swing(config: &SimConfig, seed: u64) -> (SimState, Vec<Vector3<f64>>) {
    let (mut simulator, command) = stand(config, seed);
    let mut accelerations = Vec::new();
    for tick in 0..2000_u32 {
        let mut swing = command;
        (0..4).for_each(|leg| swing.motor[3 * leg].position_rad += 0.4 * (f64::from(tick) * 0.02).sin());
        simulator.write(&swing).unwrap();
        accelerations.push(simulator.read().unwrap().imu.accel_body);
    }
    (*simulator.state(), accelerations)
}

#[test]
fn friction_drawn_by_the_seed_changes_neither_blocks_nor_noise() {
    let plain = config(TerrainKind::Blocks);
    let mut drawn = plain.clone();
    drawn.terrain.friction_range = Some([0.3, 0.9]);
    drawn.terrain.blocks.friction_range = Some([0.2, 0.7]);
    let boxes = |config: &SimConfig| stand(config, 5).0.terrain_boxes().collect::<Vec<_>>();
    assert_eq!(boxes(&plain), boxes(&drawn));
    // At rest no foot slides: the accelerations differ by the noise alone, if at all.
    let noise = |config: &SimConfig| {
        let mut config = config.clone();
        config.sensors.enabled = true;
        stand(&config, 5).0.read().unwrap().imu
    };
    assert_eq!(noise(&plain), noise(&drawn));
    assert_ne!(swing(&plain, 5).0, swing(&drawn, 5).0);

    let coefficients: Vec<f64> = (0..200).map(|seed| drawn.terrain.friction_of(seed)).collect();
    assert!(coefficients.iter().all(|mu| (0.3..=0.9).contains(mu)));
    let mean = coefficients.iter().sum::<f64>() / 200.0;
    assert!((mean - 0.6).abs() < 0.05, "mean of 200 seeds {mean}");
    assert_eq!(coefficients[7], drawn.terrain.friction_of(7));
    assert_eq!(plain.terrain.friction_of(7), plain.terrain.friction);
}

#[test]
fn a_range_of_one_coefficient_is_that_coefficient() {
    for kind in [TerrainKind::Flat, TerrainKind::Steps, TerrainKind::Blocks] {
        let mut fixed = config(kind);
        (fixed.terrain.friction, fixed.terrain.blocks.friction) = (0.3, 0.2);
        let mut drawn = config(kind);
        drawn.terrain.friction_range = Some([0.3; 2]);
        drawn.terrain.blocks.friction_range = Some([0.2; 2]);
        assert_eq!(swing(&fixed, 2), swing(&drawn, 2), "{kind:?}");
        assert_ne!(swing(&config(kind), 2).0, swing(&drawn, 2).0, "{kind:?}");
    }
}

/// The list of falls changes the report alone: the collision stays.
#[test]
fn contact_of_a_body_outside_the_list_is_no_fall_and_still_carries() {
    let lie = |fall_bodies: &[BodyKind]| {
        let mut config = SimConfig::default();
        config.contact.fall_bodies = fall_bodies.to_vec();
        let robot = RobotDescription::embedded("go1").unwrap();
        let mut simulator = Simulator::new(&robot, &config).unwrap();
        simulator.place(&Placement { joint_position: robot.lying_position, lying: true, seed: 0 });
        for _ in 0..1000 {
            simulator.write(&JointCommand::damping(2.0)).unwrap();
        }
        (simulator.read().unwrap().truth.unwrap().body_contact, *simulator.state())
    };
    let everything = lie(&SimConfig::default().contact.fall_bodies);
    let without_trunk = lie(&[BodyKind::Thigh, BodyKind::Calf]);
    assert!(everything.0 && lie(&[BodyKind::Trunk]).0 && !without_trunk.0 && !lie(&[]).0);
    assert_eq!(everything.1, without_trunk.1);
}
