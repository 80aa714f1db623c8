//! Whether the terminal is the console's, or a shell's that stopped the console or runs it in the background.
//!
//! A process in the background that reads from its terminal or changes its mode is stopped by the system (termios(3), SIGTTIN and
//! SIGTTOU), with a robot that nothing commands any more.

use std::io;

use nix::sys::termios::{Termios, tcgetattr};
use nix::unistd::{Pid, getpgid, getpgrp, getppid, getsid, tcgetpgrp};

/// Reason for which a console without a shell is not suspended.
pub const NO_SHELL: &str = "not suspended: there is no shell to continue it; quit instead";

/// Whether this process has the terminal; also where nothing says so, for example without a controlling terminal.
pub fn in_foreground() -> bool {
    tcgetpgrp(io::stdin()).map_or(true, |group| group == getpgrp())
}

/// Returns the terminal's present mode; none where it cannot be read.
pub fn mode() -> Option<Termios> {
    tcgetattr(io::stdin()).ok()
}

/// Whether a shell can continue this process once it is stopped: a process of the session, outside of the process group, that has
/// started the group. POSIX calls a group without one orphaned (POSIX.1-2024, 3.264).
pub fn has_shell() -> bool {
    let mut parent = getppid();
    // Parents in the group itself stop with it.
    while getpgid(Some(parent)) == Ok(getpgrp()) {
        match parent_of(parent) {
            Some(above) => parent = above,
            None => return false,
        }
    }
    getsid(Some(parent)).is_ok_and(|session| getsid(None) == Ok(session))
}

/// Returns the parent of a process (proc_pid_stat(5)); none where it cannot be read.
fn parent_of(process: Pid) -> Option<Pid> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name of the program, in parentheses, may hold spaces and parentheses.
    let (_, behind_name) = stat.rsplit_once(')')?;
    behind_name.split_whitespace().nth(1)?.parse().ok().map(Pid::from_raw)
}
