//! `quadfrog verify`: a simulated session run again from its recording alone.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::{notice, put_line};
use anyhow::anyhow;
use clap::Args;
use quadfrog::engine::{self, TickDifference, Verification, VerifyError};
use quadfrog::recording::RecordingError;
use quadfrog::recording::session_files::recordings_of;
use quadfrog::trial::counted;

use super::damage::with_repair;
use super::failure::Failure;
use super::replay::is_written;

#[derive(Debug, Args)]
pub struct VerifyArguments {
    /// A session.mcap of the simulator, or the folder of a study for all its files
    file: PathBuf,
}

/// Exit status 0: every tick is the same; 1: one differs; 2: the file cannot be verified.
pub fn run(arguments: &VerifyArguments) -> Result<(), Failure> {
    let mut without_trial = Vec::new();
    let mut verified = false;
    for file in recordings_of(&arguments.file)? {
        match verify(&file) {
            Ok(()) => verified = true,
            // Of several files one may hold none, for example the end of a session.
            Err(VerifyFailure::NoTrial(failure)) => without_trial.push((file, failure)),
            Err(VerifyFailure::Other(failure)) => return Err(failure),
        }
    }
    if !verified && let Some((_, failure)) = without_trial.pop() {
        return Err(failure);
    }
    for (file, _) in without_trial {
        put_line!("{}: no trial came to its own end in it", file.display());
    }
    Ok(())
}

/// Reason for which a file is not verified.
enum VerifyFailure {
    NoTrial(Failure),
    Other(Failure),
}

fn verify(path: &Path) -> Result<(), VerifyFailure> {
    let file = path.display();
    let written = is_written(path);
    let verified = engine::verify(path).map_err(|error| match error {
        VerifyError::Damaged(_) if written => VerifyFailure::Other(Failure::input(format!(
            "{file}: not verifiable: a session still writes it; verify it once that session has ended"
        ))),
        VerifyError::Damaged(ref damage) => VerifyFailure::Other(Failure::input(with_repair(&error, damage))),
        VerifyError::Recording(RecordingError::Io { ref source, .. }) if source.kind() != ErrorKind::NotFound => {
            VerifyFailure::Other(Failure::Other(error.into()))
        }
        VerifyError::NoTrial { .. } => VerifyFailure::NoTrial(Failure::input(error)),
        error => VerifyFailure::Other(Failure::input(error)),
    })?;
    match verified {
        Verification::Equal { trials, ticks, left_out, lost_before } => {
            put_line!(
                "{file}: {} of {} are simulated again, every one the same bit for bit",
                counted(ticks as usize, "tick"),
                counted(trials, "trial")
            );
            if !left_out.is_empty() {
                let runs = left_out.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                let them = if left_out.len() == 1 { "it" } else { "them" };
                put_line!("not compared, because a person, a fault or a crash ended {them}: {runs}");
            }
            for lost in lost_before {
                notice!("{file}: {lost}");
            }
            Ok(())
        }
        Verification::Different(found) => {
            let TickDifference { run, tick, number, field, recorded, simulated } = found;
            let number = number.map_or_else(String::new, |number| format!(" (number {number})"));
            Err(VerifyFailure::Other(Failure::Other(anyhow!(
                "{file}: {run}, tick {tick}{number}: {field} is {recorded} in the file, {simulated} in the simulation"
            ))))
        }
    }
}
