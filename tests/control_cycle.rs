//! The control cycle on the simulator, tick by tick: STOP, faults, limits, a lost operator.

use proptest::prelude::*;
use quadfrog::config::Config;
use quadfrog::control::cycle::{Cycle, Inputs};
use quadfrog::control::limits::CommandGate;
use quadfrog::control::settings::ControlSettings;
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::go1::convert::low_cmd;
use quadfrog::robot::go1::packet::CrcForm;
use quadfrog::robot::{JOINTS, JointCommand, MotorCommand, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Command, CommandRefusal, Event, Mode, Permit, Tick, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, JumpParameters, Task};

struct Bench {
    config: Config,
    settings: ControlSettings,
    cycle: Cycle,
    robot: Simulator,
    time_ms: u64,
    events: Vec<Event>,
    /// Ticks of trials.
    trial_ticks: u64,
}

impl Bench {
    fn new() -> Bench {
        let config = Config::load(None).unwrap();
        let description = RobotDescription::embedded("go1").unwrap();
        let settings = config.settings(&description, Task::Forward, Backend::Simulator).unwrap();
        let mut robot = Simulator::new(&description, &config.simulator).unwrap();
        robot.place(&Placement { joint_position: settings.lying_position, lying: true, seed: 0 });
        Bench { config, settings, cycle: Cycle::new(&settings), robot, time_ms: 0, events: Vec::new(), trial_ticks: 0 }
    }

    fn tick(&mut self, inputs: Inputs) -> Tick {
        self.time_ms += 1;
        let inputs = Inputs { time_ns: self.time_ms * 1_000_000, ..inputs };
        let tick = *self.cycle.tick(&inputs, &SimulatedClock, &mut self.robot);
        self.events.extend(self.cycle.events().iter());
        self.trial_ticks += u64::from(tick.trial.is_some());
        tick
    }

    fn command(&mut self, command: Command) -> Tick {
        self.tick(Inputs { command: Some(command), ..Inputs::default() })
    }

    /// Ticks without a command until `mode`.
    fn until(&mut self, mode: Mode) -> Tick {
        for _ in 0..20_000 {
            let tick = self.tick(Inputs::default());
            if tick.mode == mode {
                return tick;
            }
        }
        panic!("never {mode:?}; last {:?}", self.cycle.mode());
    }

    fn spec(&self) -> TrialSpec {
        let jump = JumpParameters { f0_hz: 1.3, f1_hz: 0.0, fx_n: 100.0, fy_n: 0.0, fz_n: 270.0 };
        TrialSpec { trial: 7, ..self.config.task(Task::Forward).trial(Task::Forward, jump) }
    }

    /// An approval given now, with every change of mode counted.
    fn approval(&self) -> Permit {
        let changes = self.events.iter().filter(|event| matches!(event, Event::Mode { .. })).count();
        Permit { mode_changes: changes as u64, given_ns: self.time_ms * 1_000_000 }
    }

    fn approved(&self) -> Command {
        Command::RunTrial(self.spec(), self.approval())
    }

    fn arm(&self) -> Command {
        Command::Arm(self.approval())
    }

    /// Brings the machine into `mode` with an operator's commands.
    fn reach(&mut self, mode: Mode) {
        if mode == Mode::Offline {
            return;
        }
        self.tick(Inputs::default());
        let way: [(Mode, Option<Command>); 9] = [
            (Mode::Observe, None),
            (Mode::Disarmed, Some(Command::TakeControl)),
            (Mode::StandUp, Some(Command::Arm(Permit::default()))),
            (Mode::Ready, None),
            (Mode::Countdown, Some(Command::RunTrial(self.spec(), Permit::default()))),
            (Mode::Jump, None),
            (Mode::Settle, None),
            (Mode::Review, None),
            (Mode::SitDown, Some(Command::SitDown)),
        ];
        for (step, command) in way {
            match command {
                // Any change of mode voids an approval.
                Some(Command::RunTrial(..)) => drop(self.command(self.approved())),
                Some(Command::Arm(_)) => drop(self.command(self.arm())),
                Some(command) => drop(self.command(command)),
                None if self.cycle.mode() != step => drop(self.until(step)),
                None => {}
            }
            if step == mode {
                assert_eq!(self.cycle.mode(), mode);
                return;
            }
        }
        self.tick(Inputs { stop: true, ..Inputs::default() });
        if mode == Mode::Fault {
            self.tick(Inputs { events_lost: true, ..Inputs::default() });
        }
        assert_eq!(self.cycle.mode(), mode);
    }
}

fn is_damping(command: &JointCommand, settings: &ControlSettings) -> bool {
    command.motor.iter().all(|motor| motor.kp == 0.0 && motor.velocity == 0.0 && motor.kd == settings.gate.damping_kd)
}

#[test]
fn an_operator_arms_jumps_and_sits_down() {
    let mut bench = Bench::new();
    bench.reach(Mode::Review);
    let ended = bench.events.iter().find_map(|event| match event {
        Event::TrialEnded { trial, ticks, end } => Some((*trial, *ticks, *end)),
        _ => None,
    });
    assert_eq!(ended, Some((7, bench.trial_ticks, TrialEnd::Settled)));
    bench.command(Command::EndReview);
    assert_eq!(bench.cycle.mode(), Mode::Ready);
    bench.command(Command::SitDown);
    let tick = bench.until(Mode::Disarmed);
    assert!(is_damping(&tick.command, &bench.settings));
}

/// STOP from every mode sends damping in the same tick.
#[test]
fn stop_from_every_mode_damps_in_the_same_tick() {
    for &mode in Mode::ALL {
        let mut bench = Bench::new();
        bench.reach(mode);
        let tick = bench.tick(Inputs { stop: true, ..Inputs::default() });
        let expected = if mode == Mode::Fault { Mode::Fault } else { Mode::Damped };
        assert_eq!(tick.mode, expected, "from {mode:?}");
        assert!(is_damping(&tick.command, &bench.settings), "from {mode:?}: {:?}", tick.command.motor[0]);
        for _ in 0..20 {
            let tick = bench.tick(Inputs { stop: true, ..Inputs::default() });
            assert!(is_damping(&tick.command, &bench.settings), "damping goes on being sent, from {mode:?}");
        }
    }
}

/// STOP takes precedence over a command of the same tick.
#[test]
fn a_stop_and_an_approval_in_one_tick_stop() {
    let mut bench = Bench::new();
    bench.reach(Mode::Ready);
    let command = Some(bench.approved());
    let tick = bench.tick(Inputs { stop: true, command, ..Inputs::default() });
    assert_eq!(tick.mode, Mode::Damped);
    assert!(is_damping(&tick.command, &bench.settings));
}

/// A command in the tick of a STOP is refused: one change of mode, and a simulated robot is not placed.
#[test]
fn a_command_in_the_tick_of_a_stop_is_refused() {
    let mut bench = Bench::new();
    bench.reach(Mode::Disarmed);
    let command = bench.arm();
    bench.events.clear();
    let tick = bench.tick(Inputs { stop: true, command: Some(command), ..Inputs::default() });
    assert_eq!(tick.mode, Mode::Damped);
    assert!(
        matches!(
            bench.events[..],
            [
                Event::Mode { from: Mode::Disarmed, to: Mode::Damped, .. },
                Event::Refused { command: Command::Arm(_), because: CommandRefusal::Stopped, .. },
            ]
        ),
        "{:?}",
        bench.events
    );
}

#[test]
fn a_stopped_robot_stays_damped_until_it_is_acknowledged_and_armed_anew() {
    let mut bench = Bench::new();
    bench.reach(Mode::Ready);
    bench.tick(Inputs { stop: true, ..Inputs::default() });
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
    let mut bench = Bench::new();
    bench.reach(Mode::Jump);
    let silent = Inputs { operator_silent_ms: bench.settings.watchdog.operator_silent_ms + 1, ..Inputs::default() };
    let mut modes = vec![Mode::Jump];
    for _ in 0..12_000 {
        let tick = bench.tick(silent);
        if *modes.last().unwrap() != tick.mode {
            modes.push(tick.mode);
        }
        if tick.mode == Mode::Disarmed {
            break;
        }
    }
    assert_eq!(modes, [Mode::Jump, Mode::Settle, Mode::Review, Mode::SitDown, Mode::Disarmed]);
    let end = bench.events.iter().find_map(|event| match event {
        Event::TrialEnded { end, .. } => Some(*end),
        _ => None,
    });
    assert!(matches!(end, Some(TrialEnd::Fault(_))), "{end:?}");
}

#[test]
fn an_operator_lost_in_the_countdown_never_jumps() {
    let mut bench = Bench::new();
    bench.reach(Mode::Countdown);
    let silent = Inputs { operator_silent_ms: bench.settings.watchdog.operator_silent_ms + 1, ..Inputs::default() };
    assert_eq!(bench.tick(silent).mode, Mode::SitDown);
    assert!(bench.events.iter().any(|event| matches!(event, Event::TrialEnded { end: TrialEnd::Fault(_), .. })));
}

/// A sensor that fails: named fault and damping in the same tick.
#[test]
fn a_number_that_is_none_is_a_fault_and_damps_at_once() {
    struct Broken(Simulator, bool);
    impl Robot for Broken {
        fn read(&mut self) -> Result<RobotState, RobotError> {
            let mut state = self.0.read()?;
            if self.1 {
                state.joint_velocity[4] = f64::NAN;
            }
            Ok(state)
        }
        fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
            for motor in &command.motor {
                let numbers = [motor.position, motor.velocity, motor.kp, motor.kd, motor.torque];
                assert!(numbers.iter().all(|number| number.is_finite()), "{command:?}");
            }
            self.0.write(command)
        }
        fn place(&mut self, placement: &Placement) -> bool {
            self.0.place(placement)
        }
    }
    let Bench { settings, robot, .. } = Bench::new();
    let mut robot = Broken(robot, false);
    let mut cycle = Cycle::ready(&settings);
    cycle.tick(&Inputs::default(), &SimulatedClock, &mut robot);
    robot.1 = true;
    let tick = *cycle.tick(&Inputs::default(), &SimulatedClock, &mut robot);
    assert_eq!(tick.mode, Mode::Fault);
    assert!(is_damping(&tick.command, &settings));
    // Regression: the gate kept a NaN for the rate limit of the next tick.
    let causes: Vec<String> = cycle
        .events()
        .iter()
        .filter_map(|event| match event {
            Event::Mode { cause, .. } => Some(cause.to_string()),
            _ => None,
        })
        .collect();
    assert!(causes.iter().any(|cause| cause.contains("joint velocity")), "{causes:?}");
    for _ in 0..50 {
        let tick = *cycle.tick(&Inputs::default(), &SimulatedClock, &mut robot);
        assert!(tick.mode == Mode::Fault && is_damping(&tick.command, &settings));
    }
}

/// A jump that must fall: the robot is damped and comes to rest on the floor.
#[test]
fn a_fallen_robot_is_damped_and_comes_to_rest() {
    let mut bench = Bench::new();
    bench.reach(Mode::Ready);
    let mut spec = bench.spec();
    spec.jump = JumpParameters { f0_hz: 0.8, f1_hz: 0.0, fx_n: 150.0, fy_n: 0.0, fz_n: 160.0 };
    let approval = bench.approval();
    bench.command(Command::RunTrial(spec, approval));
    bench.until(Mode::Damped);
    let fell = bench.events.iter().any(|event| matches!(event, Event::TrialEnded { end: TrialEnd::Fell(_), .. }));
    assert!(fell, "{:?}", bench.events);
    let mut last = Tick::default();
    for _ in 0..3000 {
        last = bench.tick(Inputs::default());
        assert_eq!(last.mode, Mode::Damped);
    }
    let speed = last.state.joint_velocity.iter().fold(0.0_f64, |most, dq| most.max(dq.abs()));
    assert!(speed < 0.5, "a joint still turns at {speed} rad/s");
    let motion = last.estimate.velocity_world.norm();
    assert!(motion < 0.1, "the trunk still moves at {motion} m/s");
}

/// A state that is too old is a fault of that name.
#[test]
fn a_silent_robot_is_a_fault() {
    struct Silent(Simulator, u32);
    impl Robot for Silent {
        fn read(&mut self) -> Result<RobotState, RobotError> {
            if self.1 == 0 { self.0.read() } else { Err(RobotError::Silent { age_ms: self.1 }) }
        }
        fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
            self.0.write(command)
        }
        fn place(&mut self, placement: &Placement) -> bool {
            self.0.place(placement)
        }
    }
    let Bench { settings, robot, .. } = Bench::new();
    let mut robot = Silent(robot, 0);
    let mut cycle = Cycle::ready(&settings);
    cycle.tick(&Inputs::default(), &SimulatedClock, &mut robot);
    for age_ms in 1..=settings.watchdog.state_age_ms {
        robot.1 = age_ms;
        assert_eq!(cycle.tick(&Inputs::default(), &SimulatedClock, &mut robot).mode, Mode::Ready, "at {age_ms} ms");
    }
    robot.1 += 1;
    let tick = *cycle.tick(&Inputs::default(), &SimulatedClock, &mut robot);
    assert_eq!(tick.mode, Mode::Fault);
    assert!(is_damping(&tick.command, &settings));
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

proptest! {
    /// For any wanted command and measured state: feed-forward torque and the torque of the motor's law are within the joint's
    /// limit, and a datagram can hold the command. Regression: with an encoder at 60 rad/s the gate passed more than 128 N m, the
    /// link braked, and the fault was "could not be sent (error 22)".
    #[test]
    fn what_leaves_the_gate_can_be_said(
        speed in -100.0..100.0_f64, kd in 0.0..20.0_f64, kp in 0.0..300.0_f64, position in -4.0..4.0_f64,
        torque in -500.0..500.0_f64, before in -20.0..20.0_f64
    ) {
        let Bench { settings, .. } = Bench::new();
        let mut gate = CommandGate::default();
        let state = RobotState { joint_velocity: [speed; JOINTS], ..RobotState::default() };
        gate.pass(&JointCommand::torques(&[before; JOINTS]), &RobotState::default(), &settings);
        let wanted = JointCommand { motor: [MotorCommand { position, velocity: 0.0, kp, kd, torque }; JOINTS] };
        let passed = gate.pass(&wanted, &state, &settings);
        prop_assert!(passed.fault.is_none());
        for (joint, motor) in passed.command.motor.iter().enumerate() {
            let most = settings.max_torque[joint] + 1e-9;
            prop_assert!(motor.torque.abs() <= most && motor.torque_at(0.0, speed).abs() <= most, "{motor:?}");
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
        steps in proptest::collection::vec((any_command(Bench::new().spec()), 1..900_u32, proptest::bool::weighted(0.05)), 1..24)
    ) {
        let mut bench = Bench::new();
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
                let tick = bench.tick(Inputs { command, stop: stop && n == 0, ..Inputs::default() });
                if tick.mode.energised() {
                    prop_assert!(armed, "{:?} without arm", tick.mode);
                } else {
                    armed = false;
                    prop_assert!(is_damping(&tick.command, &bench.settings) || matches!(tick.mode, Mode::Offline | Mode::Observe));
                }
                if matches!(tick.mode, Mode::Countdown | Mode::Jump | Mode::Settle) {
                    prop_assert!(approved, "{:?} without approval", tick.mode);
                } else {
                    approved = false;
                }
                let state = &tick.state;
                if tick.mode.energised() {
                    for (joint, motor) in tick.command.motor.iter().enumerate() {
                        let torque = motor.torque_at(state.joint_position[joint], state.joint_velocity[joint]);
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
