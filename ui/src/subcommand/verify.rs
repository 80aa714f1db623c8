//! `quadfrog verify`: a simulated session run again from its recording alone.

use std::io::ErrorKind;
use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use quadfrog::engine::{self, TickDifference, Verification, VerifyError};
use quadfrog::recording::RecordingError;
use quadfrog_console::put_line;

use super::failure::Failure;

#[derive(Debug, Args)]
pub struct VerifyArguments {
    /// The recording: a session.mcap of the simulator
    file: PathBuf,
}

/// Exit status 0: every tick is the same; 1: one differs; 2: the file cannot be verified.
pub fn run(arguments: &VerifyArguments) -> Result<(), Failure> {
    let file = arguments.file.display();
    let verified = engine::verify(&arguments.file).map_err(|error| match error {
        VerifyError::Recording(RecordingError::Io { ref source, .. }) if source.kind() != ErrorKind::NotFound => {
            Failure::Other(error.into())
        }
        error => Failure::input(error),
    })?;
    match verified {
        Verification::Equal { trials, ticks, left_out } => {
            put_line!("{file}: {ticks} ticks of {trials} trials are simulated again, every one the same bit for bit");
            if !left_out.is_empty() {
                let numbers = left_out.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
                put_line!("not compared, because a person, a fault or a crash ended them: trials {numbers}");
            }
            Ok(())
        }
        Verification::Different(found) => {
            let TickDifference { trial, tick, number, field, recorded, simulated } = found;
            let number = number.map_or_else(String::new, |number| format!(" (number {number})"));
            Err(Failure::Other(anyhow!(
                "{file}: trial {trial}, tick {tick}{number}: {field} is {recorded} in the file, {simulated} in the simulation"
            )))
        }
    }
}
