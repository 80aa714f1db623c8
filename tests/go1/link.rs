//! The link to a Go1: every datagram is checked, every loss counted, over a loopback socket with the emulated robot or
//! a socket of the test. Stepped by hand, so that nothing depends on the machine's speed.

use crate::go1;
use std::net::UdpSocket;

use go1::{ANY_PORT, description, network, pair};
use quadfrog::robot::go1::packet::{CrcForm, HIGH_LEVEL, LowCmd, LowState, MODE_BRAKE, MODE_SERVO};
use quadfrog::robot::go1::{Go1, Go1Network};
use quadfrog::robot::{JOINTS, JointCommand, LinkStatus, Robot, RobotError};
use quadfrog::sim::SimConfig;
use quadfrog::sim::emulator::{Emulator, EmulatorFault};

fn status(go1: &Go1) -> LinkStatus {
    go1.link().unwrap()
}

/// Damps for `ms` milliseconds.
fn run(emulator: &mut Emulator, go1: &mut Go1, ms: u32) {
    for _ in 0..ms {
        let _ = go1.read();
        go1.write(&JointCommand::damping(3.0)).unwrap();
        emulator.step();
    }
}

/// Runs until the first state, then with `fault`, then a while without; returns all states and the counts.
fn with(fault: &str, ms: u32) -> (u64, LinkStatus) {
    let (mut emulator, mut go1) = pair(&SimConfig::default(), 3);
    run(&mut emulator, &mut go1, 10);
    emulator.apply(fault.parse().unwrap());
    run(&mut emulator, &mut go1, ms);
    emulator.apply(EmulatorFault::Clear);
    run(&mut emulator, &mut go1, 2000);
    let _ = go1.read();
    (emulator.status().states, status(&go1))
}

#[test]
fn a_good_network_loses_nothing() {
    let (states, link) = with("clear", 4000);
    assert_eq!(link.received, states);
    assert_eq!(
        (link.lost, link.out_of_order, link.duplicate, link.corrupt, link.foreign, link.reboots),
        (0, 0, 0, 0, 0, 0)
    );
    assert_eq!((link.state_age_ms, link.rate_hz, link.loss_share()), (0, 1000, 0.0));
}

/// Received and lost states together are exactly the sent ones.
#[test]
fn every_lost_state_is_counted() {
    let (states, link) = with("loss 5", 20_000);
    println!("{states} sent, {link:?}");
    assert_eq!(link.received + link.lost, states);
    assert!((800..1200).contains(&link.lost), "{} of 20000 at 5 %", link.lost);
}

#[test]
fn every_corrupt_datagram_is_counted_and_none_is_used() {
    let (states, link) = with("corrupt 2", 20_000);
    assert_eq!(link.received + link.lost, states);
    // A flipped bit in the head makes a datagram foreign; one in bytes that the checksum does not cover is not
    // detected.
    assert!((300..500).contains(&link.corrupt), "{} of 20000 at 2 %", link.corrupt);
    assert!(link.lost <= link.corrupt + link.foreign + 20, "{link:?}");
}

#[test]
fn a_duplicate_is_counted_and_not_new() {
    let (states, link) = with("duplicate 10", 20_000);
    assert_eq!((link.received, link.lost), (states, 0));
    assert!((1800..2200).contains(&link.duplicate), "{}", link.duplicate);
}

/// An overtaken state is late, not lost; and the newest state never goes back in time.
#[test]
fn an_overtaken_state_is_late_and_not_lost() {
    let (mut emulator, mut go1) = pair(&SimConfig::default(), 3);
    run(&mut emulator, &mut go1, 10);
    emulator.apply(EmulatorFault::Jitter(5.0));
    let mut newest = 0;
    for _ in 0..10_000 {
        if let Ok(state) = go1.read() {
            assert!(state.robot_time_ms > newest, "{} after {newest}", state.robot_time_ms);
            newest = state.robot_time_ms;
        }
        go1.write(&JointCommand::damping(3.0)).unwrap();
        emulator.step();
    }
    emulator.apply(EmulatorFault::Clear);
    run(&mut emulator, &mut go1, 20);
    let _ = go1.read();
    let link = status(&go1);
    assert!(link.out_of_order > 1000, "{link:?}");
    assert_eq!((link.received + link.out_of_order, link.lost), (emulator.status().states, 0), "{link:?}");
}

/// With a delay the rate of the states is unchanged.
#[test]
fn a_delayed_link_keeps_its_rate() {
    let (_, link) = with("delay 8", 4000);
    assert_eq!((link.lost, link.reboots), (0, 0));
    assert_eq!(link.rate_hz, 1000);
}

/// A stopped process or a machine that slept: the clock of a real robot would have gone on, and a console that compares it with its
/// own refused to arm for good.
#[test]
fn an_emulator_that_was_stopped_keeps_its_clock() {
    let (mut emulator, mut go1) = pair(&SimConfig::default(), 3);
    let mut time_ns = 7_000_000_000;
    let mut live = |go1: &mut Go1, pause_ms: u64| {
        time_ns += (pause_ms + 1) * 1_000_000;
        go1.write(&JointCommand::damping(3.0)).unwrap();
        emulator.step_at(time_ns);
        (go1.read().map_or(0, |state| state.robot_time_ms), emulator.status().timed_out)
    };
    let [.., (before_ms, _)] = std::array::from_fn::<_, 11, _>(|_| live(&mut go1, 0));
    let (after_ms, _) = live(&mut go1, 3000);
    assert_eq!(after_ms - before_ms, 3001);
    assert_eq!(live(&mut go1, 0), (after_ms + 1, false));
}

#[test]
fn a_restart_is_noticed_once() {
    let (mut emulator, mut go1) = pair(&SimConfig::default(), 3);
    run(&mut emulator, &mut go1, 1000);
    emulator.apply(EmulatorFault::Reboot);
    run(&mut emulator, &mut go1, 1000);
    assert!(matches!(go1.read(), Err(RobotError::NoNewState { age_ms: 999.. })));
    run(&mut emulator, &mut go1, 3000);
    let link = status(&go1);
    assert_eq!((link.reboots, link.lost), (1, 0), "{link:?}");
    assert!(link.rate_hz > 950, "{link:?}");
}

/// A repeated state is not a new state, whatever its rate.
#[test]
fn a_clock_that_stands_still_is_silence() {
    let (mut emulator, mut go1) = pair(&SimConfig::default(), 3);
    run(&mut emulator, &mut go1, 100);
    emulator.apply(EmulatorFault::Repeat);
    run(&mut emulator, &mut go1, 50);
    assert!(matches!(go1.read(), Err(RobotError::NoNewState { age_ms: 49..=51 })));
    assert!(status(&go1).duplicate >= 48);
}

/// A dead port answers every second datagram with an error of the system (`docs/go1-wire.md`, section 5): no send is
/// lost by it and nothing panics; hello commands are sent until the first command.
#[test]
fn nobody_at_the_robots_port_is_silence_until_somebody_is() {
    let port = UdpSocket::bind(ANY_PORT).unwrap();
    let address = port.local_addr().unwrap();
    drop(port);
    let mut go1 = Go1::open(&network(address), false).unwrap();
    for age in 1..=500 {
        assert_eq!(go1.read(), Err(RobotError::NoNewState { age_ms: age }));
    }
    assert_eq!(status(&go1).sent, 5, "called ten times a second");
    for _ in 0..100 {
        go1.write(&JointCommand::damping(3.0)).unwrap();
        let _ = go1.read();
    }
    assert_eq!((status(&go1).sent, status(&go1).send_errors), (105, 0));
    let mut emulator = Emulator::bind(address, &description(), &network(address), &SimConfig::default(), 0).unwrap();
    run(&mut emulator, &mut go1, 10);
    assert!(go1.read().is_ok());
}

#[test]
fn who_only_listens_never_sends() {
    let robot = UdpSocket::bind(ANY_PORT).unwrap();
    robot.set_nonblocking(true).unwrap();
    let mut go1 = Go1::open(&network(robot.local_addr().unwrap()), true).unwrap();
    for _ in 0..1000 {
        let _ = go1.read();
    }
    assert!(robot.recv(&mut [0; 2000]).is_err());
    assert_eq!(status(&go1).sent, 0);
}

/// A link whose robot is a socket of the test.
struct Robots {
    socket: UdpSocket,
    go1: Go1,
}

impl Robots {
    fn new() -> Robots {
        let socket = UdpSocket::bind(ANY_PORT).unwrap();
        let go1 = Go1::open(&network(socket.local_addr().unwrap()), false).unwrap();
        socket.connect(("127.0.0.1", go1.local_address().unwrap().port())).unwrap();
        Robots { socket, go1 }
    }

    fn send(&self, bytes: &[u8]) {
        assert_eq!(self.socket.send(bytes).unwrap(), bytes.len());
    }
}

fn state(tick: u32) -> LowState {
    let mut state = LowState::zero();
    state.robot_time_ms = tick.into();
    state.imu.quaternion[0] = 1.0.into();
    state.write_crc();
    state
}

/// The official endpoint checks the last datagram of a queue alone; here a valid one is kept whatever follows it.
#[test]
fn a_good_state_is_not_lost_to_bad_ones_behind_it() {
    let mut robot = Robots::new();
    robot.send(state(5).bytes());
    let mut corrupt = state(6).bytes().to_vec();
    corrupt[100] ^= 1;
    robot.send(&corrupt);
    robot.send(&state(7).bytes()[..700]);
    robot.send(&[]);
    robot.send(&[0; 807]);
    let mut high = state(8);
    high.header.level = HIGH_LEVEL;
    high.write_crc();
    robot.send(high.bytes());
    assert_eq!(robot.go1.read().unwrap().robot_time_ms, 5);
    let link = status(&robot.go1);
    assert_eq!((link.received, link.corrupt, link.wrong_length, link.foreign), (1, 1, 2, 2), "{link:?}");
}

/// 820 bytes, as real robots are reported to send.
#[test]
fn a_longer_state_is_judged_on_what_is_known_of_it() {
    let mut robot = Robots::new();
    let mut long = state(5).bytes().to_vec();
    long.extend([0xAB; 13]);
    robot.send(&long);
    assert_eq!(robot.go1.read().unwrap().robot_time_ms, 5);
}

#[test]
fn another_sender_is_not_heard() {
    let mut robot = Robots::new();
    let stranger = UdpSocket::bind(ANY_PORT).unwrap();
    stranger.send_to(state(5).bytes(), ("127.0.0.1", robot.go1.local_address().unwrap().port())).unwrap();
    assert!(robot.go1.read().is_err());
    robot.send(state(6).bytes());
    assert_eq!(robot.go1.read().unwrap().robot_time_ms, 6);
    assert_eq!(status(&robot.go1).received, 1);
}

/// The 32-bit clock wraps around after 49 days: that is the next state, not a restart and not 4 billion lost states.
#[test]
fn the_robots_clock_may_run_over() {
    let mut robot = Robots::new();
    for tick in [u32::MAX - 1, u32::MAX, 0, 1] {
        robot.send(state(tick).bytes());
        assert_eq!(robot.go1.read().unwrap().robot_time_ms, tick);
    }
    assert_eq!((status(&robot.go1).lost, status(&robot.go1).reboots), (0, 0));
}

/// A flood cannot delay the tick: the rest is read in the next milliseconds.
#[test]
fn a_flood_is_judged_a_part_at_a_time() {
    let mut robot = Robots::new();
    for tick in 1..=80 {
        robot.send(state(tick).bytes());
    }
    let first = robot.go1.read().unwrap().robot_time_ms;
    assert!(first < 80, "{first} in one call");
    let mut newest = first;
    for _ in 0..10 {
        newest = robot.go1.read().map_or(newest, |state| state.robot_time_ms);
    }
    assert_eq!(newest, 80);
}

/// A motor that brakes before the first command has not left servo mode; one that still brakes some time after it has.
#[test]
fn a_motor_leaves_servo_mode_only_after_it_was_in_it() {
    let mut robot = Robots::new();
    let mut tick = 0;
    let mut next = |robot: &mut Robots| {
        tick += 1;
        let mut state = state(tick);
        state.motor[4].mode = MODE_BRAKE;
        state.write_crc();
        robot.send(state.bytes());
        robot.go1.read().unwrap().motor_enabled
    };
    assert_eq!(next(&mut robot), [true; JOINTS]);
    robot.go1.write(&JointCommand::damping(3.0)).unwrap();
    for _ in 0..100 {
        assert_eq!(next(&mut robot), [true; JOINTS]);
    }
    assert!(!next(&mut robot)[4]);
}

/// In place of a command that does not fit a datagram, the last damping command is sent, in servo mode, and the caller
/// gets an error. Regression: all motors got mode 0x00, their own braking of unknown strength.
#[test]
fn a_command_that_is_no_number_becomes_the_last_damping_and_an_error() {
    let mut robot = Robots::new();
    robot.socket.set_nonblocking(true).unwrap();
    let mut buffer = [0; 2000];
    let mut unsayable = JointCommand::damping(8.0);
    unsayable.motor[7].torque_n_m = f64::NAN;
    assert!(matches!(robot.go1.write(&unsayable), Err(RobotError::Send { .. })));
    assert!(robot.socket.recv(&mut buffer).is_err(), "nothing was ever commanded, so nothing is sent");

    robot.go1.write(&JointCommand::damping(3.0)).unwrap();
    robot.go1.write(&JointCommand::torques(&[1.0; JOINTS])).unwrap();
    assert!(matches!(robot.go1.write(&unsayable), Err(RobotError::Send { .. })));
    for _ in 0..3 {
        assert!(robot.socket.recv(&mut buffer).is_ok());
    }
    let sent = LowCmd::parse(&buffer[..614], CrcForm::Plain).unwrap();
    for motor in (0..JOINTS).map(|joint| sent.motor(joint)) {
        assert_eq!((motor.mode, motor.kp, motor.kd, motor.torque), (MODE_SERVO, 0.0, 3.0, 0.0));
    }
}

/// After a restart the motors have the same time to report servo mode as after the first command.
#[test]
fn a_restart_gives_the_motors_their_time_to_servo_mode_again() {
    let mut robot = Robots::new();
    let grace_ms = network(ANY_PORT).servo_grace_ms;
    let mut tick = 10_000;
    let mut enabled = |robot: &mut Robots, restart: bool| {
        tick = if restart { 0 } else { tick + 1 };
        let mut state = state(tick);
        state.motor[4].mode = MODE_BRAKE;
        state.write_crc();
        robot.send(state.bytes());
        let enabled = robot.go1.read().unwrap().motor_enabled[4];
        robot.go1.write(&JointCommand::damping(3.0)).unwrap();
        enabled
    };
    let late = (0..grace_ms + 10).map(|_| enabled(&mut robot, false)).filter(|enabled| !enabled).count();
    assert!(late > 0, "a motor that does not follow is reported");
    assert!(enabled(&mut robot, true), "not in the very first state after a restart");
    assert!((0..grace_ms / 2).all(|_| enabled(&mut robot, false)));
    assert!((0..grace_ms).any(|_| !enabled(&mut robot, false)));
}

#[test]
fn a_taken_local_port_is_reported_with_the_remedy() {
    let taken = UdpSocket::bind("0.0.0.0:0").unwrap();
    let local_port = taken.local_addr().unwrap().port();
    let error = Go1::open(&Go1Network { local_port, ..network(ANY_PORT) }, false).unwrap_err().to_string();
    assert!(error.contains("network.local_port"), "{error}");
}
