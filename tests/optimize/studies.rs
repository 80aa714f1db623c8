//! Whole studies on the built-in simulator: the best values of the method, and identical bits for the same seed.

use quadfrog::config::Config;
use quadfrog::engine::{Options, open_experiment};
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotFiles;
use quadfrog::session::automatic;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::trial::{Backend, Task, TrialRecord};

const TRIALS: u32 = 20;

/// Runs a study of 20 trials of the Go1 without a screen; returns its rows and its best value.
fn study(task: Task, seed: u32) -> (Vec<TrialRecord>, f64) {
    study_of("go1", task, seed)
}

/// The same of a robot with its own configuration.
fn study_of(robot: &str, task: Task, seed: u32) -> (Vec<TrialRecord>, f64) {
    let files = RobotFiles::embedded(robot).unwrap();
    let (robot, config) = (files.description().unwrap(), Config::load_for(&files, None).unwrap());
    let options = Options { seed, trials: Some(TRIALS), ..Options::new(config, robot, Backend::Simulator, task) };
    let settings = options.config.settings(&options.robot, task, Backend::Simulator).unwrap();
    let simulator = Simulator::new(&options.robot, &options.config.simulator).unwrap();
    let mut rollout = Rollout::new(simulator, &settings);
    let mut experiment = open_experiment(&options, Durability::Buffered, "").unwrap();
    automatic::run(&mut experiment, &mut rollout, |_, _| {}).unwrap();
    let best = experiment.best().and_then(|row| row.value).unwrap_or(0.0);
    (experiment.rows().cloned().collect(), best)
}

/// Best values of seeds 0 to 4; prints them with those of MuJoCo with the same controller.
fn bests(task: Task, mujoco: &str) -> Vec<f64> {
    let bests: Vec<f64> = (0..5).map(|seed| study(task, seed).1).collect();
    println!("{}: best of {TRIALS} trials, seeds 0-4: {bests:.3?} {}; MuJoCo {mujoco}", task.name(), task.unit());
    bests
}

#[test]
fn forward_reaches_half_a_metre_in_every_seed() {
    let bests = bests(Task::Forward, "0.68-0.72 m");
    assert!(bests.iter().all(|&best| best >= 0.5), "{bests:?}");
}

#[test]
fn lateral_reaches_a_quarter_of_a_metre_in_four_of_five_seeds() {
    let bests = bests(Task::LateralLeft, "0.32-0.37 m");
    assert!(bests.iter().filter(|&&best| best >= 0.25).count() >= 4, "{bests:?}");
}

#[test]
fn twist_reaches_two_radians_in_four_of_five_seeds() {
    let bests = bests(Task::TwistCcw, "2.7-2.9 rad");
    assert!(bests.iter().filter(|&&best| best >= 2.0).count() >= 4, "{bests:?}");
}

/// Right and clockwise are the mirror images of left and counterclockwise.
#[test]
fn the_mirrored_tasks_learn_too() {
    let (_, right) = study(Task::LateralRight, 0);
    let (_, clockwise) = study(Task::TwistCw, 0);
    assert!(right >= 0.2, "lateral-right {right}");
    assert!(clockwise >= 2.0, "twist-cw {clockwise}");
}

/// Aims of the Go2: 0.6 m, 0.3 m, 2.5 rad. `robots/go2/README.md` has five seeds of every task.
#[test]
fn the_go2_reaches_its_aims() {
    for (task, aim) in [(Task::Forward, 0.6), (Task::LateralLeft, 0.3), (Task::TwistCcw, 2.5)] {
        let (_, best) = study_of("go2", task, 0);
        println!("go2 {}: best of {TRIALS} trials {best:.3} {}", task.name(), task.unit());
        assert!(best >= aim, "{} {best}", task.name());
    }
}

#[test]
fn the_same_seed_gives_the_same_table_bit_for_bit() {
    let (first, _) = study(Task::Forward, 3);
    let (second, _) = std::thread::spawn(|| study(Task::Forward, 3)).join().unwrap();
    assert_eq!(first, second);
    let bits = |rows: &[TrialRecord]| rows.iter().map(|row| row.value.map(f64::to_bits)).collect::<Vec<_>>();
    assert_eq!(bits(&first), bits(&second));
}
