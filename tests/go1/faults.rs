//! Every row of the table of watchdogs (`docs/safety.md`) against an emulated Go1: what is injected into the robot or
//! its network, and how soon damping is on the wire. A proxy between both ends reads the datagrams. Stepped by hand, so
//! the reaction is a number of control ticks that does not depend on the machine's speed.

use crate::bench;
use crate::cores::on_all_cores;
use crate::go1;
use std::net::{SocketAddr, UdpSocket};

use bench::{Bench, shipped};
use go1::{ANY_PORT, emulator, network};
use quadfrog::control::arming::sentence;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::go1::packet::{CrcForm, LowCmd, LowState, MODE_SERVO, POSITION_STOP};
use quadfrog::robot::{JOINTS, JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::emulator::Emulator;
use quadfrog::telemetry::{ArmingCheck, Command, CommandRefusal, Event, Fault, Mode, Tick, TrialEnd};
use quadfrog::trial::Backend;

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
                state.write_crc();
                self.to_controller.send_to(state.bytes(), controller).unwrap();
            } else {
                self.to_controller.send_to(&buffer[..length], controller).unwrap();
            }
        }
    }
}

/// A link, the proxy and an emulated robot; every tick is followed by one millisecond of the robot.
struct TappedRobot {
    go1: Go1,
    emulator: Emulator,
    tap: Tap,
    /// Number of the last tick before the injection.
    injected_at: u64,
}

impl TappedRobot {
    fn step(&mut self) {
        self.tap.carry_commands();
        self.emulator.step();
        self.tap.carry_states();
    }
}

impl Robot for TappedRobot {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.go1.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.go1.write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        self.go1.place(placement)
    }
    fn link(&self) -> Option<LinkStatus> {
        self.go1.link()
    }
}

type TappedBench = Bench<TappedRobot>;

/// A robot whose restart takes `reboot_ms`, or the configured time if none is given.
fn restarting_in(reboot_ms: Option<u32>) -> TappedBench {
    let (mut config, _, settings) = shipped(Backend::Hardware);
    let emulated = &mut config.simulator.emulator;
    emulated.reboot_ms = reboot_ms.unwrap_or(emulated.reboot_ms);
    let emulator = emulator(&config.simulator, 0);
    let tap = Tap::new(emulator.local_address().unwrap());
    let go1 = Go1::open(&network(tap.to_controller.local_addr().unwrap()), false).unwrap();
    let robot = TappedRobot { go1, emulator, tap, injected_at: 0 };
    Bench { after_tick: TappedRobot::step, ..Bench::new(config, settings, robot) }
}

/// A robot whose restart is so short that the clock, not a missing state, reveals it.
fn tapped() -> TappedBench {
    restarting_in(Some(5))
}

fn in_mode(mode: Mode) -> TappedBench {
    let mut bench = tapped().reach(mode);
    if mode == Mode::StandUp {
        bench.ticks(500);
    }
    bench
}

impl TappedBench {
    fn link_status(&self) -> LinkStatus {
        self.robot.link().unwrap()
    }

    /// Injects a fault of the robot or its network, as the emulator parses it, or one of the control thread or the proxy.
    fn inject(&mut self, fault: &str) {
        self.robot.injected_at = self.cycle.last().number;
        self.events.clear();
        match fault {
            "STOP key" => self.inputs.stop = true,
            "tick 10.5 ms late" => self.inputs.lateness_ns = 10_500_000,
            "periods of 2.5 ms" => self.period_ns = 2_500_000,
            "no rotation" => self.robot.tap.no_rotation = true,
            line => self.robot.emulator.apply(line.parse().unwrap()),
        }
    }

    /// Whether the last datagram on the wire damps every joint with the configured gain.
    fn wire_damps(&self) -> bool {
        let kd = self.settings.gate.damping_kd as f32;
        self.robot.tap.command.is_some_and(|command| {
            (0..JOINTS).all(|joint| {
                let motor = command.motor(joint);
                (motor.mode, motor.kp, motor.kd) == (MODE_SERVO, 0.0, kd)
                    && (motor.torque, motor.velocity, motor.position) == (0.0, 0.0, POSITION_STOP)
            })
        })
    }
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

/// Modes in which a fault that leaves the state known damps at once; in the landing the controller finishes it first
/// (`tests/control/landing.rs`).
const NOT_LANDING: &[Mode] =
    &[Mode::Disarmed, Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump, Mode::Review, Mode::SitDown];

/// A row of the table whose action is damping: injected fault, modes, whether the last tick is the first that could detect
/// the fault, and parts of the reported cause, of which one is enough.
type Row = (&'static str, &'static [Mode], fn(&TappedBench, &Tick) -> bool, &'static [&'static str]);

/// In REVIEW a tilt is a fall; in a trial the gyroscope contradicts it.
const TILTED: &[&str] = &["tilt ", "fell: roll", "orientation against gyroscope"];
const OLD: &[&str] = &["no state from the robot for 21 ms, limit 20 ms"];

const DAMP: [Row; 16] = [
    ("STOP key", SENT_TO, |_, _| true, &["STOP"]),
    ("angle FL_hip 1.3", ENERGISED, |_, t| t.state.joint_position_rad[3] > 1.2, &["FL_hip at 1.300 rad"]),
    ("speed RR_thigh 90", ENERGISED, |_, t| t.state.joint_velocity_rad_s[7] > 80.0, &["RR_thigh at 90.0 rad/s"]),
    ("torque RR_calf 50", ENERGISED, |_, t| t.state.joint_torque_n_m[8] > 45.0, &["RR_calf at 50.0 N m"]),
    ("servo-off RL_thigh", ENERGISED, |_, t| !t.state.motor_enabled[10], &["motor RL_thigh left servo mode"]),
    ("hot FR_calf 80", NOT_LANDING, |_, t| t.state.motor_temperature_c[2] >= 80.0, &["motor FR_calf at 80 degrees"]),
    ("nan FL_calf", SENT_TO, |_, t| t.state.joint_position_rad[5].is_nan(), &["a joint angle is not a finite"]),
    ("no rotation", SENT_TO, |_, t| t.state.imu.world_from_body.w.is_nan(), &["the orientation is not a finite"]),
    ("corrupt 100", NOT_LANDING, corrupted, &["states with a wrong checksum"]),
    ("reboot", SENT_TO, |bench, _| bench.link_status().reboots > 0, &["the robot restarted"]),
    ("tilt 0.4", STANDING, |_, t| t.estimate.roll_pitch_yaw.x > 0.35, TILTED),
    ("tilt 1.1", ENERGISED, |_, t| t.estimate.roll_pitch_yaw.x > 1.0, TILTED),
    ("freeze", SENT_TO, |bench, _| bench.cycle.state_age_ms() > 20, OLD),
    ("repeat", SENT_TO, |bench, _| bench.cycle.state_age_ms() > 20, OLD),
    ("tick 10.5 ms late", NOT_LANDING, |_, _| true, &["control thread late: 10.5 ms"]),
    ("periods of 2.5 ms", NOT_LANDING, slow, &["5 control periods in a row too long"]),
];

fn corrupted(bench: &TappedBench, _: &Tick) -> bool {
    bench.link_status().recent_corrupt > bench.settings.failsafe.corrupt
}

fn slow(bench: &TappedBench, tick: &Tick) -> bool {
    tick.number >= bench.robot.injected_at + u64::from(bench.settings.failsafe.period_ticks)
}

/// Control ticks between the first bad one and the first damping on the wire; 0 if it is the same tick.
fn reaction(bench: &mut TappedBench, (fault, _, bad, words): &Row) -> u32 {
    bench.inject(fault);
    let mut since_bad = None;
    for _ in 0..300 {
        let tick = bench.tick(None);
        let bad = bad(bench, &tick);
        since_bad = since_bad.map(|ticks| ticks + 1).or(bad.then_some(0));
        let stopped = bench.events.iter().find_map(|event| match event {
            Event::Mode { to: Mode::Damped | Mode::Fault, cause, .. } => Some(cause.to_string()),
            _ => None,
        });
        if let (Some(cause), true) = (stopped, bench.wire_damps()) {
            assert!(words.iter().any(|words| cause.contains(words)), "{fault}: reported {cause}");
            return since_bad.unwrap_or_else(|| panic!("{fault}: damped before anything was bad: {cause}"));
        }
    }
    panic!("{fault}: never damped, {:?}", bench.cycle.mode());
}

#[test]
fn every_cut_is_on_the_wire_within_two_ticks() {
    let cases: Vec<_> = DAMP.iter().flat_map(|row| row.1.iter().map(move |mode| (row, *mode))).collect();
    let ticks = on_all_cores(&cases, |(row, mode)| {
        let (fault, mut bench) = (row.0, in_mode(*mode));
        let ticks = reaction(&mut bench, row);
        println!("{fault:<20} {:<10} {ticks} ticks after the first bad one", mode.name());
        assert!(ticks <= 2, "{fault} in {}: {ticks} ticks", mode.name());
        // Damping continues to be sent, whatever the robot reports.
        for _ in 0..300 {
            bench.tick(None);
            assert!(bench.wire_damps(), "{fault} in {}: no damping any more", mode.name());
        }
        ticks
    });
    println!("slowest of {}: {} ticks", ticks.len(), ticks.iter().max().unwrap());
}

#[test]
fn a_tilt_in_flight_is_cut_before_it_lands() {
    let row: Row =
        ("tilt 0.9", &[], |_, tick| tick.estimate.roll_pitch_yaw.x > 0.8, &["fell: ", "orientation against gyroscope"]);
    assert!(reaction(&mut tapped().airborne(), &row) <= 2);
}

/// A gap that does not end is reported as a lost link.
#[test]
fn a_silence_of_more_than_200_ms_is_a_lost_link() {
    let mut bench = in_mode(Mode::Ready);
    bench.inject("freeze");
    bench.ticks(250);
    let causes = bench.faults();
    assert!(matches!(causes[..], [Fault::StateAge { .. }, Fault::LinkLost { .. }]), "{causes:?}");
    assert!(bench.wire_damps());
}

/// The robot is switched off and on while another fault is latched, and boots as slowly as a real one: lost link and
/// restart are reported too. Regression: only the first fault was reported.
#[test]
fn a_power_cycle_behind_another_fault_is_reported() {
    let mut bench = restarting_in(None).reach(Mode::Ready);
    assert!(bench.config.simulator.emulator.reboot_ms > bench.settings.failsafe.link_lost_ms);
    bench.inject("angle FL_hip 1.3");
    bench.until(Mode::Fault);
    bench.robot.emulator.apply("clear".parse().unwrap());
    bench.ticks(100);
    bench.robot.emulator.apply("reboot".parse().unwrap());
    bench.ticks(3000);
    let faults = bench.faults();
    assert!(matches!(faults[..], [Fault::JointPosition { .. }, Fault::LinkLost { .. }, Fault::Reboot]), "{faults:?}");
    assert_eq!(bench.link_status().reboots, 1);
    assert!(bench.wire_damps());
}

/// LAND: after a lost operator the robot sits down; in flight it lands first.
#[test]
fn an_operator_who_is_gone_lets_it_land_and_sit_down() {
    for mode in [Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump] {
        let mut bench = in_mode(mode);
        bench.inputs.operator_silent_ms = 1001;
        bench.tick(None);
        let expected = if mode == Mode::Jump { Mode::Jump } else { Mode::SitDown };
        assert_eq!(bench.cycle.mode(), expected);
        bench.until(Mode::Disarmed);
        assert!(bench.wire_damps());
        let stops = |event: &Event| matches!(event, Event::Mode { to: Mode::Fault | Mode::Damped, .. });
        assert!(!bench.events.iter().any(stops), "{:?}", bench.events);
    }
}

/// HOLD: the running trial is finished, the next one refused.
#[test]
fn a_low_battery_and_a_warm_motor_let_the_trial_finish_and_refuse_the_next() {
    for fault in ["battery 12", "hot RL_hip 72"] {
        let mut bench = in_mode(Mode::Jump);
        bench.inject(fault);
        bench.until(Mode::Review);
        assert_eq!(bench.ends(), [TrialEnd::Settled]);
        bench.command(Command::EndReview);
        bench.until(Mode::Ready);
        bench.command(bench.approved());
        assert_eq!(bench.cycle.mode(), Mode::Ready, "{fault}");
        assert!(matches!(bench.refusal(), Some(CommandRefusal::Inhibited(_))), "{fault}: {:?}", bench.events);
    }
}

/// Regression: the emulator took no charge above 100 %, the usual byte for "not available".
#[test]
fn a_battery_that_reports_no_charge_refuses_arming() {
    let mut bench = in_mode(Mode::Disarmed);
    bench.inject("battery 255");
    bench.ticks(1500);
    bench.command(bench.arm());
    let refused = bench.refusal();
    let Some(CommandRefusal::Checks(failing)) = refused else { panic!("{refused:?}") };
    assert_eq!(failing.iter().collect::<Vec<_>>(), [ArmingCheck::Battery]);
    let findings = bench.cycle.readiness().findings;
    let limits = shipped(Backend::Hardware).2.arming;
    let sentence = sentence(findings.get(ArmingCheck::Battery).unwrap(), &limits);
    assert_eq!((sentence.found.as_str(), sentence.needed.as_str()), ("not known yet", "at least 30 %"));
}

/// A robot that has never answered gets hello commands only.
#[test]
fn a_robot_that_was_never_heard_stays_offline() {
    let mut bench = tapped();
    bench.robot.emulator.apply("freeze".parse().unwrap());
    for command in [Some(Command::TakeControl), Some(bench.arm()), None] {
        bench.tick(command);
    }
    for _ in 0..1000 {
        bench.tick(None);
        assert!(bench.robot.tap.command.is_none_or(|call| (0..JOINTS).all(|joint| call.motor(joint).mode == 0)));
    }
    assert_eq!(bench.cycle.mode(), Mode::Offline);
}

/// After a stop the robot is placed, armed again, and jumps.
#[test]
fn after_a_restart_the_robot_is_put_back_and_jumps_again() {
    let mut bench = in_mode(Mode::Ready);
    bench.robot.emulator.apply("reboot".parse().unwrap());
    bench.until(Mode::Fault);
    bench.robot.emulator.apply("place".parse().unwrap());
    bench.ticks(6000);
    bench.command(Command::Acknowledge { stops: 0 });
    assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    bench.ticks(1500);
    bench.command(bench.arm());
    bench.until(Mode::Ready);
    bench.settle();
    bench.command(bench.approved());
    bench.until(Mode::Review);
}

/// The estimated position restarts after a person has carried the robot. Regression: it did so for simulated robots
/// alone, which the program places.
#[test]
fn a_robot_that_is_armed_begins_at_the_origin() {
    let mut bench = in_mode(Mode::Review);
    let jumped = bench.tick(None).estimate.position_world;
    assert!(jumped.xy().norm() > 0.1, "{jumped}");
    bench.command(Command::SitDown);
    bench.until(Mode::Disarmed);
    bench.robot.emulator.apply("place".parse().unwrap());
    bench.ticks(1500);
    let armed = bench.command(bench.arm());
    assert_eq!(armed.mode, Mode::StandUp, "{:?}", bench.cycle.readiness());
    bench.until(Mode::Ready);
    let place = bench.tick(None).estimate.position_world;
    let truth = bench.robot.emulator.status().truth.unwrap().position_world;
    assert!((place - truth).norm() < 0.03, "thought at {place}, is at {truth}");
}
