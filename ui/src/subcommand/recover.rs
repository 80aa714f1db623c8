//! `quadfrog recover`: repairs an incomplete recording.

use std::path::{Path, PathBuf};

use crate::put_line;
use clap::Args;
use quadfrog::engine::{EngineError, running_session};
use quadfrog::recording::player::Player;
use quadfrog::recording::{RecordingError, recover};
use quadfrog::trial::counted;

use super::failure::{Failure, is_of_place};

#[derive(Debug, Args)]
pub struct RecoverArguments {
    /// A session.mcap.part left by a killed program, or a damaged session.mcap
    file: PathBuf,
    /// The new file, *.mcap [default: session.mcap for session.mcap.part, session.recovered.mcap for session.mcap]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub fn run(arguments: &RecoverArguments) -> Result<(), Failure> {
    let RecoverArguments { file, output } = arguments;
    refuse_running(arguments)?;
    let part = file.with_extension("mcap.part");
    if !file.exists() && part.exists() {
        let text =
            format!("{}: there is no such file; give {}, which was not finished", file.display(), part.display());
        return Err(Failure::input(text));
    }
    let is_unfinished = file.extension().is_some_and(|extension| extension == "part");
    if !is_unfinished {
        refuse_nothing_to_recover(file)?;
    }
    let recovered = match output {
        Some(output) => recover::recover_to(file, output),
        None => recover::recover(file),
    };
    let recovered = recovered.map_err(failure)?;
    put_line!(
        "Recovered {}: {}, {}",
        recovered.path.display(),
        counted(recovered.ticks as usize, "tick"),
        counted(recovered.messages as usize, "message")
    );
    match recovered.lost {
        Some(lost) => put_line!("The recording is not complete: {lost}."),
        None => put_line!("Nothing was lost."),
    }
    // Of a study only the files with the names that its sessions give are read.
    let read = if is_unfinished { file.with_extension("") } else { file.clone() };
    put_line!("{} is unchanged.", file.display());
    if recovered.path == read {
        put_line!("Its study reads the new file in its place.");
    } else if is_unfinished {
        put_line!("Its study reads the new file once that is {}.", read.display());
    } else {
        put_line!(
            "Its study reads the new file once you have moved {0} away and renamed the new file to {0}.",
            read.display()
        );
    }
    Ok(())
}

/// Refuses a finished recording of which every chunk, attachment and index can be read.
fn refuse_nothing_to_recover(file: &Path) -> Result<(), Failure> {
    // What cannot be opened is refused with its reason below.
    let Ok(mut player) = Player::open(file) else { return Ok(()) };
    player.by_ref().for_each(drop);
    if !player.check_extras().is_ok_and(|damaged| damaged.is_empty()) {
        return Ok(());
    }
    match player.damage() {
        None => Err(Failure::input(format!("{}: it is whole; there is nothing to recover", file.display()))),
        Some(damage) if damage.is_recoverable => Ok(()),
        Some(damage) => {
            Err(Failure::input(format!("{damage}; there is nothing to recover: messages are copied as they are")))
        }
    }
}

/// Refuses a recording that a session still writes: the session needs the name of the finished file.
fn refuse_running(RecoverArguments { file, .. }: &RecoverArguments) -> Result<(), Failure> {
    if file.extension().is_none_or(|extension| extension != "part") {
        return Ok(());
    }
    let folder = file.parent().unwrap_or(file);
    let owner = running_session(folder).map_err(|source| {
        Failure::from(EngineError::System { what: format!("{}: its lock cannot be read", folder.display()), source })
    })?;
    match owner {
        None => Ok(()),
        Some(owner) => Err(Failure::input(format!(
            "{}: a session runs in its folder ({owner}) and may still write it; end the session, then recover. Until then \
             `quadfrog replay` plays it",
            file.display()
        ))),
    }
}

/// Returns unusable input for a file that cannot be recovered, another error for a disk that fails.
fn failure(error: RecordingError) -> Failure {
    match &error {
        RecordingError::Io { source, .. } if !is_of_place(source.kind()) => Failure::Other(error.into()),
        _ => Failure::input(error),
    }
}
