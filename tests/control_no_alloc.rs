//! The control loop allocates and frees nothing: whole trials, STOP, faults, falls and every mode under an allocator that aborts,
//! with the simulator and with a robot over a link.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/bench.rs"]
mod bench;
#[path = "support/no_alloc.rs"]
mod no_alloc;
#[path = "support/robots.rs"]
mod robots;

use std::collections::BTreeSet;

use bench::{LoopBench, shipped};
use no_alloc::without_allocation;
use quadfrog::robot::{Placement, Robot, RobotState};
use quadfrog::telemetry::{Command, Mode};
use quadfrog::trial::{Backend, JumpParameters, Task};
use robots::LinkedRobot;

fn approve(bench: &mut LoopBench<LinkedRobot>, fx_n: f64, f0_hz: f64) {
    let jump = JumpParameters { f0_hz, f1_hz: 0.0, fx_n, fy_n: 0.0, fz_n: 220.0 };
    let spec = bench.config.task(Task::Forward).trial(Task::Forward, jump);
    // Still for long enough to be ready.
    bench.ticks(1200);
    bench.command(Command::RunTrial(spec, bench.permit()));
}

/// Acknowledges a stop and lays the robot down.
fn recover(bench: &mut LoopBench<LinkedRobot>, lying: &Placement) {
    let stops = bench.session.stop.count();
    bench.command(Command::Acknowledge { stops });
    assert_eq!(bench.body.mode(), Mode::Disarmed);
    // A real robot is folded by hand; a simulated one is placed.
    bench.robot.simulator.place(lying);
    bench.tick();
    if bench.body.mode() == Mode::Fault {
        bench.command(Command::Acknowledge { stops });
    }
    bench.ticks(1500);
}

/// All modes, a good trial, a fall, STOP, every kind of fault, a lost operator, refused commands.
fn everything(backend: Backend) {
    let (config, description, settings) = shipped(backend);
    let lying = Placement { joint_position: settings.lying_position, lying: true, seed: 0 };
    let robot = LinkedRobot::lying(&description, &config.simulator);
    let robot = LinkedRobot { linked: backend == Backend::Hardware, ..robot };
    let mut bench = LoopBench::new(config, &settings, robot, |tick| without_allocation(tick));
    bench.ticks(6);
    bench.command(Command::TakeControl);
    if backend == Backend::Hardware {
        // Refused: the gyroscope has not been still for a second yet.
        bench.command(Command::Arm(bench.permit()));
        assert_eq!(bench.body.mode(), Mode::Disarmed);
    }
    bench.ticks(1500);
    bench.stand();
    approve(&mut bench, 60.0, 1.3);
    bench.until(Mode::Review);
    bench.command(Command::EndReview);
    bench.command(Command::Arm(bench.permit()));
    bench.command(Command::SitDown);
    bench.until(Mode::Disarmed);
    bench.ticks(1500);

    bench.stand();
    approve(&mut bench, 150.0, 0.8);
    bench.until(Mode::Damped);
    bench.ticks(2000);
    recover(&mut bench, &lying);

    bench.stand();
    bench.screen.stop.set();
    bench.ticks(1000);
    assert_eq!(bench.body.mode(), Mode::Damped);
    recover(&mut bench, &lying);

    let tampers: [fn(&mut RobotState); 4] = [
        |state| state.joint_velocity_rad_s[3] = f64::NAN,
        |state| state.motor_enabled[3] = false,
        |state| state.joint_position_rad[3] = 2.0,
        |state| state.motor_temperature_c[3] = 90.0,
    ];
    for tamper in tampers {
        bench.stand();
        bench.robot.tamper = tamper;
        bench.ticks(300);
        assert_eq!(bench.body.mode(), Mode::Fault);
        bench.robot.tamper = |_| {};
        bench.ticks(1500);
        recover(&mut bench, &lying);
    }
    bench.stand();
    bench.robot.silent_ms = 30;
    bench.ticks(300);
    bench.robot.silent_ms = 0;
    bench.ticks(10);
    recover(&mut bench, &lying);
    bench.robot.send_errno = Some(111);
    bench.ticks(10);
    assert_eq!(bench.body.mode(), Mode::Fault);
    bench.robot.send_errno = None;
    bench.ticks(10);
    recover(&mut bench, &lying);

    bench.stand();
    bench.beats = false;
    bench.until(Mode::Disarmed);
    bench.command(Command::Leave);
    let all: BTreeSet<_> = Mode::ALL.iter().map(|mode| mode.name()).filter(|name| *name != "OFFLINE").collect();
    assert_eq!(bench.seen, all);
}

#[test]
fn the_body_with_the_simulator_never_allocates() {
    everything(Backend::Simulator);
}

#[test]
fn the_body_with_a_linked_robot_never_allocates() {
    everything(Backend::Hardware);
}
