//! Every row of the table of watchdogs (`docs/safety.md`) against an emulated Go1: what is injected into the robot or
//! its network, and how soon damping is on the wire. A proxy between both ends reads the datagrams. Stepped by hand, so
//! the reaction is a number of control ticks that does not depend on the machine's speed.

#[path = "support/go1.rs"]
mod go1;

use std::net::{SocketAddr, UdpSocket};

use go1::{ANY_PORT, description, emulator, network};
use quadfrog::config::Config;
use quadfrog::control::cycle::{Cycle, Inputs};
use quadfrog::control::settings::ControlSettings;
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::go1::packet::{CrcForm, LowCmd, LowState, MODE_SERVO, POSITION_STOP};
use quadfrog::robot::{JOINTS, LEGS, LinkStatus, Robot};
use quadfrog::sim::emulator::Emulator;
use quadfrog::telemetry::{
    Command, CommandRefusal, Event, Fault, Mode, Permit, Tick, TransitionCause, TrialEnd, TrialSpec,
};
use quadfrog::trial::{Backend, JumpParameters, Task};

/// UDP proxy between controller and emulator that keeps the last command.
struct Tap {
    to_controller: UdpSocket,
    to_robot: UdpSocket,
    controller: Option<SocketAddr>,
    /// The last command in this millisecond.
    command: Option<LowCmd>,
    /// Every state reports an orientation of four zeros, which is no rotation.
    no_rotation: bool,
}

impl Tap {
    fn new(robot: SocketAddr) -> Tap {
        let socket = || {
            let socket = UdpSocket::bind(ANY_PORT).unwrap();
            socket.set_nonblocking(true).unwrap();
            socket
        };
        let (to_controller, to_robot) = (socket(), socket());
        to_robot.connect(robot).unwrap();
        Tap { to_controller, to_robot, controller: None, command: None, no_rotation: false }
    }

    fn carry_commands(&mut self) {
        let mut buffer = [0; 2048];
        self.command = None;
        while let Ok((length, from)) = self.to_controller.recv_from(&mut buffer) {
            self.controller = Some(from);
            self.command = LowCmd::parse(&buffer[..length], CrcForm::Plain).ok().copied();
            self.to_robot.send(&buffer[..length]).unwrap();
        }
    }

    fn carry_states(&mut self) {
        let mut buffer = [0; 2048];
        while let Ok(length) = self.to_robot.recv(&mut buffer) {
            let controller = self.controller.unwrap();
            if self.no_rotation {
                let mut state = *LowState::parse(&buffer[..length]).unwrap();
                state.imu.quaternion = Default::default();
                state.seal();
                self.to_controller.send_to(state.bytes(), controller).unwrap();
            } else {
                self.to_controller.send_to(&buffer[..length], controller).unwrap();
            }
        }
    }
}

struct Bench {
    config: Config,
    settings: ControlSettings,
    cycle: Cycle,
    go1: Go1,
    emulator: Emulator,
    tap: Tap,
    inputs: Inputs,
    period_ns: u64,
    events: Vec<Event>,
    mode_changes: u64,
    /// Number of the last tick before the injection.
    injected_at: u64,
}

impl Bench {
    fn new() -> Bench {
        // Short enough that the clock, not a missing state, reveals the restart.
        Bench::restarting_in(Some(5))
    }

    /// A robot whose restart takes `reboot_ms`, or the configured time if none is given.
    fn restarting_in(reboot_ms: Option<u32>) -> Bench {
        let mut config = Config::load(None).unwrap();
        let emulated = &mut config.simulator.emulator;
        emulated.reboot_ms = reboot_ms.unwrap_or(emulated.reboot_ms);
        let settings = config.settings(&description(), Task::Forward, Backend::Hardware).unwrap();
        let emulator = emulator(&config.simulator, 0);
        let tap = Tap::new(emulator.local_address().unwrap());
        let go1 = Go1::open(&network(tap.to_controller.local_addr().unwrap()), false).unwrap();
        Bench {
            config,
            settings,
            cycle: Cycle::new(&settings),
            go1,
            emulator,
            tap,
            inputs: Inputs::default(),
            period_ns: 1_000_000,
            events: Vec::new(),
            mode_changes: 0,
            injected_at: 0,
        }
    }

    /// Simulates one millisecond of controller and robot.
    fn tick(&mut self, command: Option<Command>) -> Tick {
        self.inputs.time_ns += self.period_ns;
        let inputs = Inputs { command, ..self.inputs };
        let tick = *self.cycle.tick(&inputs, &SimulatedClock, &mut self.go1);
        for event in self.cycle.events().iter() {
            self.mode_changes += u64::from(matches!(event, Event::Mode { .. }));
            self.events.push(event);
        }
        self.tap.carry_commands();
        self.emulator.step();
        self.tap.carry_states();
        tick
    }

    fn until(&mut self, mode: Mode) {
        for _ in 0..20_000 {
            if self.cycle.mode() == mode {
                return;
            }
            self.tick(None);
        }
        panic!("never {mode:?}; last {:?}: {:?}", self.cycle.mode(), self.events.last());
    }

    fn arm(&self) -> Command {
        Command::Arm(Permit { mode_changes: self.mode_changes, given_ns: self.inputs.time_ns })
    }

    fn approval(&self) -> Command {
        let jump = JumpParameters { f0_hz: 1.3, f1_hz: 0.0, fx_n: 60.0, fy_n: 0.0, fz_n: 270.0 };
        let spec = TrialSpec { trial: 3, ..self.config.task(Task::Forward).trial(Task::Forward, jump) };
        Command::RunTrial(spec, Permit { mode_changes: self.mode_changes, given_ns: self.inputs.time_ns })
    }

    /// A robot in `mode`, reached by an operator's commands.
    fn in_mode(mode: Mode) -> Bench {
        Bench::new().brought_to(mode)
    }

    fn brought_to(self, mode: Mode) -> Bench {
        let mut bench = self;
        bench.until(Mode::Observe);
        bench.tick(Some(Command::TakeControl));
        // The arming checks need a second without motion and with ticks on time.
        for _ in 0..1500 {
            bench.tick(None);
        }
        assert_eq!(bench.cycle.mode(), Mode::Disarmed);
        if mode == Mode::Disarmed {
            return bench;
        }
        bench.tick(Some(bench.arm()));
        assert_eq!(bench.cycle.mode(), Mode::StandUp, "{:?}", bench.cycle.readiness());
        if mode == Mode::StandUp {
            for _ in 0..500 {
                bench.tick(None);
            }
            return bench;
        }
        bench.until(Mode::Ready);
        if mode == Mode::SitDown {
            bench.tick(Some(Command::SitDown));
            assert_eq!(bench.cycle.mode(), mode);
        } else if mode != Mode::Ready {
            let approval = bench.approval();
            bench.tick(Some(approval));
            bench.until(mode);
        }
        bench
    }

    fn airborne() -> Bench {
        let mut bench = Bench::in_mode(Mode::Jump);
        for _ in 0..2000 {
            let flying = bench.emulator.status().truth.is_some_and(|truth| truth.foot_contact == [false; LEGS]);
            if flying && bench.tick(None).estimate.contact == [false; LEGS] {
                return bench;
            }
            bench.tick(None);
        }
        panic!("it never flew");
    }

    fn link(&self) -> LinkStatus {
        self.go1.link().unwrap()
    }

    /// Whether the last datagram on the wire damps every joint with the configured gain.
    fn wire_damps(&self) -> bool {
        let kd = self.settings.gate.damping_kd as f32;
        self.tap.command.is_some_and(|command| {
            (0..JOINTS).all(|joint| {
                let motor = command.motor(joint);
                (motor.mode, motor.kp, motor.kd) == (MODE_SERVO, 0.0, kd)
                    && (motor.torque, motor.velocity, motor.position) == (0.0, 0.0, POSITION_STOP)
            })
        })
    }
}

/// An injected fault.
#[derive(Clone, Copy)]
enum Injection {
    /// A fault of the robot or its network, as the emulator parses it.
    Robot(&'static str),
    /// A fault of the control thread.
    Thread(fn(&mut Bench)),
}

use Injection::{Robot as ToRobot, Thread};

/// A row of the table whose action is damping.
struct Row {
    name: &'static str,
    modes: &'static [Mode],
    injection: Injection,
    /// Whether the last tick is the first that could detect the fault.
    bad: fn(&Bench, &Tick) -> bool,
    /// Part of the reported fault.
    told: fn(&TransitionCause) -> bool,
}

const ENERGISED: &[Mode] =
    &[Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump, Mode::Settle, Mode::Review, Mode::SitDown];
/// Not SETTLE, in which the trunk swings after a landing, nor SITDOWN, in which a robot may lean.
const STANDING: &[Mode] = &[Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Review];
const SENT_TO: &[Mode] = &[
    Mode::Disarmed,
    Mode::StandUp,
    Mode::Ready,
    Mode::Countdown,
    Mode::Jump,
    Mode::Settle,
    Mode::Review,
    Mode::SitDown,
];

const CUT: [Row; 16] = [
    Row {
        name: "STOP key",
        modes: SENT_TO,
        injection: Thread(|bench| bench.inputs.stop = true),
        bad: |_, _| true,
        told: |cause| matches!(cause, TransitionCause::Stop),
    },
    Row {
        name: "joint angle beyond its limit",
        modes: ENERGISED,
        injection: ToRobot("angle FL_hip 1.3"),
        bad: |_, tick| tick.state.joint_position[3] > 1.2,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::JointPosition { joint: 3, .. })),
    },
    Row {
        name: "joint velocity beyond its limit",
        modes: ENERGISED,
        injection: ToRobot("speed RR_thigh 90"),
        bad: |_, tick| tick.state.joint_velocity[7] > 80.0,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::JointVelocity { joint: 7, .. })),
    },
    Row {
        name: "joint torque beyond its limit",
        modes: ENERGISED,
        injection: ToRobot("torque RR_calf 50"),
        bad: |_, tick| tick.state.joint_torque[8] > 45.0,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::JointTorque { joint: 8, .. })),
    },
    Row {
        name: "a motor leaves servo mode",
        modes: ENERGISED,
        injection: ToRobot("servo-off RL_thigh"),
        bad: |_, tick| !tick.state.motor_enabled[10],
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::MotorMode { joint: 10 })),
    },
    Row {
        name: "motor at 80 C",
        modes: SENT_TO,
        injection: ToRobot("hot FR_calf 80"),
        bad: |_, tick| tick.state.motor_temperature_c[2] >= 80.0,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::MotorTemperature { joint: 2, .. })),
    },
    Row {
        name: "a joint's angle is no number",
        modes: SENT_TO,
        injection: ToRobot("nan FL_calf"),
        bad: |_, tick| tick.state.joint_position[5].is_nan(),
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::NotFinite { .. })),
    },
    Row {
        name: "the orientation is no rotation",
        modes: SENT_TO,
        injection: Thread(|bench| bench.tap.no_rotation = true),
        bad: |_, tick| tick.state.imu.orientation_world.w.is_nan(),
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::NotFinite { .. })),
    },
    Row {
        name: "a burst of corrupt datagrams",
        modes: SENT_TO,
        injection: ToRobot("corrupt 100"),
        bad: |bench, _| bench.link().recent_corrupt > bench.settings.watchdog.corrupt,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::Corrupt { .. })),
    },
    Row {
        name: "the robot restarts",
        modes: SENT_TO,
        injection: ToRobot("reboot"),
        bad: |bench, _| bench.link().reboots > 0,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::Reboot)),
    },
    Row {
        name: "tilt of 0.4 rad while standing",
        modes: STANDING,
        injection: ToRobot("tilt 0.4"),
        bad: |_, tick| tick.estimate.roll_pitch_yaw.x > 0.35,
        // In REVIEW it is a fall.
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::Tilt { .. }) | TransitionCause::Fell(_)),
    },
    Row {
        name: "tilt of 1.1 rad anywhere",
        modes: ENERGISED,
        injection: ToRobot("tilt 1.1"),
        bad: |_, tick| tick.estimate.roll_pitch_yaw.x > 1.0,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::Tilt { .. }) | TransitionCause::Fell(_)),
    },
    Row {
        name: "no state for 20 ms: the robot stands still",
        modes: SENT_TO,
        injection: ToRobot("freeze"),
        bad: |bench, _| bench.cycle.state_age_ms() > bench.settings.watchdog.state_age_ms,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::StateAge { age_ms: 21, allowed_ms: 20 })),
    },
    Row {
        name: "no new state for 20 ms: the same one again",
        modes: SENT_TO,
        injection: ToRobot("repeat"),
        bad: |bench, _| bench.cycle.state_age_ms() > bench.settings.watchdog.state_age_ms,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::StateAge { age_ms: 21, allowed_ms: 20 })),
    },
    Row {
        name: "a tick more than 10 ms late",
        modes: SENT_TO,
        injection: Thread(|bench| bench.inputs.lateness_ns = 10_500_000),
        bad: |_, _| true,
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::Late { .. })),
    },
    Row {
        name: "five periods of more than 2 ms",
        modes: SENT_TO,
        injection: Thread(|bench| bench.period_ns = 2_500_000),
        bad: |bench, tick| tick.number >= bench.injected_at + u64::from(bench.settings.watchdog.period_ticks),
        told: |cause| matches!(cause, TransitionCause::Fault(Fault::Slow { .. })),
    },
];

/// Control ticks between the first bad one and the first damping on the wire; 0 if it is the same tick.
fn reaction(bench: &mut Bench, row: &Row) -> u32 {
    bench.injected_at = bench.cycle.last().number;
    match row.injection {
        ToRobot(line) => bench.emulator.apply(line.parse().unwrap()),
        Thread(inject) => inject(bench),
    }
    bench.events.clear();
    let mut since_bad = None;
    for _ in 0..300 {
        let tick = bench.tick(None);
        let bad = (row.bad)(bench, &tick);
        since_bad = since_bad.map(|ticks| ticks + 1).or(bad.then_some(0));
        let stopped = bench.events.iter().find_map(|event| match event {
            Event::Mode { to: Mode::Damped | Mode::Fault, cause, .. } => Some(*cause),
            _ => None,
        });
        if let (Some(cause), true) = (stopped, bench.wire_damps()) {
            assert!((row.told)(&cause), "{}: told {cause}", row.name);
            return since_bad.unwrap_or_else(|| panic!("{}: damped before anything was bad: {cause}", row.name));
        }
    }
    panic!("{}: never damped, {:?}", row.name, bench.cycle.mode());
}

#[test]
fn every_cut_is_on_the_wire_within_two_ticks() {
    let mut slowest = 0;
    for row in &CUT {
        for &mode in row.modes {
            let mut bench = Bench::in_mode(mode);
            let ticks = reaction(&mut bench, row);
            println!("{:<45} {:<10} {ticks} ticks after the first bad one", row.name, mode.name());
            assert!(ticks <= 2, "{} in {}: {ticks} ticks", row.name, mode.name());
            slowest = slowest.max(ticks);
            // Damping continues to be sent, whatever the robot reports.
            for _ in 0..300 {
                bench.tick(None);
                assert!(bench.wire_damps(), "{} in {}: no damping any more", row.name, mode.name());
            }
        }
    }
    println!("slowest: {slowest} ticks");
}

#[test]
fn a_tilt_in_flight_is_cut_before_it_lands() {
    let mut bench = Bench::airborne();
    let row = Row {
        name: "tilt of 0.9 rad in flight",
        modes: &[],
        injection: ToRobot("tilt 0.9"),
        bad: |_, tick| tick.estimate.roll_pitch_yaw.x > 0.8,
        told: |cause| matches!(cause, TransitionCause::Fell(_)),
    };
    let ticks = reaction(&mut bench, &row);
    println!("{:<45} in flight  {ticks} ticks after the first bad one", row.name);
    assert!(ticks <= 2);
}

/// A gap that does not end is reported as a lost link.
#[test]
fn a_silence_of_more_than_200_ms_is_a_lost_link() {
    let mut bench = Bench::in_mode(Mode::Ready);
    bench.emulator.apply("freeze".parse().unwrap());
    bench.events.clear();
    for _ in 0..250 {
        bench.tick(None);
    }
    let faults = bench.events.iter().filter_map(|event| match event {
        Event::Mode { cause: TransitionCause::Fault(fault), .. } => Some(*fault),
        _ => None,
    });
    let causes: Vec<Fault> = faults.collect();
    assert!(matches!(causes[..], [Fault::StateAge { .. }, Fault::LinkLost { .. }]), "{causes:?}");
    assert!(bench.wire_damps());
}

/// The robot is switched off and on while another fault is latched, and boots as slowly as a real one: lost link and
/// restart are reported too. (A defect once: only the first fault was reported.)
#[test]
fn a_power_cycle_behind_another_fault_is_told() {
    let mut bench = Bench::restarting_in(None).brought_to(Mode::Ready);
    assert!(bench.config.simulator.emulator.reboot_ms > bench.settings.watchdog.link_lost_ms);
    bench.emulator.apply("angle FL_hip 1.3".parse().unwrap());
    bench.until(Mode::Fault);
    bench.emulator.apply("clear".parse().unwrap());
    for _ in 0..100 {
        bench.tick(None);
    }
    bench.emulator.apply("reboot".parse().unwrap());
    for _ in 0..3000 {
        bench.tick(None);
    }
    let faults = bench.events.iter().filter_map(|event| match event {
        Event::Mode { to: Mode::Fault, cause: TransitionCause::Fault(fault), .. } => Some(*fault),
        _ => None,
    });
    let told: Vec<Fault> = faults.collect();
    assert!(matches!(told[..], [Fault::JointPosition { .. }, Fault::LinkLost { .. }, Fault::Reboot]), "{told:?}");
    assert_eq!(bench.link().reboots, 1);
    assert!(bench.wire_damps());
}

/// LAND: after a lost operator the robot sits down; in flight it lands first.
#[test]
fn an_operator_who_is_gone_lets_it_land_and_sit_down() {
    for mode in [Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump] {
        let mut bench = Bench::in_mode(mode);
        bench.inputs.operator_silent_ms = 1001;
        bench.tick(None);
        let expected = if mode == Mode::Jump { Mode::Jump } else { Mode::SitDown };
        assert_eq!(bench.cycle.mode(), expected);
        bench.until(Mode::Disarmed);
        assert!(bench.wire_damps());
        let stopped =
            bench.events.iter().any(|event| matches!(event, Event::Mode { to: Mode::Fault | Mode::Damped, .. }));
        assert!(!stopped, "{:?}", bench.events);
    }
}

/// HOLD: the running trial is finished, the next one refused.
#[test]
fn a_low_battery_and_a_warm_motor_let_the_trial_finish_and_refuse_the_next() {
    for fault in ["battery 12", "hot RL_hip 72"] {
        let mut bench = Bench::in_mode(Mode::Jump);
        bench.emulator.apply(fault.parse().unwrap());
        bench.until(Mode::Review);
        assert!(bench.events.iter().any(|event| matches!(event, Event::TrialEnded { end: TrialEnd::Settled, .. })));
        bench.tick(Some(Command::EndReview));
        bench.until(Mode::Ready);
        bench.events.clear();
        let approval = bench.approval();
        bench.tick(Some(approval));
        assert_eq!(bench.cycle.mode(), Mode::Ready, "{fault}");
        let refused = bench
            .events
            .iter()
            .any(|event| matches!(event, Event::Refused { because: CommandRefusal::Inhibited(_), .. }));
        assert!(refused, "{fault}: {:?}", bench.events);
    }
}

/// A robot that has never answered gets hello commands only.
#[test]
fn a_robot_that_was_never_heard_stays_offline() {
    let mut bench = Bench::new();
    bench.emulator.apply("freeze".parse().unwrap());
    for command in [Some(Command::TakeControl), Some(bench.arm()), None] {
        bench.tick(command);
    }
    for _ in 0..1000 {
        bench.tick(None);
        assert!(bench.tap.command.is_none_or(|call| (0..JOINTS).all(|joint| call.motor(joint).mode == 0)));
    }
    assert_eq!(bench.cycle.mode(), Mode::Offline);
}

/// After a stop the robot is placed, armed again, and jumps.
#[test]
fn after_a_restart_the_robot_is_put_back_and_jumps_again() {
    let mut bench = Bench::in_mode(Mode::Ready);
    bench.emulator.apply("reboot".parse().unwrap());
    bench.until(Mode::Fault);
    bench.emulator.apply("place".parse().unwrap());
    for _ in 0..6000 {
        bench.tick(None);
    }
    bench.tick(Some(Command::Acknowledge { stops: 0 }));
    assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    for _ in 0..1500 {
        bench.tick(None);
    }
    bench.tick(Some(bench.arm()));
    bench.until(Mode::Ready);
    let approval = bench.approval();
    bench.tick(Some(approval));
    bench.until(Mode::Review);
}

/// The estimated position restarts after a person has carried the robot. (A bug once: it did so for simulated robots
/// alone, which the program places.)
#[test]
fn a_robot_that_is_armed_begins_at_the_origin() {
    let mut bench = Bench::in_mode(Mode::Review);
    let jumped = bench.tick(None).estimate.position_world;
    assert!(jumped.xy().norm() > 0.1, "{jumped}");
    bench.tick(Some(Command::SitDown));
    bench.until(Mode::Disarmed);
    bench.emulator.apply("place".parse().unwrap());
    for _ in 0..1500 {
        bench.tick(None);
    }
    let arm = bench.arm();
    let armed = bench.tick(Some(arm));
    assert_eq!(armed.mode, Mode::StandUp, "{:?}", bench.cycle.readiness());
    bench.until(Mode::Ready);
    let place = bench.tick(None).estimate.position_world;
    let truth = bench.emulator.status().truth.unwrap().position_world;
    assert!((place - truth).norm() < 0.03, "thought at {place}, is at {truth}");
}
