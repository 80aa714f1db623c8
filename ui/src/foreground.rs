//! Whether the terminal is the console's, or a shell's that stopped the console or runs it in the background.
//!
//! A process in the background that reads from its terminal or changes its mode is stopped by the system (termios(3), SIGTTIN and
//! SIGTTOU), with a robot that nothing commands any more.

use std::io;

use nix::sys::termios::{Termios, tcgetattr};
use nix::unistd::{getpgrp, tcgetpgrp};

/// Whether this process has the terminal; also where nothing says so, for example without a controlling terminal.
pub fn in_foreground() -> bool {
    tcgetpgrp(io::stdin()).map_or(true, |group| group == getpgrp())
}

/// Returns the terminal's present mode; none where it cannot be read.
pub fn mode() -> Option<Termios> {
    tcgetattr(io::stdin()).ok()
}
