//! The guard: a second process that shares the robot's socket and damps the robot when this one is no more.
//!
//! However a program ends that can still act, the control thread's last word is damping. One that is killed has no last word,
//! and what a robot does that hears no more is not established (`robots/go1/README.md`). The guard knows one datagram and
//! whether the robot is commanded. It hears of the end from the system, which closes the pipe between the two.
//!
//! On the pipe: the damping datagram, then a byte for every change, [`COMMANDED`] or [`LEFT_ALONE`].

use std::io::{Read, Write};
use std::net::UdpSocket;
use std::ops::ControlFlow;
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::control::settings::PERIOD_S;
use crate::realtime::thread::pace;
use crate::robot::go1::Go1;
use crate::robot::go1::packet::{COMMAND_LENGTH, CrcForm, LowCmd};

/// The argument with which the program stands guard.
pub const GUARD: &str = "guard";
const COMMANDED: u8 = b'+';
const LEFT_ALONE: u8 = b'-';
/// For how many milliseconds, and datagrams, the robot is damped: as long as it needs to sink, several times over.
const DAMPINGS: u32 = 3000;

/// This process's end. Dropped without [`Guard::dismiss`], as in a panic, it lets the guard do its work.
#[derive(Debug)]
pub struct Guard {
    process: Child,
    commanded: bool,
    gone: bool,
}

impl Guard {
    /// Starts `program guard` over `robot`, whose joints it would damp with `damping_kd`, N m s/rad.
    ///
    /// # Errors
    /// When the process cannot be started, or no datagram can say such a damping.
    pub fn post(program: &Path, robot: &Go1, damping_kd: f64) -> std::io::Result<Guard> {
        let (socket, damping) = (robot.socket()?, robot.damping(damping_kd).map_err(std::io::Error::other)?);
        let mut process = Command::new(program)
            .arg0("quadfrog-guard")
            .arg(GUARD)
            .stdin(Stdio::piped())
            .stdout(OwnedFd::from(socket))
            // What the terminal does to the console's processes is not meant for it.
            .process_group(0)
            .spawn()?;
        if let Some(pipe) = &mut process.stdin {
            pipe.write_all(damping.bytes())?;
        }
        Ok(Guard { process, commanded: false, gone: false })
    }

    /// Tells it whether the robot is commanded; to be called often. False once, when the guard is found to be gone.
    #[must_use]
    pub fn tell(&mut self, commanded: bool) -> bool {
        if self.gone {
            return true;
        }
        let ended = self.process.try_wait().is_ok_and(|status| status.is_some());
        self.gone = ended || commanded != self.commanded && !self.write(commanded);
        self.commanded = commanded;
        !self.gone
    }

    /// The robot is left alone from now on; to be called after the last command.
    pub fn dismiss(mut self) {
        self.write(false);
        self.process.stdin = None;
        // One that has ended by itself was missed before.
        let _ = self.process.wait();
    }

    /// Whether it could be told. One byte always fits into the pipe of a process that reads.
    fn write(&mut self, commanded: bool) -> bool {
        let byte = if commanded { COMMANDED } else { LEFT_ALONE };
        self.process.stdin.as_mut().is_some_and(|pipe| pipe.write_all(&[byte]).is_ok())
    }
}

/// Why a guard cannot stand.
#[derive(Debug, thiserror::Error)]
pub enum GuardError {
    /// What the first process sent is not the command to damp.
    #[error(
        "the guard is a process that quadfrog starts by itself: what it was given to send is no command ({reason})"
    )]
    NoCommand {
        /// What is wrong.
        reason: String,
    },
    /// The monotonic clock cannot be waited on.
    #[error("the monotonic clock: {0}")]
    Clock(#[from] nix::Error),
}

/// The guard's whole life: `pipe` is read until it ends, and if the robot was commanded then, it is damped through `socket`. True
/// if so.
///
/// # Errors
/// When what is to be sent is no command, or the clock cannot be waited on.
pub fn stand(mut pipe: impl Read, socket: &UdpSocket) -> Result<bool, GuardError> {
    let mut damping = [0; COMMAND_LENGTH];
    pipe.read_exact(&mut damping).map_err(|error| GuardError::NoCommand { reason: error.to_string() })?;
    // Nothing leaves this machine that the packets' own rules refuse.
    LowCmd::judge(&damping, CrcForm::Plain)
        .or_else(|_| LowCmd::judge(&damping, CrcForm::Sealed))
        .map_err(|rejection| GuardError::NoCommand { reason: rejection.to_string() })?;
    let (mut commanded, mut byte) = (false, [0]);
    // A pipe that cannot be read is one that has ended.
    while pipe.read_exact(&mut byte).is_ok() {
        commanded = byte[0] == COMMANDED;
    }
    if !commanded {
        return Ok(false);
    }
    let mut sent = 0;
    pace(Duration::from_secs_f64(PERIOD_S), Duration::ZERO, |_| {
        // One that is lost is followed by the next.
        let _ = socket.send(&damping);
        sent += 1;
        if sent == DAMPINGS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    Ok(true)
}
