//! `quadfrog guard`: the process that a console with a robot starts to damp it if the console ends. Standard input is the
//! pipe from the console, standard output the socket of a Go1.

use std::fs::File;
use std::io::{IsTerminal, Write};
use std::net::UdpSocket;
use std::os::fd::AsFd;

use anyhow::Context;
use nix::sys::signal::{SigSet, Signal};
use nix::unistd::dup2_stdout;
use quadfrog::engine::{GuardOutcome, run_guard};
use quadfrog::realtime::scheduling::Scheduling;

use super::failure::Failure;

pub fn run() -> Result<(), Failure> {
    let pipe = std::io::stdin();
    if pipe.is_terminal() {
        return Err(Failure::input("guard: quadfrog starts it when it drives a robot; do not start it by hand"));
    }
    // Signals that end the console by name, or come from its terminal, must not end the guard.
    let ignored = SigSet::from_iter([Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGTTOU]);
    ignored.thread_block().context("blocking signals")?;
    // The buffered standard output would split a datagram at a line feed, and no printed text may reach the robot.
    let socket = UdpSocket::from(std::io::stdout().as_fd().try_clone_to_owned().context("standard output")?);
    let null = File::options().write(true).open("/dev/null").context("/dev/null")?;
    dup2_stdout(null).context("standard output")?;
    // Real-time priority and locked memory: CPU or memory starvation of the console must not delay the guard. The console
    // has reported denied settings.
    let _granted = Scheduling { priority: 1, core: None, lock_memory: true }.apply();
    // Unbuffered: poll(2) does not report bytes that a buffer has read ahead.
    let watch = run_guard(File::from(pipe.as_fd().try_clone_to_owned().context("standard input")?), socket);
    if let GuardOutcome::Damped { sent } = watch.map_err(Failure::input)? {
        let result = match sent {
            0 => "damping could not be sent to the robot: cut its power".to_owned(),
            _ => format!("the robot was damped, {sent} times"),
        };
        // The terminal may be gone, or still in raw mode.
        let _ = write!(
            std::io::stderr(),
            "\r\nquadfrog guard: the console ended unexpectedly; {result}. `reset` restores the terminal.\r\n"
        );
    }
    Ok(())
}
