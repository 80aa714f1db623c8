//! The process that damps a robot whose console was killed: the real program, and a socket in the robot's place that keeps what
//! it is sent.

#[path = "support/pty.rs"]
mod pty;

use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use pty::Session;
use quadfrog::config::Config;
use quadfrog::robot::go1::convert::{low_cmd, low_state};
use quadfrog::robot::go1::packet::CrcForm;
use quadfrog::robot::{JointCommand, RobotState};

/// How long no datagram comes from who has stopped sending.
const SILENCE: Duration = Duration::from_millis(500);

/// Answers every datagram with the state of a robot that lies still.
struct Robot {
    address: SocketAddr,
    received: Arc<Mutex<Vec<Vec<u8>>>>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Robot {
    fn start() -> Robot {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.set_read_timeout(Some(SILENCE)).unwrap();
        let address = socket.local_addr().unwrap();
        let (received, ending) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let (kept, flag) = (received.clone(), ending.clone());
        let answer = move || {
            let (mut datagram, mut state) = ([0; 2048], RobotState::default());
            while !flag.load(Ordering::Acquire) {
                let Ok((length, from)) = socket.recv_from(&mut datagram) else { continue };
                kept.lock().unwrap().push(datagram[..length].to_vec());
                state.robot_time_ms += 1;
                let mut answer = low_state(&state, 1.0);
                answer.seal();
                // Whoever was killed is not there to hear it.
                let _ = socket.send_to(answer.bytes(), from);
            }
        };
        Robot { address, received, ending, thread: Some(std::thread::spawn(answer)) }
    }

    fn count(&self) -> usize {
        self.received.lock().unwrap().len()
    }

    /// All that comes from now until nothing comes any more.
    fn rest(&self, from: usize) -> Vec<Vec<u8>> {
        let mut count = usize::MAX;
        while count != self.count() {
            count = self.count();
            std::thread::sleep(SILENCE);
        }
        self.received.lock().unwrap()[from..].to_vec()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The Go1 with any port at this end, so that tests can run side by side.
fn model(folder: &Path) -> PathBuf {
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

/// What every joint is told to damp it.
fn damping() -> Vec<u8> {
    let kd = Config::load(None).unwrap().safety.gate.damping_kd;
    low_cmd(&JointCommand::damping(kd), CrcForm::Plain).unwrap().bytes().to_vec()
}

fn console(folder: &Path, robot: &Robot, more: &[&str]) -> Session {
    let (address, model) = (robot.address.to_string(), model(folder));
    let arguments = ["--robot", "go1", "--address", &address, "--model", model.to_str().unwrap()];
    Session::start(folder, (120, 36), &[&arguments, more].concat())
}

/// A console that has taken control of `robot`, and is in its pre-arm list.
fn controlling(folder: &Path, robot: &Robot) -> Session {
    let session = console(folder, robot, &[]);
    damped(&session, robot);
    session
}

/// Waits until nothing but damping has come for a while.
fn damped(session: &Session, robot: &Robot) {
    let damping = damping();
    session.wait_until("the robot is damped", || {
        let received = robot.received.lock().unwrap();
        received.len() > 500 && received[received.len() - 100..].iter().all(|datagram| *datagram == damping)
    });
}

/// The guard of `console`: its only child.
fn guard_of(console: Pid) -> Pid {
    let tasks = std::fs::read_dir(format!("/proc/{console}/task")).unwrap();
    let children = tasks.map(|task| std::fs::read_to_string(task.unwrap().path().join("children")).unwrap_or_default());
    let children: String = children.collect();
    Pid::from_raw(children.trim().parse().unwrap_or_else(|_| panic!("children of {console}: {children:?}")))
}

/// Kills the console; what comes from then on must be the guard's.
fn kill_console(session: &mut Session, robot: &Robot) -> Vec<Vec<u8>> {
    session.signal(Signal::SIGKILL);
    session.wait();
    robot.rest(robot.count())
}

/// Three seconds of damping; a socket's queue on a busy machine may lose some.
fn assert_damped(rest: &[Vec<u8>]) {
    assert!(rest.len() > 1000, "{} datagrams after the end", rest.len());
    let damping = damping();
    assert!(rest.iter().all(|datagram| *datagram == damping));
}

/// Nor does the guard end with what ends a console in order, or a terminal.
#[test]
fn a_robot_whose_console_is_killed_is_damped() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::start();
    let mut session = controlling(folder.path(), &robot);
    let guard = guard_of(session.pid());
    for signal in [Signal::SIGHUP, Signal::SIGINT, Signal::SIGTERM] {
        kill(guard, signal).unwrap();
    }
    assert_damped(&kill_console(&mut session, &robot));
}

/// The program stands still, as under a debugger: the guard damps until it goes on, and is then done without.
#[test]
fn a_robot_whose_console_is_stopped_is_damped_until_it_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::start();
    let mut session = controlling(folder.path(), &robot);
    session.signal(Signal::SIGSTOP);
    let stopped = robot.count();
    session.wait_until("the guard damps", || robot.count() > stopped + 2000);
    session.signal(Signal::SIGCONT);
    session.wait_for(&["FAULT", "late"]);
    // The guard is silent again: of what comes in a second, one sender's share.
    let (before, began) = (robot.count(), Instant::now());
    std::thread::sleep(Duration::from_secs(1));
    let rate = (robot.count() - before) as f64 / began.elapsed().as_secs_f64();
    assert!(rate < 1500.0, "{rate} datagrams a second");
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
}

#[test]
fn a_robot_whose_console_ends_in_order_hears_nothing_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::start();
    let mut session = controlling(folder.path(), &robot);
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
    // What was sent before may still wait in the socket.
    let rest = robot.rest(robot.count());
    assert!(rest.len() < 100, "{} datagrams after the end", rest.len());
}

#[test]
fn a_robot_that_is_only_observed_hears_nothing_of_the_guard_unless_it_was_stopped() {
    for stopped in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let robot = Robot::start();
        // The robot sends to where commands come from; the first comes with the STOP.
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

/// (That nothing is armed then: `session_pre_arm`.)
#[test]
fn a_lost_guard_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::start();
    let mut session = controlling(folder.path(), &robot);
    kill(guard_of(session.pid()), Signal::SIGKILL).unwrap();
    session.send("6");
    session.wait_for(&["the guard process has ended"]);
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
}

/// The guard by itself: what it is given, and where it may send.
fn guard(given: &[u8], socket: UdpSocket) -> Output {
    let mut process = Command::new(env!("CARGO_BIN_EXE_quadfrog"))
        .arg("guard")
        .stdin(Stdio::piped())
        .stdout(OwnedFd::from(socket))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // One that refuses what it is given does not read to the end.
    let _ = process.stdin.take().unwrap().write_all(given);
    process.wait_with_output().unwrap()
}

#[test]
fn a_guard_sends_nothing_to_a_robot_that_was_left_alone_and_nothing_that_is_no_command() {
    let robot = Robot::start();
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    socket.connect(robot.address).unwrap();
    let mut spoilt = damping();
    spoilt[30] ^= 1;
    for (given, after, status) in [
        (damping(), "\x46\0", 0),
        (damping(), "\x46\0+-", 0),
        (damping(), "\x46", 2),
        (spoilt, "\x46\0+", 2),
        (damping()[..600].to_vec(), "", 2),
        (b"quadfrog\n".to_vec(), "", 2),
    ] {
        let output = guard(&[&given, after.as_bytes()].concat(), socket.try_clone().unwrap());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{after:?}: {said}");
        assert_eq!(said.contains("is no command"), status == 2, "{said}");
    }
    assert_eq!(robot.rest(0), Vec::<Vec<u8>>::new());
    let output = guard(&[&damping()[..], b"\x46\0-+"].concat(), socket);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("the robot was damped, 3000 times"), "{said}");
    assert_damped(&robot.rest(0));
}
