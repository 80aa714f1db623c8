//! The program `quadfrog`: arguments, configuration, engine or player, console, exit status.
//!
//! Exit status: 0 when done, 2 for input that cannot be used (with a message that says which and what to do), 1 for
//! everything else.

mod command;

use std::process::ExitCode;

use clap::Parser;
use command::{Arguments, Failure};

fn main() -> ExitCode {
    if let Err(error) = color_eyre::install() {
        eprintln!("quadfrog: {error}");
    }
    match command::run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(message)) => {
            eprintln!("quadfrog: {message}");
            ExitCode::from(2)
        }
        Err(Failure::Other(report)) => {
            eprintln!("quadfrog: {report:?}");
            ExitCode::FAILURE
        }
    }
}
