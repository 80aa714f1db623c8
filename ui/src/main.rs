//! The program `quadfrog`.
//!
//! Exit status: 0 when done, 2 for unusable input (the message names it and the remedy), 1 for every other error, 128
//! and the number of a signal that has ended a command without a screen.
#![warn(clippy::print_stdout, clippy::print_stderr)] // every text crosses the border of `output`

use std::process::ExitCode;

use clap::CommandFactory as _;
use clap::error::ErrorKind;
use quadfrog_console::output;
use quadfrog_console::subcommand::{self, Arguments, Failure, VERSION};

fn main() -> ExitCode {
    std::panic::set_hook(Box::new(|info| output::message(&defect_report(&info.to_string()))));
    subcommand::answer_shell(Arguments::command);
    let arguments = match Arguments::of_process() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    let done = subcommand::run(arguments).and_then(|()| match output::failure() {
        Some(error) => Err(Failure::Other(anyhow::anyhow!("standard output: {error}; the output is not complete"))),
        None => Ok(()),
    });
    let Err(failure) = done else { return ExitCode::SUCCESS };
    failure.print();
    ExitCode::from(failure.status())
}

/// Prints an error of the command line without what its arguments may hold; help and version as they are.
fn refuse(error: &clap::Error) -> ExitCode {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        return match error.print() {
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
                output::notice(&format!("standard output: {error}; the output is not complete"));
                ExitCode::FAILURE
            }
            _ => ExitCode::SUCCESS,
        };
    }
    output::message(&error.render().to_string());
    ExitCode::from(2)
}

/// Returns the text about a defect of the program: what it is, and what a report of it needs.
fn defect_report(panic: &str) -> String {
    let thread = std::thread::current();
    let (name, version) = (thread.name().unwrap_or("unnamed"), VERSION);
    // A panic in here, as by an argument that is not UTF-8, would end the process before the motors are damped.
    let command = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ");
    format!(
        "\nquadfrog: a defect of the program, in thread `{name}`: {panic}\n\
         Nothing that was judged is lost; the study continues with --resume FOLDER.\n\
         Please report it to the maintainers (issues of the project's repository) with this text, the study's folder\n\
         (study.log, session.mcap, config/), and what was done before. Version {version}, {}, command: {command}\n",
        std::env::consts::ARCH
    )
}
