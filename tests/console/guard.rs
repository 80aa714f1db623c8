//! The guard process, which damps a robot whose console died: the program, and a socket that records the commands in place
//! of the robot.

use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::pty::{STRICT, Session, Setup};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use portable_pty::CommandBuilder;
use quadfrog::config::Config;
use quadfrog::engine::Guard;
use quadfrog::robot::description::RobotFiles;
use quadfrog::robot::go1::convert::{low_cmd, low_state};
use quadfrog::robot::go1::packet::CrcForm;
use quadfrog::robot::hardware::DampingRoute;
use quadfrog::robot::{JOINTS, JointCommand, RobotState};
use quadfrog::trial::{Backend, Task};
use tempfile::TempDir;

/// Time without a datagram after which the sender counts as ended.
const SILENCE: Duration = Duration::from_millis(500);

/// Answers every datagram with the state of a robot that lies still.
struct RecordingRobot {
    address: SocketAddr,
    received: Arc<Mutex<Vec<Vec<u8>>>>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RecordingRobot {
    fn start() -> RecordingRobot {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.set_read_timeout(Some(SILENCE)).unwrap();
        let address = socket.local_addr().unwrap();
        let (received, ending) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let (kept, flag) = (received.clone(), ending.clone());
        let answer = move || {
            let mut datagram = [0; 2048];
            // Its motors follow commands: otherwise the console faults, and only a line of its log says that it was disarmed.
            let mut state = RobotState { motor_enabled: [true; JOINTS], ..RobotState::default() };
            while !flag.load(Ordering::Acquire) {
                let Ok((length, from)) = socket.recv_from(&mut datagram) else { continue };
                kept.lock().unwrap().push(datagram[..length].to_vec());
                state.robot_time_ms += 1;
                let mut answer = low_state(&state, 1.0);
                answer.write_crc();
                // Fails if the sender was killed.
                let _ = socket.send_to(answer.bytes(), from);
            }
        };
        RecordingRobot { address, received, ending, thread: Some(std::thread::spawn(answer)) }
    }

    fn count(&self) -> usize {
        self.received.lock().unwrap().len()
    }

    /// The datagrams from number `from` until the sender ends.
    fn rest(&self, from: usize) -> Vec<Vec<u8>> {
        let mut count = usize::MAX;
        while count != self.count() {
            count = self.count();
            std::thread::sleep(SILENCE);
        }
        self.received.lock().unwrap()[from..].to_vec()
    }
}

impl Drop for RecordingRobot {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The Go1 with any local port, so that tests can run in parallel.
pub fn model(folder: &Path) -> PathBuf {
    let model = folder.join("model");
    std::fs::create_dir(&model).unwrap();
    for file in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/go1")).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), model.join(file.file_name())).unwrap();
    }
    let description = model.join("robot.toml");
    let text = std::fs::read_to_string(&description).unwrap();
    let any_port = text.replace("local_port = 8090", "local_port = 0");
    assert_ne!(any_port, text);
    std::fs::write(description, any_port).unwrap();
    model
}

/// The damping command.
fn damping() -> Vec<u8> {
    let kd = Config::load(None).unwrap().safety.gate.damping_kd;
    low_cmd(&JointCommand::damping(kd), CrcForm::Plain).unwrap().bytes().to_vec()
}

fn console(folder: &Path, robot: &RecordingRobot, more: &[&str]) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["--robot", "go1", "--address", &robot.address.to_string()]);
    command.args([Path::new("--output"), folder, Path::new("--model"), &model(folder)]);
    command.args(more);
    Session::run_in(folder, &Setup { size: (120, 36), cell: (0, 0), variables: &[STRICT] }, command)
}

/// A robot and the console in control of it, before arming.
fn controlling() -> (TempDir, RecordingRobot, Session) {
    let (folder, robot) = (tempfile::tempdir().unwrap(), RecordingRobot::start());
    let mut session = console(folder.path(), &robot, &[]);
    take_control(&mut session);
    damped(&session, &robot);
    (folder, robot, session)
}

/// Takes control with the keys, once the console has listened for a second.
fn take_control(session: &mut Session) {
    session.wait_for(&["L takes control"]);
    std::thread::sleep(Duration::from_millis(1100));
    session.send("L");
    session.wait_for(&["Take control?"]);
    session.send("y");
}

/// A second console once damped the robot that another one drove, without a key.
#[test]
fn a_console_sends_nothing_to_a_robot_before_a_key() {
    let (folder, robot) = (tempfile::tempdir().unwrap(), RecordingRobot::start());
    let mut session = console(folder.path(), &robot, &[]);
    session.wait_for(&["OFFLINE", "The robot is silent, nothing is sent to it. L takes control."]);
    std::thread::sleep(Duration::from_secs(3));
    session.send("L");
    session.wait_for(&["Take control?", "has sent nothing since the start"]);
    session.send("n");
    session.wait_for(&["cancelled: nothing was sent to the robot"]);
    assert_eq!(robot.count(), 0, "datagrams before the key");
    take_control(&mut session);
    damped(&session, &robot);
    // On a busy machine late states of the robot latch a fault, in which it is damped as well.
    session.wait_until("the robot is under control", || {
        ["DISARMED", "FAULT"].iter().any(|mode| session.screen().contains(mode))
    });
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
}

/// Waits until the last 100 commands are damping.
fn damped(session: &Session, robot: &RecordingRobot) {
    let damping = damping();
    session.wait_until("the robot is damped", || {
        let received = robot.received.lock().unwrap();
        received.len() > 500 && received[received.len() - 100..].iter().all(|datagram| *datagram == damping)
    });
}

/// The guard: the child of `console` with its name.
fn guard_of(console: Pid) -> Pid {
    let tasks = std::fs::read_dir(format!("/proc/{console}/task")).unwrap();
    let children = tasks.map(|task| std::fs::read_to_string(task.unwrap().path().join("children")).unwrap_or_default());
    let children: Vec<i32> = children.collect::<String>().split_whitespace().map(|id| id.parse().unwrap()).collect();
    let is_guard = |id: &&i32| {
        std::fs::read(format!("/proc/{id}/cmdline")).is_ok_and(|arguments| arguments.starts_with(b"quadfrog-guard"))
    };
    Pid::from_raw(*children.iter().find(is_guard).unwrap_or_else(|| panic!("children of {console}: {children:?}")))
}

/// Kills the console and returns the commands of the guard.
fn kill_console(session: &mut Session, robot: &RecordingRobot) -> Vec<Vec<u8>> {
    session.signal(Signal::SIGKILL);
    session.ended();
    robot.rest(robot.count())
}

/// Checks for damping over three seconds; a busy machine may lose some datagrams.
fn assert_damped(rest: &[Vec<u8>]) {
    assert!(rest.len() > 1000, "{} datagrams after the end", rest.len());
    let damping = damping();
    assert!(rest.iter().all(|datagram| *datagram == damping));
}

/// The guard ignores the signals that end a console or a terminal.
#[test]
fn a_robot_whose_console_is_killed_is_damped() {
    let (_folder, robot, mut session) = controlling();
    let guard = guard_of(session.pid());
    for signal in [Signal::SIGHUP, Signal::SIGINT, Signal::SIGTERM] {
        kill(guard, signal).unwrap();
    }
    assert_damped(&kill_console(&mut session, &robot));
}

/// A stopped process, as under a debugger.
#[test]
fn a_robot_whose_console_is_stopped_is_damped_until_it_continues() {
    let (_folder, robot, mut session) = controlling();
    session.signal(Signal::SIGSTOP);
    let stopped = robot.count();
    session.wait_until("the guard damps", || robot.count() > stopped + 2000);
    session.signal(Signal::SIGCONT);
    session.wait_for(&["FAULT", "late"]);
    // The guard is silent again: the rate is that of one sender.
    let (before, began) = (robot.count(), Instant::now());
    std::thread::sleep(Duration::from_secs(1));
    let rate = (robot.count() - before) as f64 / began.elapsed().as_secs_f64();
    assert!(rate < 1500.0, "{rate} datagrams a second");
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
}

#[test]
fn a_robot_whose_console_ends_normally_receives_nothing_afterwards() {
    let (_folder, robot, mut session) = controlling();
    session.signal(Signal::SIGTERM);
    assert!(session.ended().success());
    // Earlier commands may still be in the socket's queue.
    let rest = robot.rest(robot.count());
    assert!(rest.len() < 100, "{} datagrams after the end", rest.len());
}

#[test]
fn an_observed_robot_receives_nothing_from_the_guard_unless_it_was_stopped() {
    for stopped in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let robot = RecordingRobot::start();
        // The robot answers commands; the first one is that of STOP.
        let mut session = console(folder.path(), &robot, &["--observe"]);
        session.wait_for(&["OFFLINE"]);
        if stopped {
            session.send("\x1b[24~");
            damped(&session, &robot);
        }
        let rest = kill_console(&mut session, &robot);
        if stopped {
            assert_damped(&rest);
        } else {
            assert!(rest.is_empty(), "{} datagrams", rest.len());
        }
    }
}

/// `session_arming` checks that arming is then refused.
#[test]
fn a_lost_guard_is_reported() {
    let (_folder, _robot, mut session) = controlling();
    kill(guard_of(session.pid()), Signal::SIGKILL).unwrap();
    session.send("6");
    session.wait_for(&["the guard process has ended"]);
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
}

/// Regression: it was noticed only when its pipe was full, after eleven minutes. `session_arming` checks that arming is
/// refused meanwhile.
#[test]
fn a_stopped_guard_is_reported_and_so_is_its_return() {
    let (_folder, _robot, mut session) = controlling();
    let guard = guard_of(session.pid());
    session.send("6");
    kill(guard, Signal::SIGSTOP).unwrap();
    session.wait_for(&["the guard process does not answer"]);
    kill(guard, Signal::SIGCONT).unwrap();
    session.wait_for(&["the guard process answers again"]);
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
}

/// Regression: the guard was killed at once, also where the robot was left to it because the commands did not reach it.
#[test]
fn a_robot_that_is_left_to_the_guard_is_damped_before_the_guard_ends() {
    let robot = RecordingRobot::start();
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    socket.connect(robot.address).unwrap();
    let route = (DampingRoute::Go1 { command: damping() }, Some(socket));
    let description = RobotFiles::embedded("go1").unwrap().description().unwrap();
    let settings = Config::load(None).unwrap().settings(&description, Task::Forward, Backend::Hardware).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_quadfrog"));
    let (guard, mut heartbeat) = Guard::start(program, route, &settings).unwrap();
    heartbeat.count_tick(true);
    heartbeat.leave_robot();
    guard.end();
    assert_damped(&robot.rest(0));
}

/// Runs the guard alone with this input and this socket.
fn guard(given: &[u8], socket: UdpSocket) -> Output {
    let mut process = Command::new(env!("CARGO_BIN_EXE_quadfrog"))
        .arg("guard")
        .stdin(Stdio::piped())
        .stdout(OwnedFd::from(socket))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A guard that refuses its input does not read all of it.
    let _ = process.stdin.take().unwrap().write_all(given);
    process.wait_with_output().unwrap()
}

/// The orders of a console with a Go1, as it writes them: their length and JSON.
fn orders(command: &[u8]) -> Vec<u8> {
    let damping = serde_json::json!({ "Go1": { "command": command } });
    framed(serde_json::json!({ "silence_ms": 70, "damping": damping }).to_string().as_bytes())
}

fn framed(orders: &[u8]) -> Vec<u8> {
    [&(orders.len() as u16).to_le_bytes(), orders].concat()
}

#[test]
fn a_guard_sends_nothing_to_a_robot_without_commands_and_no_invalid_command() {
    let robot = RecordingRobot::start();
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    socket.connect(robot.address).unwrap();
    let mut spoilt = damping();
    spoilt[30] ^= 1;
    // 0.03 N m s/rad is the word 0.
    let limp = low_cmd(&JointCommand::damping(0.03), CrcForm::Plain).unwrap().bytes().to_vec();
    let whole = orders(&damping());
    for (name, given, after, status) in [
        ("no heartbeat", whole.clone(), "", 0),
        ("left alone", whole.clone(), "+-", 0),
        ("cut", whole[..whole.len() - 1].to_vec(), "", 2),
        ("length alone", whole[..2].to_vec(), "", 2),
        ("wrong checksum", orders(&spoilt), "+", 2),
        ("without damping", orders(&limp), "+", 2),
        ("cut command", orders(&damping()[..600]), "+", 2),
        ("unknown way", framed(br#"{"silence_ms":70,"damping":{"Go9":{"command":[]}}}"#), "+", 2),
        ("text", b"quadfrog\n".to_vec(), "", 2),
    ] {
        let output = guard(&[&given, after.as_bytes()].concat(), socket.try_clone().unwrap());
        let printed = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{name}: {printed}");
        assert_eq!(printed.contains("is not a valid command"), status == 2, "{printed}");
    }
    assert_eq!(robot.rest(0), Vec::<Vec<u8>>::new());
    let output = guard(&[&whole[..], b"-+"].concat(), socket);
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && printed.contains("the robot was damped, 3000 times"), "{printed}");
    assert_damped(&robot.rest(0));
}
