//! Signs of the force amplitudes of every task: directions, mirror images, and the motion that they cause on the simulator.

use nalgebra::Vector3;
use quadfrog::config::Config;
use quadfrog::control::force_profile::{amplitudes_leg, second_direction};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{Leg, PerLeg};
use quadfrog::session::objective;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{Backend, JumpParameters, MeasuredJump, Task};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The task whose motion is the mirror image, left for right.
fn mirrored(task: Task) -> Task {
    match task {
        Task::Forward => Task::Forward,
        Task::LateralLeft => Task::LateralRight,
        Task::LateralRight => Task::LateralLeft,
        Task::TwistCcw => Task::TwistCw,
        Task::TwistCw => Task::TwistCcw,
    }
}

/// The mirror image of the parameters: only the `Fy` of a forward jump points to a side by itself.
fn mirrored_jump(jump: &JumpParameters, task: Task) -> JumpParameters {
    JumpParameters { fy_n: if task == Task::Forward { -jump.fy_n } else { jump.fy_n }, ..*jump }
}

fn random_jump(random: &mut ChaCha8Rng) -> JumpParameters {
    let mut draw = |low: f64, high: f64| low + (high - low) * f64::from(random.next_u32()) / f64::from(u32::MAX);
    JumpParameters {
        f0_hz: draw(0.75, 1.75),
        f1_hz: 0.0,
        fx_n: draw(-150.0, 150.0),
        fy_n: draw(-150.0, 150.0),
        fz_n: draw(150.0, 350.0),
    }
}

#[test]
fn the_amplitudes_of_mirrored_tasks_are_mirror_images() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for case in 0..200 {
        let jump = random_jump(&mut random);
        for task in Task::ALL {
            let ours = amplitudes_leg(&jump, task);
            let image = amplitudes_leg(&mirrored_jump(&jump, task), mirrored(task));
            for leg in Leg::ALL {
                let opposite = Leg::ALL
                    .into_iter()
                    .find(|other| other.front_sign() == leg.front_sign() && other.left_sign() == -leg.left_sign())
                    .unwrap();
                let expected = ours[opposite as usize].component_mul(&Vector3::new(1.0, -1.0, 1.0));
                assert_eq!(image[leg as usize], expected, "case {case}, {}, {leg:?}", task.name());
            }
        }
    }
}

/// `Fx` points forward in every task, `Fy` to the left of a forward and a left jump, to the right of a right jump, and turns a
/// twist. Without a second direction the amplitudes are those of the paper.
#[test]
fn every_amplitude_has_the_sign_of_its_direction() {
    let jump = JumpParameters { f0_hz: 1.0, f1_hz: 0.0, fx_n: 30.0, fy_n: 20.0, fz_n: 200.0 };
    for (task, front_y, rear_y, second) in [
        (Task::Forward, 20.0, 20.0, "Fy"),
        (Task::LateralLeft, 20.0, 20.0, "Fx"),
        (Task::LateralRight, -20.0, -20.0, "Fx"),
        (Task::TwistCcw, 20.0, -20.0, "Fx"),
        (Task::TwistCw, -20.0, 20.0, "Fx"),
    ] {
        let [front, rear] = [front_y, rear_y].map(|y| Vector3::new(30.0, y, 200.0));
        let expected: PerLeg<Vector3<f64>> = [front, front, rear, rear];
        assert_eq!(amplitudes_leg(&jump, task), expected, "{}", task.name());
        assert_eq!(second_direction(task), second, "{}", task.name());
    }
}

fn run(task: Task, jump: JumpParameters) -> MeasuredJump {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, task, Backend::Simulator).unwrap();
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator).unwrap(), &settings);
    let spec = config.task(task).trial(task, jump);
    let (end, ticks) = rollout.run(&spec);
    assert_eq!(end, TrialEnd::Settled, "{} {jump:?}", task.name());
    objective::measure(&spec.objective(), ticks).unwrap()
}

#[test]
fn the_second_direction_moves_the_simulated_robot_to_its_side() {
    let jump = |fx_n, fy_n| JumpParameters { f0_hz: 1.4, f1_hz: 0.0, fx_n, fy_n, fz_n: 220.0 };
    for task in [Task::LateralLeft, Task::LateralRight, Task::TwistCcw, Task::TwistCw] {
        let [back, none, ahead] = [-20.0, 0.0, 20.0].map(|fx_n| run(task, jump(fx_n, 30.0)).dx_m);
        assert!(back < none - 0.02 && ahead > none + 0.02, "{}: {back} {none} {ahead}", task.name());
    }
    let [right, none, left] = [-20.0, 0.0, 20.0].map(|fy_n| run(Task::Forward, jump(40.0, fy_n)).dy_m);
    assert!(right < -0.02 && none.abs() < 0.01 && left > 0.02, "{right} {none} {left}");
}

/// The robot's masses are symmetric to a few millimetres only.
#[test]
fn mirrored_jumps_are_mirror_images_on_the_simulator() {
    let jump = JumpParameters { f0_hz: 1.4, f1_hz: 0.0, fx_n: -15.0, fy_n: 30.0, fz_n: 220.0 };
    for task in [Task::Forward, Task::LateralLeft, Task::TwistCcw] {
        let (ours, image) = (run(task, jump), run(mirrored(task), mirrored_jump(&jump, task)));
        let differences = [ours.dx_m - image.dx_m, ours.dy_m + image.dy_m, ours.dyaw_rad + image.dyaw_rad];
        assert!(differences.iter().all(|difference| difference.abs() < 0.05), "{}: {ours:?} {image:?}", task.name());
    }
}
