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
use std::time::Duration;

use nix::sys::signal::Signal;
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

/// A console that has taken control of `robot`, and is in its pre-arm list.
fn controlling(folder: &Path, robot: &Robot) -> Session {
    let (address, model) = (robot.address.to_string(), model(folder));
    let arguments = ["--robot", "go1", "--address", &address, "--model", model.to_str().unwrap()];
    let session = Session::start(folder, (100, 30), &arguments);
    let damping = damping();
    session.wait_until("the robot is commanded", || {
        let received = robot.received.lock().unwrap();
        received.len() > 500 && received[received.len() - 100..].iter().all(|datagram| *datagram == damping)
    });
    session
}

#[test]
fn a_robot_whose_console_is_killed_is_damped() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::start();
    let mut session = controlling(folder.path(), &robot);
    session.signal(Signal::SIGKILL);
    session.wait();
    let killed = robot.count();
    let rest = robot.rest(killed);
    // Three seconds; a socket's queue on a busy machine may lose some.
    assert!(rest.len() > 1000, "{} datagrams after the end", rest.len());
    let damping = damping();
    assert!(rest.iter().all(|datagram| *datagram == damping));
}

#[test]
fn a_robot_whose_console_ends_in_order_hears_nothing_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::start();
    let mut session = controlling(folder.path(), &robot);
    session.signal(Signal::SIGTERM);
    assert!(session.wait().success());
    let ended = robot.count();
    // What was sent before may still wait in the socket.
    let rest = robot.rest(ended);
    assert!(rest.len() < 100, "{} datagrams after the end", rest.len());
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
        (damping(), "", 0),
        (damping(), "+-", 0),
        (spoilt, "+", 2),
        (damping()[..600].to_vec(), "", 2),
        (b"quadfrog\n".to_vec(), "", 2),
    ] {
        let output = guard(&[&given, after.as_bytes()].concat(), socket.try_clone().unwrap());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{after:?}: {said}");
        assert_eq!(said.contains("is no command"), status == 2, "{said}");
    }
    assert_eq!(robot.rest(0), Vec::<Vec<u8>>::new());
}
