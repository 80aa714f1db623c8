//! `quadfrog recover`: a recording that was cut short becomes a whole file of what is left.

use std::path::PathBuf;

use clap::Args;
use quadfrog::recording::recover;

use super::Failure;

#[derive(Debug, Args)]
pub struct RecoverArguments {
    /// The recording: a session.mcap.part that a killed program left behind, or a damaged session.mcap
    file: PathBuf,
}

pub fn run(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered = recover::recover(&arguments.file).map_err(Failure::input)?;
    println!("{}: {} ticks, {} messages", recovered.path.display(), recovered.ticks, recovered.messages);
    match recovered.lost {
        Some(lost) => println!("Lost: {lost}"),
        None => println!("Nothing was lost."),
    }
    println!("{} is left as it was.", arguments.file.display());
    Ok(())
}
