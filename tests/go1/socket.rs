//! The socket of a link to a Go1: datagrams of the cache warm-up, commands that the system refuses to send, and the datagrams that a
//! silent robot receives.

use std::net::{Ipv4Addr, UdpSocket};

use crate::bench::{Bench, shipped};
use crate::go1::{ANY_PORT, network};
use quadfrog::robot::go1::Go1;
use quadfrog::robot::go1::link::{Link, LinkOptions};
use quadfrog::robot::go1::packet::{CrcForm, LowCmd, MODE_BRAKE, MODE_SERVO};
use quadfrog::robot::state_counter::StateClock;
use quadfrog::robot::{JOINTS, LinkStatus, Robot};
use quadfrog::telemetry::{Command, CommandRefusal, Mode};
use quadfrog::trial::Backend;

/// Consecutive refusals of the system that are no error.
const TOLERATED_REFUSALS: u32 = 5;
const CLOCK: StateClock = StateClock { state_period_ms: 1, restart_ms: 100 };

/// (`tests/control/warm_up.rs` checks that a warm-up changes nothing.)
#[test]
fn a_warm_up_sends_an_invalid_datagram_to_itself() {
    let address = (Ipv4Addr::LOCALHOST, 9).into();
    let mut link = Link::open(&LinkOptions { address, local_port: 0, clock: CLOCK }).unwrap();
    let command = LowCmd::braking(CrcForm::Plain);
    assert_eq!(link.warm_up(command), None, "there is no state yet");
    let received = &link.buffer()[..command.bytes().len()];
    assert_eq!(received[2..], command.bytes()[2..]);
    assert!(LowCmd::parse(received, CrcForm::Plain).is_err());
    assert_eq!(*link.status(), LinkStatus::default());
}

/// No socket can be made to refuse every send, so the system's answer is injected.
#[test]
fn refused_sends_become_an_error_after_five() {
    let address = (Ipv4Addr::LOCALHOST, 9).into();
    let options = LinkOptions { address, local_port: 0, clock: CLOCK };
    let mut link = Link::open(&options).unwrap();
    let full = nix::errno::Errno::EAGAIN as i32;
    let refused = || Err(std::io::Error::from_raw_os_error(full));
    for _ in 0..2 {
        for _ in 0..TOLERATED_REFUSALS {
            assert_eq!(link.count_sent(refused()), Ok(()), "a full queue is tolerated for five milliseconds");
        }
        assert_eq!(link.count_sent(refused()), Err(full));
        assert_eq!(link.count_sent(refused()), Err(full), "until one is sent");
        assert_eq!(link.count_sent(Ok(614)), Ok(()), "the first one that is sent ends the error");
    }
    assert_eq!((link.status().sent, link.status().send_errors), (2, 14), "each is counted");
}

/// A robot that hears and never answers, with a control cycle that listens to it.
struct SilentRobot {
    socket: UdpSocket,
    bench: Bench<Go1>,
}

impl SilentRobot {
    fn new() -> SilentRobot {
        let socket = UdpSocket::bind(ANY_PORT).unwrap();
        socket.set_nonblocking(true).unwrap();
        let go1 = Go1::open(&network(socket.local_addr().unwrap()), true).unwrap();
        let (config, _, settings) = shipped(Backend::Hardware);
        SilentRobot { socket, bench: Bench::new(config, settings, go1) }
    }

    /// Runs ticks; returns the motors' mode in each datagram that arrives.
    fn hears(&mut self, ticks: u32) -> Vec<u8> {
        let mut modes = Vec::new();
        for _ in 0..ticks {
            self.bench.tick(None);
            self.take_datagrams(&mut modes);
        }
        modes
    }

    fn take_datagrams(&self, modes: &mut Vec<u8>) {
        let mut buffer = [0; 2000];
        while let Ok(length) = self.socket.recv(&mut buffer) {
            let command = LowCmd::parse(&buffer[..length], CrcForm::Plain).unwrap();
            let mode = command.motor(0).mode;
            assert!((0..JOINTS).all(|joint| command.motor(joint).mode == mode));
            modes.push(mode);
        }
    }
}

/// Regression: after a STOP, and in FAULT, ten braking commands a second were sent among the damping.
#[test]
fn a_silent_robot_is_only_damped_after_a_stop_and_in_a_fault() {
    let mut robot = SilentRobot::new();
    robot.bench.command(Command::Contact);
    let called = robot.hears(299);
    assert!(!called.is_empty() && called.iter().all(|mode| *mode == MODE_BRAKE), "{called:?}");
    // STOP, and in the same tick the fault that no state arrives.
    assert_eq!(robot.bench.stop(None).mode, Mode::Fault);
    let damped = robot.hears(1000);
    assert!(damped.len() == 1001 && damped.iter().all(|mode| *mode == MODE_SERVO), "{damped:?}");
}

/// Regression: the request to call the robot was carried out while STOP was set.
#[test]
fn a_robot_is_not_called_while_stop_is_set() {
    let mut robot = SilentRobot::new();
    robot.bench.stop(Some(Command::Contact));
    assert_eq!(robot.bench.refusal(), Some(CommandRefusal::Stopped));
    assert!(robot.hears(500).iter().all(|mode| *mode == MODE_SERVO));
}

/// Regression: a silent robot was called without end, and one that was switched on a minute later received commands.
#[test]
fn a_silent_robot_is_called_for_ten_seconds_after_each_request() {
    let mut robot = SilentRobot::new();
    assert!(robot.hears(1000).is_empty(), "nothing before the request");
    for _ in 0..2 {
        robot.bench.robot.begin_contact();
        assert_eq!(robot.hears(10_000), [MODE_BRAKE; 100]);
        assert!(robot.hears(20_000).is_empty());
    }
    assert_eq!(robot.bench.cycle.mode(), Mode::Offline);
}
