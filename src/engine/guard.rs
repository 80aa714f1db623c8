//! The guard: a second process that shares the robot's socket and damps the robot when this one falls silent.
//!
//! However a program ends that can still act, the control thread's last word is damping. One that is killed or stopped has no last
//! word, and what a robot does that hears no more is not established (`robots/go1/README.md`). The guard knows one datagram, and
//! the control thread gives it a sign of life every few ticks. It damps while none comes and the robot was commanded; it stops
//! when one comes again, for then the control thread acts: it finds itself late, and cuts.
//!
//! On the pipe: the damping datagram, the longest silence in ms (two bytes, little endian), then the signs of life, [`COMMANDED`]
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

/// The argument with which the program stands guard.
pub const GUARD: &str = "guard";
const COMMANDED: u8 = b'+';
const LEFT_ALONE: u8 = b'-';
/// A sign of life is given in every so-manieth tick.
const BEAT_TICKS: u32 = 10;
/// How long the control thread may be silent beyond what its own watchdog allows, ms: some signs of life.
const PATIENCE_MS: f64 = 50.0;
/// The same where its watchdog allows everything, ms.
const LONGEST_PATIENCE_MS: f64 = 1000.0;
/// For how many milliseconds, and datagrams, the robot is damped once the pipe has ended: several times as long as it sinks.
const DAMPINGS: u32 = 3000;

/// The process, for who watches over it.
#[derive(Debug)]
pub struct Guard {
    process: Child,
    unheard: Arc<AtomicBool>,
    gone: bool,
}

/// The control thread's end of the pipe. Dropped without [`Lifeline::leave`], as in a panic, it lets the guard do its work.
#[derive(Debug)]
pub struct Lifeline {
    pipe: File,
    unheard: Arc<AtomicBool>,
    commanded: bool,
    ticks: u32,
}

impl Guard {
    /// Starts `program guard` over `robot`.
    ///
    /// # Errors
    /// When the process cannot be started, or no datagram can say the damping of `settings`.
    pub fn post(program: &Path, robot: &Go1, settings: &ControlSettings) -> std::io::Result<(Guard, Lifeline)> {
        let (socket, damping) = (robot.socket()?, robot.damping(settings.gate.damping_kd));
        let damping = damping.map_err(std::io::Error::other)?;
        let allowed_ms =
            if settings.late_ms > 0.0 { 2.0 * settings.late_ms + PATIENCE_MS } else { LONGEST_PATIENCE_MS };
        let (theirs, ours) = std::io::pipe()?;
        let process = Command::new(program)
            .arg0("quadfrog-guard")
            .arg(GUARD)
            .stdin(theirs)
            .stdout(OwnedFd::from(socket))
            .stderr(Stdio::inherit())
            // What the terminal does to the console's processes is not meant for it.
            .process_group(0)
            .spawn()?;
        let mut pipe = File::from(OwnedFd::from(ours));
        pipe.write_all(damping.bytes())?;
        pipe.write_all(&(allowed_ms as u16).to_le_bytes())?;
        fcntl(&pipe, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        let unheard = Arc::<AtomicBool>::default();
        let guard = Guard { process, unheard: unheard.clone(), gone: false };
        Ok((guard, Lifeline { pipe, unheard, commanded: false, ticks: 0 }))
    }

    /// True once, when it is found to have ended, or to listen no more; that one is ended, lest it take a full pipe for silence.
    pub fn lost(&mut self) -> bool {
        if self.gone {
            return false;
        }
        let unheard = self.unheard.load(Ordering::Acquire);
        if unheard {
            // One that has ended already cannot be killed.
            let _ = self.process.kill();
        }
        self.gone = unheard || self.process.try_wait().is_ok_and(|status| status.is_some());
        self.gone
    }

    /// Ends it, also one that is stopped; to be called after the last command.
    pub fn dismiss(mut self) {
        // One that has ended by itself was missed before.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Lifeline {
    /// To be called after every tick, or every datagram that is sent without one: neither blocks nor allocates.
    pub fn tick(&mut self, commanded: bool) {
        self.ticks += 1;
        if self.ticks == BEAT_TICKS || commanded != self.commanded {
            self.tell(commanded);
        }
    }

    /// The robot is left alone from now on.
    pub fn leave(mut self) {
        self.tell(false);
    }

    fn tell(&mut self, commanded: bool) {
        (self.ticks, self.commanded) = (0, commanded);
        let byte = if commanded { COMMANDED } else { LEFT_ALONE };
        if self.pipe.write_all(&[byte]).is_err() {
            self.unheard.store(true, Ordering::Release);
        }
    }
}

/// What the first process sent is not what a guard needs: it was started by hand, perhaps.
#[derive(Debug, thiserror::Error)]
#[error("the guard is a process that quadfrog starts by itself: what it was given to send is no command ({reason})")]
pub struct GuardError {
    reason: String,
}

/// What became of a guard's life.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Watch {
    /// The robot was left alone in the end.
    Quiet,
    /// The pipe ended while the robot was commanded.
    Damped {
        /// How often damping was sent since then.
        sent: u32,
    },
}

/// The guard's whole life, until `pipe` ends.
///
/// # Errors
/// When what is to be sent is no command.
pub fn stand(mut pipe: impl Read + AsFd, socket: &UdpSocket) -> Result<Watch, GuardError> {
    let refused = |reason: &dyn ToString| GuardError { reason: reason.to_string() };
    let (mut damping, mut silence_ms) = ([0; COMMAND_LENGTH], [0; 2]);
    pipe.read_exact(&mut damping).map_err(|error| refused(&error))?;
    pipe.read_exact(&mut silence_ms).map_err(|error| refused(&error))?;
    // Nothing leaves this machine that the packets' own rules refuse.
    LowCmd::judge(&damping, CrcForm::Plain)
        .or_else(|_| LowCmd::judge(&damping, CrcForm::Sealed))
        .map_err(|rejection| refused(&rejection))?;
    let silence = PollTimeout::from(u16::from_le_bytes(silence_ms));
    let (mut timeout, mut signs) = (PollTimeout::NONE, [0; 64]);
    loop {
        match poll(&mut [PollFd::new(pipe.as_fd(), PollFlags::POLLIN)], timeout) {
            Err(nix::Error::EINTR) => continue,
            // Silence: a datagram now, and one every millisecond until there is a sign of life.
            Ok(0) => {
                let _ = socket.send(&damping);
                timeout = PollTimeout::from(1_u16);
            }
            // A pipe that cannot be looked at is read.
            Ok(_) | Err(_) => match pipe.read(&mut signs) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                // A pipe that cannot be read has ended.
                Ok(0) | Err(_) => break,
                Ok(count) => timeout = if signs[count - 1] == COMMANDED { silence } else { PollTimeout::NONE },
            },
        }
    }
    if timeout == PollTimeout::NONE {
        return Ok(Watch::Quiet);
    }
    let mut sent = 0;
    for _ in 0..DAMPINGS {
        // One that is lost is followed by the next.
        sent += u32::from(socket.send(&damping).is_ok());
        // Slept, not paced: the clock may be what failed.
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(Watch::Damped { sent })
}
