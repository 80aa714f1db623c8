//! The Go2 behind a transport in memory: what is accepted and counted, what is sent, and when sending has failed.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use quadfrog::robot::description::RobotFiles;
use quadfrog::robot::go2::convert::low_state;
use quadfrog::robot::go2::link::{Go2, Transport, TransportCounts, damping};
use quadfrog::robot::go2::message::{COMMAND_LENGTH, CommandMessage, STATE_LENGTH, VELOCITY_STOP};
use quadfrog::robot::go2::network::Go2Network;
use quadfrog::robot::{JOINTS, JointCommand, MotorCommand, Robot, RobotError, RobotState};

/// Payloads in memory; a test holds the other end.
#[derive(Debug, Clone, Default)]
struct InMemory(Arc<Mutex<Wire>>);

#[derive(Debug, Default)]
struct Wire {
    states: VecDeque<Vec<u8>>,
    commands: Vec<Vec<u8>>,
    counts: TransportCounts,
    /// Commands are handed over and never reach the network.
    stuck: bool,
    /// Commands on the network come back.
    returns: bool,
}

impl Transport for InMemory {
    fn receive(&mut self, payload: &mut [u8; STATE_LENGTH]) -> Option<usize> {
        let state = self.0.lock().unwrap().states.pop_front()?;
        let held = state.len().min(STATE_LENGTH);
        payload[..held].copy_from_slice(&state[..held]);
        Some(state.len())
    }
    fn send(&mut self, payload: &[u8; COMMAND_LENGTH]) {
        let mut wire = self.0.lock().unwrap();
        if !wire.stuck {
            wire.commands.push(payload.to_vec());
            wire.counts.sent += 1;
            wire.counts.returned += u64::from(wire.returns);
        }
    }
    fn counts(&self) -> TransportCounts {
        self.0.lock().unwrap().counts
    }
}

fn robot() -> (Go2<InMemory>, InMemory) {
    let network = Go2Network::read(&RobotFiles::embedded("go2").unwrap()).unwrap().unwrap();
    let wire = InMemory::default();
    (Go2::new(wire.clone(), &network), wire)
}

fn state(time_ms: u32) -> Vec<u8> {
    let state = RobotState { robot_time_ms: time_ms, ..RobotState::default() };
    low_state(&state, 1.0).encode().to_vec()
}

impl InMemory {
    fn arrives(&self, state: Vec<u8>) {
        self.0.lock().unwrap().states.push_back(state);
    }
}

#[test]
fn states_are_new_lost_late_doubled_damaged_short_or_of_a_restarted_robot() {
    let (mut robot, wire) = robot();
    assert_eq!(robot.read(), Err(RobotError::NoNewState { age_ms: 1 }));
    wire.arrives(state(1000));
    assert_eq!(robot.read().unwrap().robot_time_ms, 1000);
    wire.arrives(state(1003));
    wire.arrives(state(1001));
    wire.arrives(state(1003));
    assert_eq!(robot.read().unwrap().robot_time_ms, 1003);
    let mut damaged = state(1004);
    damaged[100] ^= 4;
    wire.arrives(damaged);
    wire.arrives(vec![1; 20]);
    wire.arrives(Vec::new());
    wire.arrives([state(1005), vec![0; 3000]].concat());
    assert_eq!(robot.read().unwrap().robot_time_ms, 1005, "bytes behind a state are padding");
    wire.arrives(state(3));
    assert_eq!(robot.read().unwrap().robot_time_ms, 3);
    let link = robot.link().unwrap();
    assert_eq!((link.received, link.duplicate, link.out_of_order), (4, 1, 1), "{link:?}");
    // 1001 was counted as lost until it came; 1002 and 1004 were lost.
    assert_eq!((link.lost, link.corrupt, link.wrong_length, link.reboots), (2, 1, 2, 1), "{link:?}");
    assert_eq!(robot.read(), Err(RobotError::NoNewState { age_ms: 1 }));
    assert_eq!(robot.read(), Err(RobotError::NoNewState { age_ms: 2 }));
}

/// A flood cannot delay the tick: 32 states in one, the rest in the next.
#[test]
fn a_flood_is_taken_in_parts() {
    let (mut robot, wire) = robot();
    (1..=100).for_each(|ms| wire.arrives(state(ms)));
    assert_eq!(robot.read().unwrap().robot_time_ms, 32);
    assert_eq!(robot.read().unwrap().robot_time_ms, 64);
}

#[test]
fn a_command_that_cannot_be_encoded_becomes_damping_and_none_is_sent_before_the_first_damping() {
    let (mut robot, wire) = robot();
    let mut wrong = JointCommand::damping(3.0);
    wrong.motor[4] = MotorCommand { torque_n_m: f64::NAN, ..wrong.motor[4] };
    assert!(matches!(robot.write(&wrong), Err(RobotError::Send { .. })));
    assert!(wire.0.lock().unwrap().commands.is_empty(), "never damped, never commanded");
    robot.write(&JointCommand::damping(3.0)).unwrap();
    robot.write(&JointCommand::hold(&[0.1; JOINTS], 60.0, 5.0)).unwrap();
    assert!(matches!(robot.write(&wrong), Err(RobotError::Send { .. })));
    let commands = wire.0.lock().unwrap().commands.clone();
    assert_eq!(commands.len(), 3);
    assert_eq!(commands[0], damping(3.0).unwrap().bytes());
    assert_eq!(commands[2], commands[0], "damping in place of the wrong command");
    let hold = CommandMessage::decode(&commands[1]).unwrap();
    assert_eq!((hold.motor[0].kp, hold.motor[0].kd, hold.motor[0].velocity), (60.0, 5.0, 0.0));
    assert_eq!(hold.motor[12].velocity, VELOCITY_STOP, "motors that do not exist have no target");
    assert_eq!(hold.battery, [0; 4]);
}

/// A writer that hangs is an error within 20 ms, and none as soon as it writes again.
#[test]
fn commands_that_do_not_reach_the_network_are_an_error() {
    let (mut robot, wire) = robot();
    let tick = |robot: &mut Go2<InMemory>| {
        let _ = robot.read();
        robot.write(&JointCommand::damping(3.0))
    };
    for _ in 0..100 {
        tick(&mut robot).unwrap();
    }
    wire.0.lock().unwrap().stuck = true;
    let until = (0..1000).position(|_| tick(&mut robot).is_err());
    assert!(until.is_some_and(|ms| (15..=25).contains(&ms)), "{until:?}");
    wire.0.lock().unwrap().stuck = false;
    let _ = tick(&mut robot);
    tick(&mut robot).unwrap();
    // Nothing is commanded: nothing waits.
    for _ in 0..100 {
        let _ = robot.read();
    }
    tick(&mut robot).unwrap();
}

/// Regression: a library that drops what the system refuses to send counts it as sent, and there was no error.
#[test]
fn commands_that_no_longer_come_back_are_an_error() {
    let (mut robot, wire) = robot();
    let damping = JointCommand::damping(3.0);
    (0..100).for_each(|_| robot.write(&damping).unwrap());
    assert!(robot.delivers(), "where none ever came back, those that were sent count");
    wire.0.lock().unwrap().returns = true;
    (0..100).for_each(|_| robot.write(&damping).unwrap());
    wire.0.lock().unwrap().returns = false;
    let until = (0..1000).position(|_| robot.write(&damping).is_err());
    assert!(until.is_some_and(|ms| (15..=25).contains(&ms)), "{until:?}");
    assert!(!robot.delivers());
    wire.0.lock().unwrap().returns = true;
    let _ = robot.write(&damping);
    robot.write(&damping).unwrap();
    assert!(robot.delivers());
}

/// The same rule as the Go1's: a motor has time to enter servo mode, and again after a restart.
#[test]
fn a_motor_that_is_not_in_servo_mode_counts_only_after_it_was_commanded() {
    let (mut robot, wire) = robot();
    let mut time_ms = 1000;
    let mut enabled = |robot: &mut Go2<InMemory>, ms: u32| {
        let mut last = [true; JOINTS];
        for _ in 0..ms {
            time_ms += 1;
            wire.arrives(state(time_ms));
            last = robot.read().unwrap().motor_enabled;
        }
        last
    };
    assert_eq!(enabled(&mut robot, 500), [true; JOINTS], "never commanded");
    robot.write(&JointCommand::damping(3.0)).unwrap();
    assert_eq!(enabled(&mut robot, 50), [true; JOINTS], "within its time");
    assert_eq!(enabled(&mut robot, 100), [false; JOINTS]);
    wire.arrives(state(5));
    assert_eq!(robot.read().unwrap().motor_enabled, [true; JOINTS], "after a restart");
}
