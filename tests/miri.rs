//! Tests that Miri interprets (`docs/safety.md`): datagrams as memory layout, rings and buffers between threads, the journal's
//! codec. No file, no socket, no C library.

use std::thread;

use quadfrog::optimize::journal::{JournalLine, JournalState, Operation};
use quadfrog::realtime::channel::{COMMANDS, channels};
use quadfrog::robot::JointCommand;
use quadfrog::robot::go1::convert::{decode_motor, low_cmd, low_state, robot_state};
use quadfrog::robot::go1::packet::{COMMAND_LENGTH, CrcForm, LowCmd, LowState, STATE_LENGTH};
use quadfrog::telemetry::{Command, Tick};

#[test]
fn datagrams_are_read_at_any_alignment_and_length() {
    let mut command = JointCommand::default();
    command.motor[5].torque_n_m = -7.5;
    command.motor[5].kd_joint = 2.0;
    let sent = low_cmd(&command, CrcForm::Sealed).unwrap();
    let mut state = low_state(&robot_state(&LowState::zero(), 1.0), 1.0);
    state.robot_time_ms = 77_u32.into();
    state.write_crc();
    for shift in 0..4 {
        let bytes = [&vec![0xff; shift], sent.bytes()].concat();
        let read = LowCmd::parse(&bytes[shift..], CrcForm::Sealed).unwrap();
        assert_eq!(decode_motor(&read.motor(5)).unwrap().torque_n_m, -7.5);
        let bytes = [&vec![0xff; shift], state.bytes()].concat();
        assert_eq!(LowState::parse(&bytes[shift..]).unwrap().robot_time_ms.get(), 77);
    }
    for length in [0, 1, 2, COMMAND_LENGTH - 1, COMMAND_LENGTH + 1] {
        assert!(LowCmd::parse(&vec![0xfe; length], CrcForm::Plain).is_err());
    }
    for length in [0, 1, STATE_LENGTH - 1, STATE_LENGTH] {
        assert!(LowState::parse(&vec![0xfe; length]).is_err());
    }
}

#[test]
fn commands_ticks_and_latches_cross_between_threads() {
    let (mut control, mut session, mut console, mut recorder) = channels();
    let count = 2 * COMMANDS as u64;
    let driver = thread::spawn(move || {
        let (mut stops, mut received) = (0, 0);
        while received < count {
            stops = control.stop.count().max(stops);
            if control.commands.pop().is_ok() {
                let tick = Tick { number: received, ..Tick::default() };
                control.shown.push(tick).unwrap();
                control.ticks.push(tick).unwrap();
                received += 1;
            } else {
                thread::yield_now();
            }
        }
        (control, stops)
    });
    for _ in 0..count {
        while session.commands.push(Command::SitDown).is_err() {
            thread::yield_now();
        }
        console.stop.set();
    }
    let (control, stops) = driver.join().unwrap();
    assert!(stops <= count && control.stop.count() == count && console.stop.is_set());
    for number in 0..count {
        assert_eq!(recorder.pop().unwrap().number, number);
        assert_eq!(console.shown.pop().unwrap().number, number);
    }
    assert!(recorder.pop().is_err() && console.shown.pop().is_err());
}

#[test]
fn lines_of_the_journal_are_parsed_applied_and_written_back() {
    let mut state = JournalState::default();
    for line in include_str!("golden/tpe/journal.log").lines().take(40) {
        let parsed = Operation::parse(line).unwrap();
        let again = Operation::parse(&parsed.operation.to_line(&parsed.worker, parsed.times)).unwrap();
        assert_eq!(again, parsed);
        let JournalLine { worker, operation, .. } = parsed;
        state.apply(operation, &worker);
    }
    assert!(!state.studies()[0].trials.is_empty());
    for line in ["", "{", "{}", "{\"op_code\":99,\"worker_id\":\"a\"}", "\"\\ud800\"", "[1e999]"] {
        assert!(Operation::parse(line).is_err(), "{line}");
    }
}
