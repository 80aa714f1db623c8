//! `quadfrog study`: studies as they lie on disk or on a server.
use super::Failure;
use clap::Args;
#[derive(Debug, Args)]
pub struct StudyCommand {}
pub fn run(_: &StudyCommand) -> Result<(), Failure> {
    Ok(())
}
