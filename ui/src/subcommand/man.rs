//! `quadfrog man`: manual pages of the program and its commands.

use std::path::PathBuf;

use crate::put_line;
use clap::{Args, Command};

use super::failure::Failure;
use super::output_file::not_written;

#[derive(Debug, Args)]
pub struct ManArguments {
    /// Folder of the pages: quadfrog.1 and one for each command. `man -l FOLDER/quadfrog.1` shows a page
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Writes the manual pages of `program`.
pub fn run(arguments: &ManArguments, program: Command) -> Result<(), Failure> {
    let folder = &arguments.folder;
    let write = || {
        std::fs::create_dir_all(folder)?;
        clap_mangen::generate_to(program, folder)
    };
    write().map_err(|error| not_written(folder, &error))?;
    put_line!("manual pages written to {}", folder.display());
    Ok(())
}
