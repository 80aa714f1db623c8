//! The emulated robot as a program: its prompt, its address, its end.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use quadfrog::robot::JointCommand;
use quadfrog::robot::go1::convert::low_cmd;
use quadfrog::robot::go1::packet::{CrcForm, LowState};

use crate::program::{Program, assert_shows, ending_signals};

/// Regressions: after a line that is not UTF-8 no fault was taken any more, without a word; a line without an end was kept whole, up to
/// the end of the memory.
#[test]
fn faults_are_taken_after_a_line_that_is_none() {
    let mut emulate = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
    emulate.args(["emulate", "--bind", "127.0.0.1:0"]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut emulator = emulate.spawn().unwrap();
    let long = [b'x'; 3000];
    let input = [b"loss 5\n\xff\xfe\n".as_slice(), &long, b"\nloss 7\n"].concat();
    emulator.stdin.as_mut().unwrap().write_all(&input).unwrap();
    let (said, lines) = channel();
    let output = BufReader::new(emulator.stdout.take().unwrap());
    std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| said.send(line)));
    let done = std::iter::from_fn(|| lines.recv_timeout(Duration::from_secs(30)).ok());
    let done: Vec<String> = done.filter(|line| line.starts_with("done: ")).take(2).collect();
    emulator.kill().unwrap();
    emulator.wait().unwrap();
    assert_eq!(done, ["done: loss 5", "done: loss 7"]);
}

/// The first line of an emulator on `address`, and the process.
fn listening(program: &Program, address: &str) -> (String, Child) {
    let mut emulator = program.command(&["emulate", "--bind", address]).stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(emulator.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    (line, emulator)
}

/// Regression: a name was refused as an address, and the line for the console held an address that is none.
#[test]
fn an_emulator_takes_a_name_and_prints_an_address_that_can_be_driven() {
    let program = Program::new();
    for (given, listens, drives) in
        [("localhost:0", "listens on ", ""), ("0.0.0.0:0", "listens on 0.0.0.0:", "127.0.0.1:")]
    {
        let (line, mut emulator) = listening(&program, given);
        emulator.kill().unwrap();
        emulator.wait().unwrap();
        assert_shows(&line, &[listens, &format!("quadfrog --robot go1 --address {drives}")]);
    }
    let output = program.run(&["emulate", "--bind", "here"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_shows(&message, &["--bind here: ", "give HOST:PORT, for example 127.0.0.1:8007"]);
}

/// Regression: the first state after a stop of the process had the robot's time of the begin of the stop, which a console reported as a
/// clock that stood still.
#[test]
fn the_clock_of_an_emulated_robot_goes_on_while_its_process_is_stopped() {
    let program = Program::new();
    let (line, mut emulator) = listening(&program, "127.0.0.1:0");
    let address = line.split_whitespace().last().unwrap().to_owned();
    let robot = UdpSocket::bind("127.0.0.1:0").unwrap();
    robot.connect(address).unwrap();
    robot.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    let mut buffer = [0; 2048];
    // The robot's time of the next state, ms, as long as one arrives.
    let mut next_ms = || {
        let length = robot.recv(&mut buffer).ok()?;
        Some(LowState::parse(&buffer[..length]).unwrap().robot_time_ms.get())
    };
    let mut stopped_ms = None;
    while stopped_ms.is_none() {
        robot.send(low_cmd(&JointCommand::damping(3.0), CrcForm::Plain).unwrap().bytes()).unwrap();
        stopped_ms = next_ms();
    }
    let process = Pid::from_raw(emulator.id() as i32);
    kill(process, Signal::SIGSTOP).unwrap();
    while let Some(later_ms) = next_ms() {
        stopped_ms = Some(later_ms);
    }
    std::thread::sleep(Duration::from_secs(1));
    kill(process, Signal::SIGCONT).unwrap();
    let first_ms = next_ms();
    emulator.kill().unwrap();
    emulator.wait().unwrap();
    let passed_ms = first_ms.zip(stopped_ms).map(|(first_ms, stopped_ms)| first_ms - stopped_ms);
    assert!(passed_ms >= Some(1000), "{passed_ms:?} ms after a stop of more than 1 s");
}

/// A library for the program: waits until a time fail after the first hundred, as with a system that has lost its clock.
const LOST_CLOCK: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <time.h>
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *left) {
    static int waits;
    int (*real)(clockid_t, int, const struct timespec *, struct timespec *) = dlsym(RTLD_NEXT, "clock_nanosleep");
    return flags == TIMER_ABSTIME && ++waits > 100 ? EINVAL : real(clock, flags, until, left);
}
"#;

/// Regression: the program went on without its robot, and answered faults with "done".
#[test]
fn an_emulator_whose_robot_ends_is_an_error() {
    let program = Program::new();
    fs::write(program.path("clock.c"), LOST_CLOCK).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-o", "clock.so", "clock.c", "-ldl"]).current_dir(program.path(""));
    assert!(compiler.status().unwrap().success());
    let mut emulate = program.command(&["emulate", "--bind", "127.0.0.1:0"]);
    let output = emulate.env("LD_PRELOAD", program.path("clock.so")).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_shows(&message, &["the monotonic clock"]);
}

/// A promise of `docs/commands.md`.
#[test]
fn a_signal_switches_the_emulated_robot_off_with_status_zero() {
    let program = Program::new();
    for signal in ending_signals().into_iter().filter(|signal| *signal != Signal::SIGHUP) {
        let (_, mut emulator) = listening(&program, "127.0.0.1:0");
        kill(Pid::from_raw(emulator.id() as i32), signal).unwrap();
        assert_eq!(emulator.wait().unwrap().code(), Some(0), "{signal}");
    }
}
