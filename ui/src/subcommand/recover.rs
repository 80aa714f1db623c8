//! `quadfrog recover`: repairs an incomplete recording.

use std::path::PathBuf;

use clap::Args;
use quadfrog::recording::recover;
use quadfrog_console::put_line;

use super::failure::Failure;

#[derive(Debug, Args)]
pub struct RecoverArguments {
    /// A session.mcap.part left by a killed program, or a damaged session.mcap
    file: PathBuf,
}

pub fn run(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered = recover::recover(&arguments.file).map_err(Failure::input)?;
    put_line!("{}: {} ticks, {} messages", recovered.path.display(), recovered.ticks, recovered.messages);
    match recovered.lost {
        Some(lost) => put_line!("Lost: {lost}"),
        None => put_line!("Nothing was lost."),
    }
    put_line!("{} is unchanged.", arguments.file.display());
    Ok(())
}
