//! `quadfrog guard`, which a console with a robot starts by itself: its standard input is the pipe from the console, its standard
//! output the robot's socket.

use std::io::Write;
use std::net::UdpSocket;
use std::os::fd::AsFd;

use color_eyre::eyre::WrapErr;
use nix::sys::signal::{SigSet, Signal};
use quadfrog::engine::{GuardError, stand_guard};

use super::Failure;

pub fn run() -> Result<(), Failure> {
    // Who ends the console by its name, or its terminal, shall not end its guard as well.
    let ignored = SigSet::from_iter([Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGTTOU]);
    ignored.thread_block().wrap_err("signals cannot be blocked")?;
    // Not through the standard library's output: it would cut the datagram at what looks like the end of a line.
    let socket = std::io::stdout().as_fd().try_clone_to_owned().wrap_err("no standard output")?;
    match stand_guard(std::io::stdin().lock(), &UdpSocket::from(socket)) {
        Ok(damped) => {
            if damped {
                // The terminal may be gone, or as raw as the console left it.
                let _ = write!(
                    std::io::stderr(),
                    "\r\nquadfrog guard: the console was killed; the robot was damped. `reset` mends the terminal.\r\n"
                );
            }
            Ok(())
        }
        Err(error @ GuardError::NoCommand { .. }) => Err(Failure::input(error)),
        Err(error) => Err(Failure::Other(error.into())),
    }
}
