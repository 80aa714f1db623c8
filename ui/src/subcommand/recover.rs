//! `quadfrog recover`: repairs an incomplete recording.

use std::path::PathBuf;

use clap::Args;
use quadfrog::recording::recover;

use super::failure::Failure;

#[derive(Debug, Args)]
pub struct RecoverArguments {
    /// A session.mcap.part left by a killed program, or a damaged session.mcap
    file: PathBuf,
}

pub fn run(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered = recover::recover(&arguments.file).map_err(Failure::input)?;
    println!("{}: {} ticks, {} messages", recovered.path.display(), recovered.ticks, recovered.messages);
    match recovered.lost {
        Some(lost) => println!("Lost: {lost}"),
        None => println!("Nothing was lost."),
    }
    println!("{} is unchanged.", arguments.file.display());
    Ok(())
}
