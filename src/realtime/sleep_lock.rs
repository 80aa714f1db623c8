//! The sleep inhibitor lock of systemd: while it is held, the computer does not suspend by itself or on a closed lid
//! (systemd-inhibit(1)). A request only: without systemd, or without the right, the robot is controlled all the same, and a
//! suspension is a fault.

use std::io;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// The program that holds the lock for as long as its child runs.
pub const INHIBITOR: &str = "systemd-inhibit";
/// Remedy where there is no lock.
pub const ALLOW_INHIBITOR: &str =
    "switch automatic suspension off, for example `sudo systemctl mask sleep.target suspend.target`";

/// A held sleep lock, released when dropped, or when this process ends in any way.
#[derive(Debug)]
pub struct SleepLock {
    process: Child,
    lost: bool,
}

impl SleepLock {
    /// Whether systemd runs (sd_booted(3)).
    pub fn available() -> bool {
        Path::new("/run/systemd/system").is_dir()
    }

    /// Requests the lock with `program`; does not wait for the answer.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn take(program: &Path) -> io::Result<SleepLock> {
        let process = Command::new(program)
            .args(["--what=sleep:idle:handle-lid-switch", "--mode=block", "--who=quadfrog"])
            .args(["--why=drives a robot", "cat"])
            // `cat`, and with it the lock, ends with this pipe.
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // Signals of the terminal must not reach it.
            .process_group(0)
            .spawn()?;
        Ok(SleepLock { process, lost: false })
    }

    /// Returns true once, when the lock was refused or has ended.
    pub fn lost(&mut self) -> bool {
        let ended = !self.lost && self.process.try_wait().is_ok_and(|status| status.is_some());
        self.lost |= ended;
        ended
    }
}

impl Drop for SleepLock {
    fn drop(&mut self) {
        // Closed first: a killed inhibitor leaves its child, which ends with the pipe.
        drop(self.process.stdin.take());
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
