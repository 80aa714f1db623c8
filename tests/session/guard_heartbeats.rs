//! The heartbeats to the guard and its answers, tick by tick, and the guard's input: orders, heartbeats, suspensions of the
//! computer. `tests/console/guard.rs` runs the guard as a process.

use std::io::Write;
use std::net::{Ipv4Addr, UdpSocket};
use std::os::unix::net::UnixStream;

use crate::bench::shipped;
use quadfrog::engine::{GuardHeartbeat, GuardOrders, GuardOutcome, run_guard, run_guard_with};
use quadfrog::robot::JointCommand;
use quadfrog::robot::go1::convert::low_cmd;
use quadfrog::robot::go1::packet::{CrcForm, LowCmd};
use quadfrog::robot::go2;
use quadfrog::robot::hardware::DampingRoute;
use quadfrog::trial::Backend;

// Bytes on the connection, and limits of the guard (`src/engine/guard.rs`).
const COMMANDED: u8 = b'+';
const LEFT_ALONE: u8 = b'-';
const ANSWER: u8 = b'!';
/// Ticks between two heartbeats.
const HEARTBEAT_TICKS: u32 = 10;
/// Longest time to the first answer of a guard that starts, ms.
const LONGEST_START_MS: u32 = 5000;
/// Suspension of the computer after which the guard damps, ms.
const SUSPENDED_MS: u32 = 50;

fn heartbeat() -> (GuardHeartbeat, UnixStream) {
    let (ours, theirs) = UnixStream::pair().unwrap();
    (GuardHeartbeat::new(ours).unwrap(), theirs)
}

/// Regression: a stopped guard was noticed only when its pipe was full, after eleven minutes. In ticks, so that
/// the result does not depend on the machine's speed.
#[test]
fn a_guard_that_stops_answering_is_silent_within_a_hundred_ticks_and_one_that_answers_is_not() {
    let allowed_ms = shipped(Backend::Hardware).2.failsafe.guard_silent_ms;
    let (mut heartbeat, mut guard) = heartbeat();
    let answer = |guard: &mut UnixStream| guard.write_all(&[ANSWER]).unwrap();
    for _ in 0..1000 {
        assert_eq!(heartbeat.count_tick(true), 0, "a guard that starts needs its time");
    }
    for _ in 0..1000 {
        answer(&mut guard);
        assert!(heartbeat.count_tick(true) < allowed_ms);
    }
    let mut ticks = 0;
    while heartbeat.count_tick(true) <= allowed_ms {
        ticks += 1;
    }
    assert!((60..100).contains(&ticks), "noticed after {ticks} ticks");
    answer(&mut guard);
    for _ in 0..HEARTBEAT_TICKS {
        heartbeat.count_tick(true);
    }
    assert_eq!(heartbeat.count_tick(true), 0, "it answers again");
    // Not dropped: a program that another test starts at this moment holds a copy until it runs.
    guard.shutdown(std::net::Shutdown::Both).unwrap();
    for _ in 0..HEARTBEAT_TICKS {
        heartbeat.count_tick(true);
    }
    assert_eq!(heartbeat.count_tick(true), u32::MAX, "it is gone");
}

#[test]
fn a_guard_that_never_answers_is_silent_after_the_time_to_start() {
    let (mut heartbeat, _guard) = heartbeat();
    let ticks = (0..20_000).position(|_| heartbeat.count_tick(false) > 0).unwrap() as u32;
    assert!(ticks.abs_diff(LONGEST_START_MS) < 20, "{ticks}");
    // It stays silent, not gone: a stopped process may continue.
    for _ in 0..20_000 {
        assert_ne!(heartbeat.count_tick(false), u32::MAX);
    }
}

fn command(kd: f64) -> Vec<u8> {
    low_cmd(&JointCommand::damping(kd), CrcForm::Plain).unwrap().bytes().to_vec()
}

/// Bytes of the orders with their length.
fn orders(silence_ms: u16, damping: DampingRoute) -> Vec<u8> {
    let orders = serde_json::to_vec(&GuardOrders { silence_ms, damping }).unwrap();
    [&(orders.len() as u16).to_le_bytes()[..], &orders].concat()
}

/// Two sockets in place of the robot and of the connection to it.
fn robot() -> (UdpSocket, UdpSocket) {
    let robot = UdpSocket::bind(("127.0.0.1", 0)).unwrap();
    robot.set_nonblocking(true).unwrap();
    let socket = UdpSocket::bind(("127.0.0.1", 0)).unwrap();
    socket.connect(robot.local_addr().unwrap()).unwrap();
    (robot, socket)
}

/// Runs a guard with the heartbeats of a commanded robot, which it reads at two wakes; the computer was suspended for
/// `suspended_ms` before the second. Returns the number of datagrams until the message that the robot is left alone.
fn datagrams(suspended_ms: u32) -> usize {
    let ((robot, socket), (mut ours, theirs)) = (robot(), UnixStream::pair().unwrap());
    // One more than it reads at once.
    let heartbeats = [COMMANDED; 65];
    ours.write_all(&[&orders(60_000, DampingRoute::Go1 { command: command(3.0) })[..], &heartbeats].concat()).unwrap();
    let last = if suspended_ms > SUSPENDED_MS { 6 } else { 2 };
    let mut wakes = 0;
    let outcome = run_guard_with(theirs, socket, || {
        wakes += 1;
        if wakes == last {
            ours.write_all(&[LEFT_ALONE]).unwrap();
            ours.shutdown(std::net::Shutdown::Write).unwrap();
        }
        if wakes == 2 { suspended_ms } else { 0 }
    });
    assert_eq!(outcome.unwrap(), GuardOutcome::Quiet);
    std::iter::from_fn(|| robot.recv(&mut [0; 2048]).ok()).count()
}

/// The heartbeat that wakes the guard was sent before the suspension: it damps until the next.
#[test]
fn a_guard_on_a_resumed_computer_damps_until_the_next_heartbeat() {
    assert_eq!(datagrams(SUSPENDED_MS), 0);
    assert_eq!(datagrams(SUSPENDED_MS + 1), 5);
}

#[test]
fn a_guard_refuses_a_datagram_that_does_not_damp() {
    let guard = |input: &[u8]| {
        let (mut ours, theirs) = UnixStream::pair().unwrap();
        ours.write_all(input).unwrap();
        drop(ours);
        run_guard(theirs, robot().1)
    };
    let go2 = |command| DampingRoute::Go2 { command, domain: 1, address: Ipv4Addr::LOCALHOST, reliable: false };
    for kd in [0.03, 0.9] {
        let to_go2 = go2(go2::link::damping(kd).unwrap().bytes().to_vec());
        for start in [orders(70, DampingRoute::Go1 { command: command(kd) }), orders(70, to_go2)] {
            let error = guard(&start).unwrap_err().to_string();
            assert!(error.contains("does not damp"), "{error}");
        }
    }
    let braking = LowCmd::braking(CrcForm::Plain).bytes().to_vec();
    assert!(guard(&orders(70, DampingRoute::Go1 { command: braking })).is_err());
    assert!(guard(&orders(70, go2(command(3.0)))).is_err(), "a command of the other robot");
    assert!(guard(b"\x02\x00{}").is_err(), "no orders");
    assert!(guard(b"\xff\xff{").is_err(), "orders that end");
}
