//! Accuracy of the estimator over 100 jumps, and duration of an update: `cargo bench --bench estimator`.
//!
//! The accuracy is printed first; it is the same on every machine.

#[path = "../tests/support/estimation.rs"]
mod estimation;

use criterion::{Criterion, criterion_group, criterion_main};
use estimation::{JumpError, World, jumps, percentile, settings};
use quadfrog::control::estimator::Estimator;
use quadfrog::control::leg::feet;
use quadfrog::control::settings::ObjectiveSource;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Placement, Robot};
use quadfrog::sim::Simulator;
use quadfrog::trial::Task;
use std::hint::black_box;

const JUMPS: u32 = 100;
const SEED: u64 = 0;

fn accuracy(_: &mut Criterion) {
    println!("Error of the estimate over {JUMPS} jumps with random parameters within the bounds and sensor errors");
    println!("                             landed | displacement, cm    | yaw, rad      | rise, cm");
    println!("                             of     | median  95 %   max  | 95 %    max   | median  95 %");
    let worlds = [
        (World::Ideal, "ideal motors, friction 1.0"),
        (World::HardwareLike, "hardware-like, friction 0.6"),
        (World::Imperfect, "the same, badly calibrated"),
    ];
    for (world, name) in worlds {
        let (landed, fallen) = jumps(world, ObjectiveSource::Estimate, JUMPS, SEED);
        line(name, &landed.iter().collect::<Vec<_>>(), fallen.len());
        for task in Task::ALL {
            let of_task: Vec<_> = landed.iter().filter(|jump| jump.task == task).collect();
            let fell = JUMPS as usize / Task::ALL.len() - of_task.len();
            line(&format!("  {}", task.name()), &of_task, fell);
        }
        let (_, fallen_on_truth) = jumps(world, ObjectiveSource::Truth, JUMPS, SEED);
        println!(
            "  fallen and excluded: {}; with the controller on the truth: {}",
            fallen.len(),
            fallen_on_truth.len()
        );
    }
    println!();
}

fn line(name: &str, landed: &[&JumpError], fallen: usize) {
    let of = |value: fn(&JumpError) -> f64, share| percentile(landed.iter().map(|jump| value(jump)), share);
    if landed.is_empty() {
        println!("{name:28} {:3}/{:3}", 0, fallen);
        return;
    }
    println!(
        "{name:28} {:3}/{:3} | {:5.2}  {:5.2}  {:5.2} | {:.4}  {:.4} | {:5.2}  {:5.2}",
        landed.len(),
        landed.len() + fallen,
        100.0 * of(JumpError::displacement_m, 0.5),
        100.0 * of(JumpError::displacement_m, 0.95),
        100.0 * of(JumpError::displacement_m, 1.0),
        of(JumpError::yaw_rad, 0.95),
        of(JumpError::yaw_rad, 1.0),
        100.0 * of(JumpError::apex_m, 0.5),
        100.0 * of(JumpError::apex_m, 0.95),
    );
}

fn cost(criterion: &mut Criterion) {
    let settings = settings(Task::Forward);
    let robot = RobotDescription::embedded("go1").expect("built in");
    let mut simulator = Simulator::new(&robot, &World::Ideal.config()).expect("as shipped");
    simulator.place(&Placement { joint_position: settings.lying_position, lying: true, seed: 0 });
    for (name, force_n) in [("four feet down", 30.0), ("in the air", 0.0)] {
        criterion.bench_function(&format!("estimator update, {name}"), |b| {
            let mut estimator = Estimator::default();
            let mut state = simulator.read().expect("the simulator answers");
            state.foot_force_n = [force_n; 4];
            let feet = feet(&settings.geometry, &state.joint_position_rad);
            b.iter(|| {
                state.robot_time_ms = state.robot_time_ms.wrapping_add(1);
                // No flight lasts longer than 1 s.
                if state.robot_time_ms.is_multiple_of(1000) {
                    estimator.reset();
                }
                *black_box(estimator.update(black_box(&state), &feet, &settings))
            });
        });
        simulator.write(&JointCommand::default()).expect("the simulator obeys");
    }
}

criterion_group!(estimator, accuracy, cost);
criterion_main!(estimator);
