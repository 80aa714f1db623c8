//! The estimate of the base from sensors alone: accuracy over whole jumps, robustness to slip, gaps and bad samples.

use crate::estimation;
use estimation::{JumpError, World, jumps, percentile, settings, settings_of};
use nalgebra::Vector3;
use quadfrog::config::Config;
use quadfrog::control::cycle::{Cycle, TickInputs};
use quadfrog::control::estimator::{ContactGate, Estimator};
use quadfrog::control::leg::feet;
use quadfrog::control::settings::{ControlSettings, ObjectiveSource};
use quadfrog::engine::{Options, open_experiment};
use quadfrog::optimize::journal::Durability;
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{GRAVITY, Joints, LEGS, Placement, Robot, RobotState};
use quadfrog::session::rollout::Rollout;
use quadfrog::session::{automatic, objective};
use quadfrog::sim::Simulator;
use quadfrog::telemetry::Estimate;
use quadfrog::trial::{Backend, ObjectiveRule, Task, TrialRecord, Verdict};

/// Joint angles of a stance, feet at the task's nominal positions.
fn stance(settings: &ControlSettings) -> Joints {
    settings.geometry.stance(&settings.stand.stance_leg, &Joints::default())
}

/// An estimator with the perfect sensors of a standing robot, which a test changes.
struct Feed {
    settings: ControlSettings,
    estimator: Estimator,
    state: RobotState,
}

impl Feed {
    fn standing() -> Feed {
        let settings = settings(Task::Forward);
        let mut state =
            RobotState { joint_position_rad: stance(&settings), foot_force_n: [32.0; LEGS], ..Default::default() };
        state.imu.accel_body = Vector3::new(0.0, 0.0, GRAVITY);
        let mut feed = Feed { settings, estimator: Estimator::default(), state };
        feed.update();
        feed
    }

    /// Estimate of the present state.
    fn update(&mut self) -> Estimate {
        let feet = feet(&self.settings.geometry, &self.state.joint_position_rad);
        *self.estimator.update(&self.state, &feet, &self.settings)
    }

    /// Estimate after `ms` more states, one per millisecond.
    fn run(&mut self, ms: u32) -> Estimate {
        let mut estimate = Estimate::default();
        for _ in 0..ms {
            self.state.robot_time_ms += 1;
            estimate = self.update();
        }
        estimate
    }
}

/// Accuracy over 25 jumps (`cargo bench --bench estimator` makes 100): median 3 cm, 95th percentile 8 cm, yaw within 0.05 rad; also
/// with realistic motors and slipping feet.
#[test]
fn the_displacement_of_a_jump_is_known_to_three_centimetres() {
    for world in [World::Ideal, World::HardwareLike] {
        let (landed, fallen) = jumps(world, ObjectiveSource::Estimate, 25, 1);
        let of = |value: fn(&JumpError) -> f64, share| percentile(landed.iter().map(value), share);
        let (median, most) = (of(JumpError::displacement_m, 0.5), of(JumpError::displacement_m, 0.95));
        let yaw = of(JumpError::yaw_rad, 1.0);
        println!(
            "{world:?}: {} landed, {} fell; {median:.4} m, 95 % {most:.4} m, yaw {yaw:.4} rad",
            landed.len(),
            fallen.len()
        );
        assert!(landed.len() >= 12, "{world:?}: {} of 25 landed: too few to judge by", landed.len());
        assert!(median <= 0.03 && most <= 0.08 && yaw <= 0.05, "{world:?}");
        // The robots did jump.
        assert!(landed.iter().any(|jump| jump.truth.dx_m > 0.2) && landed.iter().any(|jump| jump.truth.dyaw_rad > 0.5));
    }
}

#[test]
fn the_same_jumps_give_the_same_bits() {
    let bits = || {
        let (landed, _) = jumps(World::HardwareLike, ObjectiveSource::Estimate, 2, 5);
        landed.iter().map(|jump| jump.estimate.dx_m.to_bits()).collect::<Vec<_>>()
    };
    let first = bits();
    assert!(!first.is_empty());
    assert_eq!(std::thread::spawn(bits).join().unwrap(), first);
}

/// A minute in READY with biased, noisy sensors. The gyroscope's bias alone (3.5 mrad/s, 0.2 m above the feet) would move the
/// estimate by 4 cm; the positions of the feet hold it, except for their configured creep.
#[test]
fn a_robot_that_stands_for_a_minute_stays_where_it_is() {
    let settings = settings(Task::Forward);
    let description = RobotDescription::embedded("go1").unwrap();
    let mut robot = Simulator::new(&description, &World::Ideal.config()).unwrap();
    robot.place(&Placement { joint_position: stance(&settings), lying: false, seed: 3 });
    let mut cycle = Cycle::ready(&settings);
    let mut start = None;
    let (mut farthest, mut fastest) = (0.0_f64, 0.0_f64);
    for ms in 0..60_000_u64 {
        let inputs = TickInputs { time_ns: ms * 1_000_000, ..TickInputs::default() };
        let tick = *cycle.tick(&inputs, &SimulatedClock, &mut robot);
        if ms < 2_000 {
            continue;
        }
        let error = tick.estimate.position_world - tick.state.truth.unwrap().position_world;
        farthest = farthest.max((error - *start.get_or_insert(error)).norm());
        fastest = fastest.max(tick.estimate.velocity_world.norm());
    }
    println!("drift in 58 s {farthest:.5} m, largest velocity {fastest:.4} m/s");
    assert!(farthest < 0.01, "drifted by {farthest} m");
    assert!(fastest < settings.settle.speed_m_s / 2.0, "moves at {fastest} m/s: would hardly count as quiet");
}

#[test]
fn the_bias_of_the_accelerometer_is_learnt_while_standing() {
    let mut feed = Feed::standing();
    let bias = Vector3::new(0.3, -0.2, 0.15);
    feed.state.imu.accel_body += bias;
    feed.run(1_000);
    let learnt = feed.estimator.filter().unwrap().accel_bias_body();
    assert!((learnt - bias).norm() < 0.03, "{learnt}");
}

#[test]
fn a_flight_is_ballistic() {
    let mut feed = Feed::standing();
    let start = feed.run(2_000).position_world;
    feed.state.foot_force_n = [0.0; LEGS];
    feed.state.imu.accel_body = Vector3::zeros();
    let estimate = feed.run(400);
    // The first two milliseconds count as standing; feet that do not move agree.
    assert_eq!(estimate.contact, [false; LEGS]);
    assert!((estimate.velocity_world.z + GRAVITY * 0.4).abs() < 0.15, "{}", estimate.velocity_world);
    assert!((estimate.position_world.z - start.z + GRAVITY * 0.08).abs() < 0.05, "{}", estimate.position_world);
    assert!((estimate.position_world - start).xy().norm() < 1e-3);
}

/// A foot that slides under a standing robot, 0.2 m/s for 0.3 s. If accepted, a quarter of its 6 cm would go to the trunk.
#[test]
fn a_slipping_foot_is_gated() {
    let mut feed = Feed::standing();
    let start = feed.run(1_000).position_world;
    let forward = Vector3::new(0.2, 0.0, 0.0);
    let mut farthest = 0.0_f64;
    for _ in 0..300 {
        let foot = feet(&feed.settings.geometry, &feed.state.joint_position_rad)[0];
        let dq = foot.jacobian_leg.try_inverse().unwrap() * forward;
        for joint in 0..3 {
            feed.state.joint_velocity_rad_s[joint] = dq[joint];
            feed.state.joint_position_rad[joint] += dq[joint] * 1e-3;
        }
        farthest = farthest.max((feed.run(1).position_world - start).norm());
    }
    assert!(farthest < 0.002, "the sliding foot dragged the trunk by {farthest} m");
    // It stops, and is accepted at its new position.
    feed.state.joint_velocity_rad_s = [0.0; 12];
    let estimate = feed.run(500);
    assert!((estimate.position_world - start).norm() < 0.002 && estimate.velocity_world.norm() < 0.01);
}

/// All four feet agree on a velocity that the filter rejects (a push in a gap of the states): after a time it is accepted.
#[test]
fn a_wrong_velocity_is_given_up() {
    let mut feed = Feed::standing();
    feed.run(1_000);
    let forward = Vector3::new(-0.5, 0.0, 0.0);
    let mut estimate = Estimate::default();
    for _ in 0..400 {
        for leg in 0..LEGS {
            let foot = feet(&feed.settings.geometry, &feed.state.joint_position_rad)[leg];
            let dq = foot.jacobian_leg.try_inverse().unwrap() * forward;
            feed.state.joint_velocity_rad_s[3 * leg..][..3].copy_from_slice(dq.as_slice());
        }
        estimate = feed.run(1);
    }
    // The trunk moves against the feet, less their rolling.
    assert!((estimate.velocity_world.x - 0.5).abs() < 0.1, "{}", estimate.velocity_world);
}

/// A velocity error of 3 m/s from ten milliseconds of a wrong accelerometer. Regression: the variance was reset without the
/// velocity, no standing foot was accepted again, and the estimate of a standing robot moved 23 m.
#[test]
fn a_velocity_that_no_foot_could_have_is_given_up_and_the_way_taken_back() {
    let mut feed = Feed::standing();
    let start = feed.run(1_000).position_world;
    feed.state.imu.accel_body.x = 300.0;
    assert!(feed.run(10).velocity_world.x > 2.0);
    feed.state.imu.accel_body.x = 0.0;
    let estimate = feed.run(250);
    assert!(estimate.velocity_world.norm() < 0.02, "{}", estimate.velocity_world);
    assert!((estimate.position_world - start).norm() < 0.05, "{}", estimate.position_world);
}

/// An impact at the end of a gap did not last for the whole gap. Regression: it was integrated over the gap with the variance of one
/// sample.
#[test]
fn a_knock_at_the_end_of_a_gap_is_not_the_whole_gap() {
    let mut feed = Feed::standing();
    let start = feed.run(1_000).position_world;
    feed.state.imu.accel_body.x = 200.0;
    feed.state.robot_time_ms += 14;
    feed.run(1);
    feed.state.imu.accel_body.x = 0.0;
    let estimate = feed.run(20);
    assert!(estimate.velocity_world.norm() < 0.05, "{}", estimate.velocity_world);
    assert!((estimate.position_world - start).norm() < 0.01, "{}", estimate.position_world);
}

#[test]
fn one_number_that_is_none_spoils_nothing() {
    let spoil: [fn(&mut RobotState); 6] = [
        |state| state.imu.accel_body.x = f64::NAN,
        |state| state.imu.gyro_body.z = f64::INFINITY,
        |state| state.imu.world_from_body.as_mut_unchecked().coords.w = f64::NAN,
        |state| state.joint_position_rad[4] = f64::NAN,
        |state| state.joint_velocity_rad_s[11] = f64::NEG_INFINITY,
        |state| state.foot_force_n[2] = f64::NAN,
    ];
    for (case, spoil) in spoil.into_iter().enumerate() {
        let mut feed = Feed::standing();
        let before = feed.run(500);
        let sound = feed.state;
        spoil(&mut feed.state);
        assert_eq!(feed.run(1), before, "case {case}");
        feed.state = RobotState { robot_time_ms: feed.state.robot_time_ms, ..sound };
        let after = feed.run(100);
        assert!((after.position_world - before.position_world).norm() < 1e-4, "case {case}");
        assert!(after.velocity_world.norm() < 1e-3 && after.roll_pitch_yaw.norm() < 1e-12, "case {case}");
    }
}

#[test]
fn a_reset_forgets_everything() {
    let mut feed = Feed::standing();
    feed.state.imu.accel_body.x += 0.5;
    feed.run(500);
    feed.estimator.reset();
    assert_eq!(feed.estimator, Estimator::default());
    let again = feed.update();
    let mut fresh = Feed { estimator: Estimator::default(), ..feed };
    assert_eq!(fresh.update(), again);
    assert_eq!(again.position_world.xy(), Vector3::zeros().xy());
}

/// A tick without a new state changes nothing, and a gap is bridged.
#[test]
fn a_state_counts_once_and_a_gap_is_bridged() {
    let mut feed = Feed::standing();
    feed.state.foot_force_n = [0.0; LEGS];
    feed.state.imu.accel_body = Vector3::new(1.0, 0.0, GRAVITY);
    let first = feed.run(20);
    assert_eq!(feed.update(), first);
    feed.state.robot_time_ms += 9;
    let bridged = feed.run(1);
    let gained = bridged.velocity_world.x - first.velocity_world.x;
    // Less the part estimated as bias while the feet still counted as standing.
    assert!((gained - 0.010).abs() < 1e-4, "{gained} m/s in 10 ms of 1 m/s^2");
}

#[test]
fn a_clock_that_goes_back_begins_anew() {
    let mut feed = Feed::standing();
    feed.state.foot_force_n = [0.0; LEGS];
    feed.state.imu.accel_body.x = 3.0;
    assert!(feed.run(500).position_world.x > 0.1);
    feed.state.robot_time_ms = 7;
    let estimate = feed.update();
    assert_eq!(estimate.position_world.x, 0.0);
    assert_eq!(estimate.velocity_world, Vector3::zeros());
}

/// Regression: clocks were compared as numbers, so that the estimate restarted at the overflow after 49 days.
#[test]
fn the_estimate_goes_on_across_the_end_of_the_robots_clock() {
    let mut feed = Feed::standing();
    feed.state.robot_time_ms = u32::MAX - 100;
    feed.update();
    feed.state.foot_force_n = [0.0; LEGS];
    feed.state.imu.accel_body.x = 3.0;
    let before = feed.run(100);
    assert_eq!(feed.state.robot_time_ms, u32::MAX);
    feed.state.robot_time_ms = 4;
    let after = feed.update();
    let gained = after.velocity_world.x - before.velocity_world.x;
    assert!((gained - 0.015).abs() < 1e-3, "{gained} m/s in 5 ms of 3 m/s^2");
}

/// Half an hour on a stand before the first stand-up.
#[test]
fn a_robot_that_hangs_does_not_fly_away() {
    let mut feed = Feed::standing();
    feed.state.foot_force_n = [0.0; LEGS];
    feed.state.imu.accel_body.x = 0.3;
    let estimate = feed.run(60_000);
    assert_eq!(estimate.velocity_world, Vector3::zeros());
    assert!(estimate.position_world.norm() < 1.0, "{}", estimate.position_world);
    // Put down, it stands at once.
    feed.state.foot_force_n = [32.0; LEGS];
    assert!(feed.run(200).velocity_world.norm() < 0.02);
}

#[test]
fn contact_does_not_flicker_in_the_noise_of_a_sensor() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = settings(Task::Forward);
    let mut simulator = Simulator::new(&robot, &World::Ideal.config()).unwrap();
    simulator.place(&Placement { joint_position: stance(&settings), lying: false, seed: 9 });
    let mut changes = 0;
    // The same noise on a foot in the air and on one that carries its share.
    for force_n in [0.0, 32.0] {
        let mut gate = ContactGate::default();
        for ms in 0..10_000 {
            simulator.set_state(&quadfrog::sim::SimState {
                position_world: Vector3::new(0.0, 0.0, 9.0),
                ..*simulator.state()
            });
            let noisy = simulator.read().unwrap().foot_force_n.map(|noise| force_n + noise);
            let down = gate.update(&noisy, 1e-3, &settings.estimator);
            if ms > 100 {
                changes += down.iter().filter(|&&down| down != (force_n > 0.0)).count();
            }
        }
    }
    assert_eq!(changes, 0, "wrong contacts in 20 s of noise on four feet");
    // A tap of one millisecond is no contact; a landing and the end of a push are detected in two.
    let mut gate = ContactGate::default();
    let mut feel = |force_n| gate.update(&[force_n; LEGS], 1e-3, &settings.estimator)[0];
    let forces = [0.0, 180.0, 0.0, 60.0, 100.0, 100.0, 0.0, 100.0, 0.0, 0.0];
    assert_eq!(forces.map(&mut feel), [false, false, false, false, true, true, true, true, true, false]);
}

#[test]
fn yaw_counts_full_turns_on_sensors_as_on_truth() {
    let mut feed = Feed::standing();
    feed.state.foot_force_n = [0.0; LEGS];
    for ms in 1..=700 {
        let yaw = f64::from(ms) * 0.01;
        feed.state.imu.world_from_body = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
        let estimate = feed.run(1);
        assert!((estimate.roll_pitch_yaw.z - yaw).abs() < 1e-9, "{} at {yaw}", estimate.roll_pitch_yaw.z);
    }
}

/// With `objective = "truth"` the estimate equals the simulator's true state to the bit, whatever the sensors report.
#[test]
fn the_truth_is_passed_through_where_it_is_asked_for() {
    let settings = settings_of(Task::Forward, ObjectiveSource::Truth);
    let robot = RobotDescription::embedded("go1").unwrap();
    let mut simulator = Simulator::new(&robot, &World::Ideal.config()).unwrap();
    simulator.place(&Placement { joint_position: stance(&settings), lying: false, seed: 1 });
    let mut cycle = Cycle::ready(&settings);
    for _ in 0..200 {
        let tick = *cycle.tick(&TickInputs::default(), &SimulatedClock, &mut simulator);
        let truth = tick.state.truth.unwrap();
        assert_eq!(tick.estimate.position_world, truth.position_world);
        assert_eq!(tick.estimate.velocity_world, truth.velocity_world);
        assert_eq!(tick.estimate.world_from_body, truth.world_from_body);
        assert_ne!(tick.estimate.world_from_body, tick.state.imu.world_from_body);
    }
}

/// A configuration with these texts in its files.
fn config(files: &[(&str, &str)]) -> Config {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    Config::load(Some(folder.path())).unwrap()
}

#[test]
fn a_robot_is_never_asked_for_the_truth() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let source = |text: &str, backend| {
        let config = config(&[("optimize.toml", text)]);
        config.settings(&robot, Task::Forward, backend).map(|settings| settings.objective).map_err(|e| e.to_string())
    };
    use {Backend::*, ObjectiveSource::*};
    assert_eq!(source("", Simulator), Ok(Truth));
    assert_eq!(source("", Hardware), Ok(Estimate));
    assert_eq!(source("objective = \"estimate\"", Simulator), Ok(Estimate));
    assert_eq!(source("objective = \"estimate\"", Hardware), Ok(Estimate));
    assert_eq!(source("objective = \"truth\"", Simulator), Ok(Truth));
    let error = source("trials = 5\nobjective = \"truth\"\n", Hardware).unwrap_err();
    assert!(error.contains("optimize.toml:2") && error.contains("`objective` = \"truth\""), "{error}");
    assert!(error.contains("\"estimate\""), "says what to do: {error}");
}

#[test]
fn a_source_or_weight_that_cannot_be_is_refused() {
    let refused = |name: &str, text: &str| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), text).unwrap();
        Config::load(Some(folder.path())).unwrap_err().to_string()
    };
    let error = refused("optimize.toml", "objective = \"guess\"\n");
    assert!(error.contains("optimize.toml:1") && error.contains("\"guess\"") && error.contains("estimate"), "{error}");
    let error = refused("control.toml", "[estimator]\ngate_sigma = 0.0\n");
    assert!(error.contains("control.toml:2") && error.contains("estimator.gate_sigma"), "{error}");
    let error = refused("control.toml", "[estimator]\ncontact_off_n = 40.0\n");
    assert!(error.contains("estimator.contact_off_n") && error.contains("contact_on_n"), "{error}");
}

/// A forward study of 20 trials with noisy sensors: its best by its own objective and by the truth.
fn study(source: &str, seed: u32) -> (TrialRecord, f64) {
    let config = config(&[
        ("optimize.toml", &format!("objective = \"{source}\"\n")),
        ("simulator.toml", "[sensors]\nenabled = true\n"),
    ]);
    let robot = RobotDescription::embedded("go1").unwrap();
    let (task, backend) = (Task::Forward, Backend::Simulator);
    let options = Options { seed, trials: Some(20), ..Options::new(config, robot, backend, task) };
    let settings = options.config.settings(&options.robot, task, backend).unwrap();
    let simulator = Simulator::new(&options.robot, &options.config.simulator).unwrap();
    let mut life = open_experiment(&options, Durability::Buffered, "").unwrap();
    let mut in_truth = Vec::new();
    automatic::run(&mut life, &mut Rollout::new(simulator, &settings), |row, ticks| {
        let truth = objective::measure(&ObjectiveRule::single(task), &estimation::in_truth(ticks, &settings)).unwrap();
        in_truth.push((row.trial, objective::value(&ObjectiveRule::single(task), &truth)));
    })
    .unwrap();
    let best = life.best().unwrap().clone();
    let truth = in_truth.iter().find(|(trial, _)| *trial == best.trial).unwrap().1;
    (best, truth)
}

#[test]
fn a_study_on_the_estimate_ends_as_well_as_one_on_the_truth() {
    for seed in 0..3 {
        let (on_truth, _) = study("truth", seed);
        let (on_estimate, in_truth) = study("estimate", seed);
        let (a, b) = (on_truth.value.unwrap(), on_estimate.value.unwrap());
        println!(
            "forward, seed {seed}: best on the truth {a:.3} m, on the estimate {b:.3} m (in truth {in_truth:.3} m)"
        );
        assert_eq!(on_estimate.verdict, Some(Verdict::Accept));
        assert!((b - in_truth).abs() < 0.03, "the estimate says {b} m of a jump of {in_truth} m");
        assert!(in_truth >= 0.5, "seed {seed}: {in_truth} m, where a study on the truth reaches half a metre");
    }
}
