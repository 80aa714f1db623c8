//! The program `quadfrog`.
//!
//! Exit status: 0 when done, 2 for unusable input (the message names it and the remedy), 1 for every other error.

mod subcommand;

use std::process::ExitCode;

use clap::Parser;
use subcommand::{Arguments, Failure};

fn main() -> ExitCode {
    if let Err(error) = color_eyre::install() {
        eprintln!("quadfrog: {error}");
    }
    let Err(failure) = subcommand::run(Arguments::parse()) else { return ExitCode::SUCCESS };
    failure.print();
    match failure {
        Failure::Input(_) => ExitCode::from(2),
        Failure::Other(_) => ExitCode::FAILURE,
    }
}
