//! Faults while the robot stands, stands up or waits for its impulse, injected at an emulated Go1: delay and losses of the link, a lost
//! link, a blocked joint; and gains that change. Prints the measured times.

use crate::bench;
use crate::emulated;
use emulated::{EmulatedBench, emulated, hardware_like};
use quadfrog::control::command_gate::CommandGate;
use quadfrog::robot::{JOINTS, JointCommand, MotorCommand, RobotState};
use quadfrog::sim::SimConfig;
use quadfrog::telemetry::{Command, CommandRefusal, FailsafeWarning, Fault, Mode, TrialInhibit, TrialSpec};
use quadfrog::trial::Gains;

type Model = fn(&mut SimConfig);
const MODELS: [(&str, Model); 2] = [("ideal", |_| {}), ("hardware-like", hardware_like)];

fn height_m(bench: &EmulatedBench) -> f64 {
    bench.robot.emulator.status().truth.unwrap().position_world.z
}

/// Regression: a delay was invisible, "link 0 ms", until the standing robot shook.
#[test]
fn a_growing_delay_warns_holds_and_lands() {
    for (name, model) in MODELS {
        // A warning at 4 ms.
        let mut bench = emulated(model).reach(Mode::Ready);
        bench.settle();
        bench.inject("delay 4");
        bench.ticks(30);
        let warned = bench.cycle.readiness().warning;
        assert!(matches!(warned, Some(FailsafeWarning::LinkDelay { .. })), "{warned:?}");
        assert_eq!((bench.cycle.mode(), bench.cycle.readiness().inhibit), (Mode::Ready, None));

        // No approval at 6 ms.
        bench.inject("clear");
        bench.inject("delay 6");
        bench.ticks(30);
        bench.command(bench.approved());
        let refused = bench.refusal();
        let Some(CommandRefusal::Inhibited(TrialInhibit::LinkDelay { measured_ms, allowed_ms })) = refused else {
            panic!("{refused:?}, {:?}", bench.events.last())
        };
        assert!((5.0..8.0).contains(&measured_ms) && allowed_ms == 5.0, "{measured_ms}");

        // Sitting down at 12 ms; the ramp runs in the motors.
        bench.inject("clear");
        bench.ticks(1000);
        assert_eq!((bench.cycle.mode(), bench.cycle.readiness().inhibit), (Mode::Ready, None));
        bench.events.clear();
        bench.inject("delay 12");
        let ms = bench.ticks_in_mode(Mode::Ready, 100);
        println!("{name}: delay of 12 ms: {:?} after {ms} ms: {:?}", bench.cycle.mode(), bench.events);
        assert_eq!(bench.cycle.mode(), Mode::SitDown, "{:?}", bench.events);
        bench.until(Mode::Disarmed);
        assert_eq!(bench.faults(), []);
    }
}

/// A steady drift of the clocks of 80 parts per million is no delay: 5 ms in a minute.
#[test]
fn clocks_that_drift_apart_are_no_delay() {
    let mut bench = emulated(|_| {}).reach(Mode::Disarmed);
    bench.period_ns = 1_000_080;
    bench.ticks(50_000);
    assert_eq!((bench.cycle.readiness().warning, bench.cycle.readiness().inhibit), (None, None));
}

#[test]
fn a_link_that_loses_states_warns() {
    let mut bench = emulated(|_| {}).reach(Mode::Ready);
    bench.settle();
    bench.inject("loss 3");
    bench.ticks(600);
    let warned = bench.cycle.readiness().warning;
    assert!(matches!(warned, Some(FailsafeWarning::StatesLost { .. })), "{warned:?}");
    assert_eq!(bench.cycle.mode(), Mode::Ready);
}

/// The joint damping is the motors' own. While no command arrives, and until the robot's own time-out, the joints stay damped.
#[test]
fn damping_needs_no_network() {
    let mut bench = emulated(|_| {}).reach(Mode::Ready);
    bench.settle();
    let tick = bench.tick(None);
    for (joint, motor) in bench.robot.sent.motor.iter().enumerate() {
        assert_eq!((motor.kp_joint, motor.kd_joint, motor.velocity_rad_s), (0.0, 0.75, 0.0), "0.8 in steps of 1/16");
        let dq = tick.state.joint_velocity_rad_s[joint];
        assert!((motor.torque_at(0.0, dq) - tick.torque_demanded[joint]).abs() < 1e-9, "the same law");
    }
}

/// The gate keeps the law's torque at the measured velocity and as much damping as the feed-forward torque has room for.
#[test]
fn the_gate_keeps_damping_within_the_torque_limit() {
    let (_, _, settings) = bench::shipped(quadfrog::trial::Backend::Hardware);
    for asked_n_m in [-60.0, -20.0, 0.0, 5.0, 20.0, 60.0] {
        for dq in [-60.0, -25.0, -1.0, 0.0, 3.0, 25.0, 60.0] {
            let state = RobotState { joint_velocity_rad_s: [dq; JOINTS], ..RobotState::default() };
            let wanted = JointCommand::damped_torques(&[asked_n_m; JOINTS], 2.0, &[dq; JOINTS]);
            let mut gate = CommandGate::default();
            let passed = gate.pass(&wanted, &state, &settings);
            for (joint, motor) in passed.command.motor.iter().enumerate() {
                let most = settings.max_torque[joint];
                let MotorCommand { kp_joint, kd_joint, torque_n_m, .. } = *motor;
                assert!(
                    torque_n_m.abs() <= most + 1e-9 && kp_joint == 0.0 && (0.0..=2.0).contains(&kd_joint),
                    "{motor:?}"
                );
                let expected = asked_n_m.clamp(-most, most);
                assert!((motor.torque_at(0.0, dq) - expected).abs() < 1e-9, "{asked_n_m} at {dq}: {motor:?}");
                let limited = passed.limited >> joint & 1 == 1;
                assert_eq!(limited, asked_n_m.abs() > most, "{asked_n_m} at {dq}");
            }
        }
    }
}

/// Regression: a blocked leg was pushed for the whole ramp and its time-out, 3.5 s.
#[test]
fn a_blocked_joint_ends_the_ramp_with_its_name() {
    for (name, model) in MODELS {
        for joint in ["FR_calf", "RL_thigh"] {
            let mut bench = emulated(model).reach(Mode::StandUp);
            bench.ticks(200);
            bench.inject(&format!("stuck {joint}"));
            let ms = bench.ticks_in_mode(Mode::StandUp, 4000);
            let faults = bench.faults();
            println!("{name}: {joint} stuck: damped after {ms} ms: {}", faults[0]);
            assert!(ms < 1200 && faults[0].to_string().contains(&format!("{joint} blocked")), "{ms} ms: {faults:?}");
            for motor in bench.robot.sent.motor {
                assert_eq!(motor.kp_joint, 0.0, "damped");
            }
        }
        let mut bench = emulated(model).reach(Mode::Ready);
        bench.ticks(100);
        bench.command(Command::SitDown);
        bench.ticks(200);
        bench.inject("stuck FL_thigh");
        let ms = bench.ticks_in_mode(Mode::SitDown, 4000);
        println!("{name}: FL_thigh stuck while sitting down: {:?} after {ms} ms", bench.faults());
        let blocked = |fault: &Fault| fault.to_string().contains("FL_thigh blocked");
        assert!(ms < 1200 && bench.faults().iter().any(blocked), "{ms} ms: {:?}", bench.events);
    }
}

/// Regression: the approval of a trial with 800 N/m in place of 400 lifted the trunk by 5 cm at once.
#[test]
fn approving_other_gains_does_not_jerk_the_robot() {
    for (name, model) in MODELS {
        let mut bench = emulated(model).reach(Mode::Ready);
        bench.settle();
        let gains = Gains { kp: 800.0, ..bench.spec().gains };
        let spec = TrialSpec { gains, ..bench.spec() };
        let fastest = |bench: &mut EmulatedBench, ticks: u32| {
            let mut fastest = 0.0_f64;
            for _ in 0..ticks {
                bench.tick(None);
                let truth = bench.robot.emulator.status().truth.unwrap();
                fastest = fastest.max(truth.velocity_world.norm());
            }
            fastest
        };
        let before_m = height_m(&bench);
        bench.command(Command::RunTrial(spec, bench.permit()));
        let approved = fastest(&mut bench, 2000);
        let raised_m = height_m(&bench) - before_m;
        bench.command(Command::Cancel);
        let cancelled = fastest(&mut bench, 1000);
        println!("{name}: raised by {raised_m:.3} m, trunk at most {approved:.3} m/s, back {cancelled:.3} m/s");
        assert!(raised_m > 0.02 && approved < 0.15 && cancelled < 0.15, "{approved} {cancelled}");
        assert_eq!(bench.cycle.mode(), Mode::Ready);
    }
}
