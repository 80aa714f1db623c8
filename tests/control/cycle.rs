//! The control cycle on the simulator, tick by tick: STOP, faults, limits, a lost operator.

use crate::bench;
use crate::robots;
use bench::{Bench, shipped};
use proptest::prelude::*;
use quadfrog::control::command_gate::CommandGate;
use quadfrog::control::cycle::Cycle;
use quadfrog::robot::go1::convert::low_cmd;
use quadfrog::robot::go1::packet::CrcForm;
use quadfrog::robot::{JOINTS, JointCommand, MotorCommand, RobotState};
use quadfrog::telemetry::{Command, CommandRefusal, Event, Mode, Permit, Tick, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, JumpParameters};
use robots::LinkedRobot;

/// A simulator that lies.
fn simulated() -> Bench<LinkedRobot> {
    let (config, description, settings) = shipped(Backend::Simulator);
    let robot = LinkedRobot { linked: false, ..LinkedRobot::lying(&description, &config.simulator) };
    Bench::new(config, settings, robot)
}

#[test]
fn an_operator_arms_jumps_and_sits_down() {
    let mut bench = simulated().reach(Mode::Review);
    let ended = Event::TrialEnded { trial: 3, ticks: bench.trial_ticks, end: TrialEnd::Settled };
    assert!(bench.events.contains(&ended), "{:?}", bench.events);
    bench.command(Command::EndReview);
    assert_eq!(bench.cycle.mode(), Mode::Ready);
    bench.command(Command::SitDown);
    let tick = bench.until(Mode::Disarmed);
    assert!(bench.damps(&tick));
}

#[test]
fn stop_from_every_mode_damps_in_the_same_tick() {
    for &mode in Mode::ALL {
        let mut bench = simulated().reach(mode);
        let expected = if mode == Mode::Fault { Mode::Fault } else { Mode::Damped };
        for n in 0..21 {
            let tick = bench.stop(None);
            assert_eq!(tick.mode, expected, "from {mode:?}");
            assert!(bench.damps(&tick), "from {mode:?}, {n} ms: {:?}", tick.command.motor[0]);
        }
    }
}

#[test]
fn a_stop_and_an_approval_in_one_tick_stop() {
    let mut bench = simulated().reach(Mode::Ready);
    let tick = bench.stop(Some(bench.approved()));
    assert_eq!(tick.mode, Mode::Damped);
    assert!(bench.damps(&tick));
}

/// A command in the tick of a STOP is refused: one change of mode, and a simulated robot is not placed.
#[test]
fn a_command_in_the_tick_of_a_stop_is_refused() {
    let mut bench = simulated().reach(Mode::Disarmed);
    bench.events.clear();
    assert_eq!(bench.stop(Some(bench.arm())).mode, Mode::Damped);
    let [change, refusal] = bench.events[..] else { panic!("{:?}", bench.events) };
    assert!(matches!(change, Event::Mode { from: Mode::Disarmed, to: Mode::Damped, .. }), "{change:?}");
    let stopped = CommandRefusal::Stopped;
    assert!(matches!(refusal, Event::Refused { command: Command::Arm(_), because, .. } if because == stopped));
}

#[test]
fn a_stopped_robot_stays_damped_until_it_is_acknowledged_and_armed_anew() {
    let mut bench = simulated().reach(Mode::Ready);
    bench.stop(None);
    for command in [bench.arm(), bench.approved(), Command::EndReview, Command::Cancel] {
        let tick = bench.command(command);
        assert_eq!(tick.mode, Mode::Damped, "{command:?}");
    }
    assert_eq!(bench.command(Command::Acknowledge { stops: 0 }).mode, Mode::Disarmed);
    assert_eq!(bench.command(bench.approved()).mode, Mode::Disarmed);
    assert_eq!(bench.command(bench.arm()).mode, Mode::StandUp);
}

/// No heartbeat of the screen during a jump: the robot lands and sits down, and the trial ends with a fault.
#[test]
fn an_operator_lost_in_mid_jump_is_landed_and_sat_down() {
    let mut bench = simulated().reach(Mode::Jump);
    bench.inputs.operator_silent_ms = bench.settings.failsafe.operator_silent_ms + 1;
    let modes = bench.modes_until(Mode::Disarmed);
    assert_eq!(modes, [Mode::Jump, Mode::Settle, Mode::Review, Mode::SitDown, Mode::Disarmed]);
    assert!(matches!(bench.ends()[..], [TrialEnd::Fault(_)]), "{:?}", bench.ends());
}

#[test]
fn an_operator_lost_in_the_countdown_never_jumps() {
    let mut bench = simulated().reach(Mode::Countdown);
    bench.inputs.operator_silent_ms = bench.settings.failsafe.operator_silent_ms + 1;
    assert_eq!(bench.tick(None).mode, Mode::SitDown);
    assert!(matches!(bench.ends()[..], [TrialEnd::Fault(_)]), "{:?}", bench.ends());
}

/// A sensor that fails: named fault and damping in the same tick. Regression: the gate kept a NaN for the rate limit of the
/// next tick.
#[test]
fn a_number_that_is_none_is_a_fault_and_damps_at_once() {
    let mut bench = simulated();
    bench.cycle = Cycle::ready(&bench.settings);
    bench.robot.keeps_commands = true;
    bench.tick(None);
    bench.robot.tamper = |state| state.joint_velocity_rad_s[4] = f64::NAN;
    for _ in 0..51 {
        let tick = bench.tick(None);
        assert!(tick.mode == Mode::Fault && bench.damps(&tick));
    }
    let faults = bench.faults();
    assert!(faults.iter().any(|fault| fault.to_string().contains("joint velocity")), "{faults:?}");
    for motor in bench.robot.sent.iter().flat_map(|command| command.motor) {
        let numbers = [motor.position_rad, motor.velocity_rad_s, motor.kp_joint, motor.kd_joint, motor.torque_n_m];
        assert!(numbers.iter().all(|number| number.is_finite()), "{motor:?}");
    }
}

/// A jump that must fall: the robot is damped and comes to rest on the floor.
#[test]
fn a_fallen_robot_is_damped_and_comes_to_rest() {
    let mut bench = simulated().reach(Mode::Ready);
    let jump = JumpParameters { f0_hz: 0.8, f1_hz: 0.0, fx_n: 150.0, fy_n: 0.0, fz_n: 160.0 };
    bench.command(Command::RunTrial(TrialSpec { jump, ..bench.spec() }, bench.permit()));
    bench.until(Mode::Damped);
    assert!(matches!(bench.ends()[..], [TrialEnd::Fell(_)]), "{:?}", bench.events);
    let mut last = Tick::default();
    for _ in 0..3000 {
        last = bench.tick(None);
        assert_eq!(last.mode, Mode::Damped);
    }
    let speed = last.state.joint_velocity_rad_s.iter().fold(0.0_f64, |most, dq| most.max(dq.abs()));
    assert!(speed < 0.5, "a joint still turns at {speed} rad/s");
    let motion = last.estimate.velocity_world.norm();
    assert!(motion < 0.1, "the trunk still moves at {motion} m/s");
}

fn any_command(spec: TrialSpec) -> impl Strategy<Value = Option<Command>> {
    prop_oneof![
        6 => Just(None),
        1 => Just(Some(Command::TakeControl)),
        2 => Just(Some(Command::Arm(Permit::default()))),
        1 => Just(Some(Command::SitDown)),
        2 => Just(Some(Command::RunTrial(spec, Permit::default()))),
        1 => Just(Some(Command::Cancel)),
        1 => Just(Some(Command::EndReview)),
        1 => Just(Some(Command::Acknowledge { stops: 0 })),
    ]
}

/// Regression: the gate subtracted the wanted torque from the sum of the motor's law, which cancels beyond 1e17 N m: 1e20 N m on a joint
/// that turned at -20 rad/s left it with 50.6 N m, limit 35.55 N m.
#[test]
fn a_huge_wanted_torque_stays_within_the_limit_and_is_a_fault_on_hardware() {
    let (_, _, settings) = shipped(Backend::Hardware);
    for exponent in -2..39 {
        for torque in [0.9 * 10.0_f64.powi(exponent), -0.9 * 10.0_f64.powi(exponent)] {
            for speed in [-40.0, -20.0, 0.0, 20.0, 40.0] {
                let state = RobotState { joint_velocity_rad_s: [speed; JOINTS], ..RobotState::default() };
                let wanted = JointCommand::damped_torques(&[torque; JOINTS], 0.75, &state.joint_velocity_rad_s);
                let passed = CommandGate::default().pass(&wanted, &state, &settings);
                assert_eq!(passed.fault.is_some(), exponent > 4, "{torque} N m: {:?}", passed.fault);
                if passed.fault.is_some() {
                    assert_eq!(passed.command, JointCommand::damping(settings.gate.damping_kd));
                    continue;
                }
                for (joint, motor) in passed.command.motor.iter().enumerate() {
                    assert!(
                        motor.torque_at(0.0, speed).abs() <= settings.max_torque[joint] + 1e-9,
                        "{torque}: {motor:?}"
                    );
                }
            }
        }
    }
}

proptest! {
    /// For any wanted command and measured state: feed-forward torque and the torque of the motor's law are within the joint's
    /// limit, and a datagram can hold the command. Regression: with an encoder at 60 rad/s the gate passed more than 128 N m, the
    /// link braked, and the fault was "could not be sent (error 22)".
    #[test]
    fn what_leaves_the_gate_can_be_said(
        speed in -100.0..100.0_f64, kd in 0.0..20.0_f64, kp in 0.0..300.0_f64, position in -4.0..4.0_f64,
        torque in -500.0..500.0_f64, magnitude in 0..36_i32, before in -20.0..20.0_f64
    ) {
        let Bench { settings, .. } = simulated();
        // Half of the torques are up to 500 N m, the others up to 1e38 N m.
        let torque = if magnitude % 2 == 0 { torque } else { torque * 10.0_f64.powi(magnitude) };
        let mut gate = CommandGate::default();
        let state = RobotState { joint_velocity_rad_s: [speed; JOINTS], ..RobotState::default() };
        gate.pass(&JointCommand::torques(&[before; JOINTS]), &RobotState::default(), &settings);
        let wanted = JointCommand { motor: [MotorCommand { position_rad: position, velocity_rad_s: 0.0, kp_joint: kp, kd_joint: kd, torque_n_m: torque }; JOINTS] };
        let passed = gate.pass(&wanted, &state, &settings);
        prop_assert!(passed.fault.is_none());
        for (joint, motor) in passed.command.motor.iter().enumerate() {
            let most = settings.max_torque[joint] + 1e-9;
            prop_assert!(motor.torque_n_m.abs() <= most && motor.torque_at(0.0, speed).abs() <= most, "{motor:?}");
        }
        prop_assert!(low_cmd(&passed.command, CrcForm::Plain).is_ok());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// For any sequence of commands: motors do more than damp only after an arm command since the last damping, a jump begins only
    /// after a new approval, and the torque limits hold in every tick.
    #[test]
    fn no_sequence_energises_without_arm_and_approval(
        steps in proptest::collection::vec((any_command(simulated().spec()), 1..900_u32, proptest::bool::weighted(0.05)), 1..24)
    ) {
        let mut bench = simulated();
        let (mut armed, mut approved) = (false, false);
        for (command, ticks, stop) in steps {
            for n in 0..ticks {
                let command = command.filter(|_| n == 0);
                let before = bench.cycle.mode();
                // Half of the key presses are current, the others were made in an earlier mode.
                let command = match command {
                    Some(Command::RunTrial(..)) if ticks % 2 == 0 => Some(bench.approved()),
                    Some(Command::Arm(_)) if ticks % 2 == 0 => Some(bench.arm()),
                    command => command,
                };
                armed |= command == Some(bench.arm()) && before == Mode::Disarmed;
                approved |= command == Some(bench.approved()) && before == Mode::Ready;
                let tick = if stop && n == 0 { bench.stop(command) } else { bench.tick(command) };
                if tick.mode.energised() {
                    prop_assert!(armed, "{:?} without arm", tick.mode);
                } else {
                    armed = false;
                    prop_assert!(bench.damps(&tick) || matches!(tick.mode, Mode::Offline | Mode::Observe));
                }
                if matches!(tick.mode, Mode::Countdown | Mode::Jump | Mode::Settle) {
                    prop_assert!(approved, "{:?} without approval", tick.mode);
                } else {
                    approved = false;
                }
                let state = &tick.state;
                if tick.mode.energised() {
                    for (joint, motor) in tick.command.motor.iter().enumerate() {
                        let torque = motor.torque_at(state.joint_position_rad[joint], state.joint_velocity_rad_s[joint]);
                        prop_assert!(torque.abs() <= bench.settings.max_torque[joint] + 1e-9, "joint {joint}: {torque}");
                    }
                }
            }
        }
    }
}

/// Regression: an acknowledgement that had waited in a queue cleared a STOP that was pressed after it.
#[test]
fn a_stop_outlives_an_acknowledgement_of_an_earlier_one() {
    let latch = quadfrog::realtime::channel::StopLatch::default();
    latch.set();
    let seen = latch.count();
    latch.set();
    latch.acknowledge(seen);
    assert!(latch.is_set(), "the second STOP was not looked after");
    latch.acknowledge(latch.count());
    assert!(!latch.is_set());
}

/// Regression: a simulated robot that fell onto unfolded legs could not be armed again, because the floor blocked a thigh each time.
#[test]
fn a_simulated_robot_that_fell_stands_up_again() {
    let mut bench = simulated().reach(Mode::Ready);
    let Command::RunTrial(mut spec, permit) = bench.approved() else { panic!("an approval") };
    spec.jump = JumpParameters { f0_hz: 1.178, fx_n: 135.9, fz_n: 213.5, ..spec.jump };
    bench.command(Command::RunTrial(spec, permit));
    bench.until(Mode::Damped);
    bench.ticks(3000);
    bench.command(Command::Acknowledge { stops: 0 });
    bench.command(bench.arm());
    assert_eq!(bench.cycle.mode(), Mode::StandUp, "{:?}", bench.refusal());
    assert!(bench.events.contains(&Event::SetUpright));
    bench.until(Mode::Ready);
}
