//! `quadfrog guard`, which a console with a robot starts by itself: its standard input is the pipe from the console, its standard
//! output the robot's socket.

use std::fs::File;
use std::io::{IsTerminal, Write};
use std::net::UdpSocket;
use std::os::fd::AsFd;

use color_eyre::eyre::WrapErr;
use nix::sys::signal::{SigSet, Signal};
use nix::unistd::dup2_stdout;
use quadfrog::engine::{Watch, stand_guard};
use quadfrog::realtime::scheduling::Scheduling;

use super::Failure;

pub fn run() -> Result<(), Failure> {
    let pipe = std::io::stdin();
    if pipe.is_terminal() {
        return Err(Failure::input(
            "guard: quadfrog starts it by itself where it drives a robot; there is nothing to type",
        ));
    }
    // Who ends the console by its name, or its terminal, shall not end its guard as well.
    let ignored = SigSet::from_iter([Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGTTOU]);
    ignored.thread_block().wrap_err("signals cannot be blocked")?;
    // Not through the standard library's output, which would cut the datagram at what looks like the end of a line; and nothing
    // that is printed must ever reach the robot.
    let socket = UdpSocket::from(std::io::stdout().as_fd().try_clone_to_owned().wrap_err("no standard output")?);
    let nowhere = File::options().write(true).open("/dev/null").wrap_err("/dev/null")?;
    dup2_stdout(nowhere).wrap_err("the standard output")?;
    // Whatever makes the console die of hunger must not keep its guard from the processor or on a disk; what is not granted has
    // been said by the console.
    let _granted = Scheduling { priority: 1, core: None, lock_memory: true }.apply();
    // Without the library's buffer: what it had read ahead could not be waited for.
    let watch = stand_guard(File::from(pipe.as_fd().try_clone_to_owned().wrap_err("no standard input")?), &socket);
    // The port is free again, however long the terminal takes for the last words.
    drop(socket);
    match watch.map_err(Failure::input)? {
        Watch::Quiet => {}
        Watch::Damped { sent } => {
            let words = match sent {
                0 => "damping could not be sent to the robot: cut its power".to_owned(),
                _ => format!("the robot was damped, {sent} times"),
            };
            // The terminal may be gone, or as raw as the console left it.
            let _ = write!(
                std::io::stderr(),
                "\r\nquadfrog guard: the console ended without a word; {words}. `reset` mends the terminal.\r\n"
            );
        }
    }
    Ok(())
}
