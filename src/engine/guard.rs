//! The guard: a second process that shares the robot's socket and damps the robot when the heartbeat of this process stops.
//!
//! A control thread that ends sends damping, also after a panic. A process that is killed or stopped sends nothing, and the
//! robot's reaction to silence is not established (`robots/go1/README.md`). The guard holds one datagram, and the control
//! thread sends it a heartbeat every few ticks. Without heartbeats the guard damps a commanded robot. It stops when they
//! resume, because the control thread then finds itself late and damps the robot.
//!
//! On the pipe: the damping datagram, the longest silence in ms (two bytes, little endian), then the heartbeats, [`COMMANDED`]
//! or [`LEFT_ALONE`].

use std::fs::File;
use std::io::{Read, Write};
use std::net::UdpSocket;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::control::settings::ControlSettings;
use crate::robot::go1::Go1;
use crate::robot::go1::packet::{COMMAND_LENGTH, CrcForm, LowCmd};

/// Argument that runs the program as the guard.
pub const GUARD: &str = "guard";
const COMMANDED: u8 = b'+';
const LEFT_ALONE: u8 = b'-';
/// Ticks between two heartbeats to the guard.
const HEARTBEAT_TICKS: u32 = 10;
/// Silence of the control thread that is allowed beyond its own limit for late ticks, ms: several heartbeats.
const ALLOWED_SILENCE_MS: f64 = 50.0;
/// Allowed silence where late ticks have no limit, ms.
const LONGEST_ALLOWED_SILENCE_MS: f64 = 1000.0;
/// Damping datagrams, one per millisecond, after the pipe has ended: several times the duration of sinking.
const DAMPINGS: u32 = 3000;

/// The guard process, seen from the engine.
#[derive(Debug)]
pub struct Guard {
    process: Child,
    broken: Arc<AtomicBool>,
    gone: bool,
}

/// The control thread's end of the pipe. Dropped without [`GuardHeartbeat::release`], as when the process ends, it makes the guard damp the
/// robot.
#[derive(Debug)]
pub struct GuardHeartbeat {
    pipe: File,
    broken: Arc<AtomicBool>,
    commanded: bool,
    ticks: u32,
}

impl Guard {
    /// Starts `program guard` over `robot`.
    pub fn start(program: &Path, robot: &Go1, settings: &ControlSettings) -> std::io::Result<(Guard, GuardHeartbeat)> {
        let (socket, damping) = (robot.socket()?, robot.damping(settings.gate.damping_kd));
        let damping = damping.map_err(std::io::Error::other)?;
        let allowed_ms = if settings.late_ms > 0.0 {
            2.0 * settings.late_ms + ALLOWED_SILENCE_MS
        } else {
            LONGEST_ALLOWED_SILENCE_MS
        };
        let (theirs, ours) = std::io::pipe()?;
        let process = Command::new(program)
            .arg0("quadfrog-guard")
            .arg(GUARD)
            .stdin(theirs)
            .stdout(OwnedFd::from(socket))
            .stderr(Stdio::inherit())
            // Signals of the terminal must not reach the guard.
            .process_group(0)
            .spawn()?;
        let mut pipe = File::from(OwnedFd::from(ours));
        pipe.write_all(damping.bytes())?;
        pipe.write_all(&(allowed_ms as u16).to_le_bytes())?;
        fcntl(&pipe, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        let broken = Arc::<AtomicBool>::default();
        let guard = Guard { process, broken: broken.clone(), gone: false };
        Ok((guard, GuardHeartbeat { pipe, broken, commanded: false, ticks: 0 }))
    }

    /// Returns true once, when the guard has exited or its pipe is broken. A guard with a broken pipe is killed so that it does
    /// not start damping.
    pub fn lost(&mut self) -> bool {
        if self.gone {
            return false;
        }
        let broken = self.broken.load(Ordering::Acquire);
        if broken {
            // An error means that it has exited already.
            let _ = self.process.kill();
        }
        self.gone = broken || self.process.try_wait().is_ok_and(|status| status.is_some());
        self.gone
    }

    /// Kills the guard, also a stopped one; to be called after the last command.
    pub fn end(mut self) {
        // An error means that it has exited already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl GuardHeartbeat {
    /// Counts a tick, or a datagram that is sent without one, and sends a heartbeat when it is due. Neither blocks nor
    /// allocates.
    pub fn tick(&mut self, commanded: bool) {
        self.ticks += 1;
        if self.ticks == HEARTBEAT_TICKS || commanded != self.commanded {
            self.send(commanded);
        }
    }

    /// Tells the guard that the robot is not commanded any more.
    pub fn release(mut self) {
        self.send(false);
    }

    fn send(&mut self, commanded: bool) {
        (self.ticks, self.commanded) = (0, commanded);
        let byte = if commanded { COMMANDED } else { LEFT_ALONE };
        if self.pipe.write_all(&[byte]).is_err() {
            self.broken.store(true, Ordering::Release);
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
    /// The pipe ended while the robot was commanded.
    Damped {
        /// Damping datagrams since then.
        sent: u32,
    },
}

/// Runs the guard until `pipe` ends.
pub fn run_guard(mut pipe: impl Read + AsFd, socket: &UdpSocket) -> Result<GuardOutcome, GuardError> {
    let refused = |reason: &dyn ToString| GuardError { reason: reason.to_string() };
    let (mut damping, mut silence_ms) = ([0; COMMAND_LENGTH], [0; 2]);
    pipe.read_exact(&mut damping).map_err(|error| refused(&error))?;
    pipe.read_exact(&mut silence_ms).map_err(|error| refused(&error))?;
    // The guard sends only datagrams that pass the checks of the packets.
    LowCmd::parse(&damping, CrcForm::Plain)
        .or_else(|_| LowCmd::parse(&damping, CrcForm::Transformed))
        .map_err(|rejection| refused(&rejection))?;
    let silence = PollTimeout::from(u16::from_le_bytes(silence_ms));
    let (mut timeout, mut signs) = (PollTimeout::NONE, [0; 64]);
    loop {
        match poll(&mut [PollFd::new(pipe.as_fd(), PollFlags::POLLIN)], timeout) {
            Err(nix::Error::EINTR) => continue,
            // Silence: a datagram now, and one every millisecond until the next heartbeat.
            Ok(0) => {
                let _ = socket.send(&damping);
                timeout = PollTimeout::from(1_u16);
            }
            // After an error of poll, the read tells the state of the pipe.
            Ok(_) | Err(_) => match pipe.read(&mut signs) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                // A pipe that cannot be read has ended.
                Ok(0) | Err(_) => break,
                Ok(count) => timeout = if signs[count - 1] == COMMANDED { silence } else { PollTimeout::NONE },
            },
        }
    }
    if timeout == PollTimeout::NONE {
        return Ok(GuardOutcome::Quiet);
    }
    let mut sent = 0;
    for _ in 0..DAMPINGS {
        // A lost datagram is followed by the next.
        sent += u32::from(socket.send(&damping).is_ok());
        // Slept, not paced: the clock may be what failed.
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(GuardOutcome::Damped { sent })
}
