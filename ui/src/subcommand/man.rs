//! `quadfrog man`: manual pages of the program and its commands.

use std::path::{Path, PathBuf};

use crate::put_line;
use crate::whole_file::write_whole;
use clap::{Args, Command};
use clap_mangen::Man;

use super::failure::{Failure, not_written};

#[derive(Debug, Args)]
pub struct ManArguments {
    /// Folder of the pages: quadfrog.1 and one for each command. `man -l FOLDER/quadfrog.1` shows a page
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Writes the manual pages of `program`.
pub fn run(arguments: &ManArguments, program: Command) -> Result<(), Failure> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).map_err(|error| not_written(folder, &error))?;
    let mut program = program.disable_help_subcommand(true);
    program.build();
    write_pages(program, folder)?;
    put_line!("manual pages written to {}", folder.display());
    Ok(())
}

/// Writes the pages of a command and of its commands, each whole or not at all.
fn write_pages(command: Command, folder: &Path) -> Result<(), Failure> {
    for inner in command.get_subcommands().filter(|inner| !inner.is_hide_set()) {
        write_pages(inner.clone(), folder)?;
    }
    let page = Man::new(command);
    let file = folder.join(page.get_filename());
    write_whole(&file, |to| page.render(to)).map_err(|error| not_written(&file, &error))
}
