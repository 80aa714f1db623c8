//! The guard: a second process that damps the robot, over a shared socket or its own DDS writer, when the heartbeat of this
//! process stops.
//!
//! A control thread that ends sends damping, also after a panic. A process that is killed or stopped sends nothing, and the
//! robot's reaction to silence is not established (`robots/go1/README.md`). The guard holds one command, and the control
//! thread sends it a heartbeat every few ticks. Without heartbeats, and after a suspension of the computer, the guard damps
//! a commanded robot. It stops when they resume, because the control thread then finds itself late, or the computer
//! suspended, and damps the robot.
//!
//! The guard answers every heartbeat, so that a stopped guard is noticed: without answers the robot lands and sits down
//! (`src/control/failsafe.rs`), and nothing energises it.
//!
//! On the connection to the guard: the length of [`GuardOrders`] (two bytes, little endian), these as JSON, then the heartbeats,
//! [`COMMANDED`] or [`LEFT_ALONE`]. On the connection from the guard: one byte after each read of heartbeats.

use std::io::{ErrorKind, Read, Write};
use std::net::UdpSocket;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::control::settings::ControlSettings;
use crate::realtime::clock::{SuspendWatch, suspended_ns};
use crate::robot::hardware::DampingRoute;

/// Argument that runs the program as the guard.
pub const GUARD: &str = "guard";
const COMMANDED: u8 = b'+';
const LEFT_ALONE: u8 = b'-';
const ANSWER: u8 = b'!';
/// Ticks between two heartbeats to the guard.
const HEARTBEAT_TICKS: u32 = 10;
/// Silence of the control thread that is allowed beyond its own limit for late ticks, ms: several heartbeats.
const ALLOWED_SILENCE_MS: f64 = 50.0;
/// Allowed silence where late ticks have no limit, ms.
const LONGEST_ALLOWED_SILENCE_MS: f64 = 1000.0;
/// Damping commands, one per millisecond, after the pipe has ended: several times the duration of sinking.
const DAMPINGS: u32 = 3000;
/// Longest time to the first answer of a guard that starts, ms: it loads the program and locks its memory.
const LONGEST_START_MS: u32 = 5000;
/// Suspension of the computer after which the guard damps, ms; as `watchdog.suspended_ms` of `config/safety.toml`.
const SUSPENDED_MS: u32 = 50;
/// Longest duration of these commands, ms: each one is followed by a pause of a millisecond, which a loaded computer prolongs.
const LONGEST_DAMPING_MS: u32 = 10_000;
/// Least damping that the guard accepts, N m s/rad: less does not carry the robot down softly.
const LEAST_DAMPING: f32 = 1.0;

/// State of the guard process as the engine sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GuardState {
    /// It has not answered yet.
    Starting,
    /// It answers the heartbeats.
    Answering,
    /// It does not answer: it is stopped, or has no processor time.
    Silent,
    /// It has exited, or the connection to it is broken.
    Gone,
}

/// Findings of the control thread about the guard.
#[derive(Debug, Default)]
struct GuardFindings {
    broken: AtomicBool,
    /// It has answered once.
    answered: AtomicBool,
    silent_ms: AtomicU32,
    /// The robot was left to it at the end.
    has_robot: AtomicBool,
}

/// The guard process, seen from the engine.
#[derive(Debug)]
pub struct Guard {
    process: Child,
    findings: Arc<GuardFindings>,
    allowed_silent_ms: u32,
    gone: bool,
}

/// The control thread's end of the connection. Dropped without [`GuardHeartbeat::release`], as when the process ends, it makes the guard
/// damp the robot.
#[derive(Debug)]
pub struct GuardHeartbeat {
    connection: UnixStream,
    findings: Arc<GuardFindings>,
    commanded: bool,
    ticks: u32,
    /// Ticks since the last answer that were followed by a heartbeat.
    silent_ms: u32,
}

/// Orders to the guard; on the connection as JSON, after its length in bytes (two bytes, little endian).
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GuardOrders {
    /// Longest silence of the control thread, ms.
    pub silence_ms: u16,
    /// Command that damps the robot, and its way to the robot.
    pub damping: DampingRoute,
}

impl Guard {
    /// Starts `program guard`, which damps the robot as `damping` says, where that needs one over `socket`.
    pub fn start(
        program: &Path,
        (damping, socket): (DampingRoute, Option<UdpSocket>),
        settings: &ControlSettings,
    ) -> std::io::Result<(Guard, GuardHeartbeat)> {
        let allowed_ms = if settings.late_ms > 0.0 {
            2.0 * settings.late_ms + ALLOWED_SILENCE_MS
        } else {
            LONGEST_ALLOWED_SILENCE_MS
        };
        let (theirs, mut connection) = UnixStream::pair()?;
        let orders = serde_json::to_vec(&GuardOrders { silence_ms: allowed_ms as u16, damping })?;
        let process = Command::new(program)
            .arg0("quadfrog-guard")
            .arg(GUARD)
            .stdin(OwnedFd::from(theirs))
            .stdout(socket.map_or_else(Stdio::null, |socket| Stdio::from(OwnedFd::from(socket))))
            .stderr(Stdio::inherit())
            // Signals of the terminal must not reach the guard.
            .process_group(0)
            .spawn()?;
        connection.write_all(&(orders.len() as u16).to_le_bytes())?;
        connection.write_all(&orders)?;
        let heartbeat = GuardHeartbeat::new(connection)?;
        let allowed_silent_ms = settings.failsafe.guard_silent_ms;
        Ok((Guard { process, findings: heartbeat.findings.clone(), allowed_silent_ms, gone: false }, heartbeat))
    }

    /// Returns the present state. A guard whose connection is broken is killed so that it does not start damping.
    pub fn state(&mut self) -> GuardState {
        let broken = self.findings.broken.load(Ordering::Acquire);
        if broken && !self.gone {
            // An error means that it has exited already.
            let _ = self.process.kill();
        }
        self.gone |= broken || self.process.try_wait().is_ok_and(|status| status.is_some());
        if self.gone {
            GuardState::Gone
        } else if self.findings.silent_ms.load(Ordering::Acquire) > self.allowed_silent_ms {
            GuardState::Silent
        } else if !self.findings.answered.load(Ordering::Acquire) {
            GuardState::Starting
        } else {
            GuardState::Answering
        }
    }

    /// Ends the guard, also a stopped one; to be called after the last command. A guard that the robot was left to damps it first.
    pub fn end(mut self) {
        if self.findings.has_robot.load(Ordering::Acquire) {
            let is_damping = |process: &mut Child| process.try_wait().is_ok_and(|status| status.is_none());
            let mut waited_ms = 0;
            while waited_ms < LONGEST_DAMPING_MS && is_damping(&mut self.process) {
                std::thread::sleep(Duration::from_millis(1));
                waited_ms += 1;
            }
        }
        // An error means that it has exited already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl GuardHeartbeat {
    /// The heartbeats to a guard that starts at the other end of `connection`.
    ///
    /// # Errors
    /// The connection cannot be made non-blocking.
    pub fn new(connection: UnixStream) -> std::io::Result<GuardHeartbeat> {
        connection.set_nonblocking(true)?;
        let findings = Arc::default();
        Ok(GuardHeartbeat { connection, findings, commanded: false, ticks: 0, silent_ms: 0 })
    }

    /// Counts a tick, or a datagram that is sent without one, and sends a heartbeat when it is due. Returns the time for
    /// which the guard has not answered, ms; `u32::MAX` when it is gone. Neither blocks nor allocates.
    pub fn count_tick(&mut self, commanded: bool) -> u32 {
        self.ticks += 1;
        if self.ticks >= HEARTBEAT_TICKS || commanded != self.commanded {
            self.listen();
            self.send(commanded);
        }
        if self.findings.broken.load(Ordering::Relaxed) { u32::MAX } else { self.reported_ms() }
    }

    /// Whether the last heartbeat reported the robot as commanded.
    pub const fn commanded(&self) -> bool {
        self.commanded
    }

    /// Reports to the guard that the robot is not commanded any more.
    pub fn release(mut self) {
        self.send(false);
    }

    /// Leaves a robot that the commands of this program do not reach to the guard, which damps it.
    pub fn leave_robot(self) {
        self.findings.has_robot.store(true, Ordering::Release);
    }

    /// Time without an answer, ms; the time that a guard needs to start is not counted.
    fn reported_ms(&self) -> u32 {
        if self.findings.answered.load(Ordering::Relaxed) || self.silent_ms > LONGEST_START_MS {
            self.silent_ms
        } else {
            0
        }
    }

    /// Takes the answers to the heartbeats before. Ticks are counted, not the time: a control thread that was delayed
    /// makes up for its ticks at once, and sends no more heartbeats than they demand.
    fn listen(&mut self) {
        let mut answers = [0; 64];
        match self.connection.read(&mut answers) {
            Ok(0) => self.findings.broken.store(true, Ordering::Release),
            Ok(_) => {
                self.silent_ms = 0;
                self.findings.answered.store(true, Ordering::Release);
            }
            Err(_) => self.silent_ms = self.silent_ms.saturating_add(self.ticks),
        }
        self.findings.silent_ms.store(self.reported_ms(), Ordering::Release);
    }

    fn send(&mut self, commanded: bool) {
        (self.ticks, self.commanded) = (0, commanded);
        let byte = if commanded { COMMANDED } else { LEFT_ALONE };
        match self.connection.write_all(&[byte]) {
            // Full after some 280 heartbeats: a stopped guard does not read them. It does not answer either.
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.findings.broken.store(true, Ordering::Release),
            Ok(()) => {}
        }
    }
}

/// Invalid input of a guard, for example of one that was started by hand.
#[derive(Debug, thiserror::Error)]
#[error("quadfrog starts the guard itself; its input is not a valid command ({reason})")]
pub struct GuardError {
    reason: String,
}

/// End of a guard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GuardOutcome {
    /// The robot was not commanded at the end.
    Quiet,
    /// The connection ended while the robot was commanded.
    Damped {
        /// Damping datagrams since then.
        sent: u32,
    },
}

/// Runs the guard until `connection` ends. `socket` is its standard output, which only a Go1's damping uses.
///
/// # Errors
/// The input is no guard's, its command does not damp, or the way to the robot cannot be opened.
pub fn run_guard(connection: impl Read + Write + AsFd, socket: UdpSocket) -> Result<GuardOutcome, GuardError> {
    let mut watch = SuspendWatch::default();
    run_guard_with(connection, socket, || suspended_ns().map_or(0, |bounds| watch.observe(bounds)))
}

/// As [`run_guard`]; `suspended_ms` returns the time for which the computer was suspended since its last call, ms. It is called
/// once after each wait for heartbeats.
///
/// # Errors
/// As [`run_guard`].
pub fn run_guard_with(
    mut connection: impl Read + Write + AsFd,
    socket: UdpSocket,
    mut suspended_ms: impl FnMut() -> u32,
) -> Result<GuardOutcome, GuardError> {
    let orders = read_orders(&mut connection)?;
    let silence = PollTimeout::from(orders.silence_ms);
    let opened = orders.damping.open(socket, LEAST_DAMPING);
    let mut send = opened.map_err(|error| GuardError { reason: error.to_string() })?;
    // An answer that does not fit is left out; the guard never waits for the console. A pipe takes no answers.
    let _ = fcntl(&connection, FcntlArg::F_SETFL(OFlag::O_NONBLOCK));
    let (mut timeout, mut signs) = (PollTimeout::NONE, [0; 64]);
    loop {
        let woken = poll(&mut [PollFd::new(connection.as_fd(), PollFlags::POLLIN)], timeout);
        // The heartbeats until then were sent before the suspension.
        let resumed = suspended_ms() > SUSPENDED_MS && timeout != PollTimeout::NONE;
        match woken {
            Err(nix::Error::EINTR) => {}
            // Silence: a command now, and one every millisecond until the next heartbeat.
            Ok(0) => {
                let _ = send();
                timeout = PollTimeout::from(1_u16);
            }
            // After an error of poll, the read returns the state of the connection.
            Ok(_) | Err(_) => match connection.read(&mut signs) {
                Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::WouldBlock) => {}
                // A connection that cannot be read has ended.
                Ok(0) | Err(_) => break,
                Ok(count) => {
                    let _ = connection.write(&[ANSWER]);
                    timeout = if signs[count - 1] == COMMANDED { silence } else { PollTimeout::NONE };
                }
            },
        }
        if resumed {
            let _ = send();
            timeout = PollTimeout::from(1_u16);
        }
    }
    if timeout == PollTimeout::NONE {
        return Ok(GuardOutcome::Quiet);
    }
    let mut sent = 0;
    for _ in 0..DAMPINGS {
        // A lost command is followed by the next.
        sent += u32::from(send().is_ok());
        // Slept, not paced: the clock may be what failed.
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(GuardOutcome::Damped { sent })
}

fn read_orders(connection: &mut impl Read) -> Result<GuardOrders, GuardError> {
    let refused = |reason: &dyn ToString| GuardError { reason: reason.to_string() };
    let mut length = [0; 2];
    connection.read_exact(&mut length).map_err(|error| refused(&error))?;
    let mut orders = vec![0; usize::from(u16::from_le_bytes(length))];
    connection.read_exact(&mut orders).map_err(|error| refused(&error))?;
    serde_json::from_slice(&orders).map_err(|error| refused(&error))
}
