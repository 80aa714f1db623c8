//! `quadfrog init`: a folder for a new robot, made from its URDF.

use std::path::{Path, PathBuf};

use crate::put_line;
use clap::Args;
use quadfrog::config::{Config, write_new_files};
use quadfrog::printable::shell_word;
use quadfrog::robot::description::{Draft, read_text};
use quadfrog::trial::{Backend, Task};

use super::arguments::{load_config, printable_name};
use super::failure::Failure;

#[derive(Debug, Args)]
pub struct InitArguments {
    /// URDF of the robot: a quadruped with three joints per leg
    #[arg(value_name = "URDF")]
    urdf: PathBuf,
    /// New folder: the URDF, and a robot.toml to be completed
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Name of the robot [default: that of the folder]
    #[arg(long, value_name = "NAME", value_parser = printable_name)]
    name: Option<String>,
}

/// Writes the folder and says what is missing.
pub fn run(arguments: &InitArguments) -> Result<(), Failure> {
    let InitArguments { urdf, folder, name } = arguments;
    let config = load_config(None)?;
    let refuse = |reason: &dyn std::fmt::Display| Failure::input(format!("{}: {reason}", urdf.display()));
    if urdf.file_name().is_some_and(|name| name == "robot.toml") {
        return Err(refuse(&"is the name of the file that init writes beside the URDF; give the URDF another one"));
    }
    let text =
        read_text(urdf).map_err(|error| refuse(&format!("cannot be read: {error}; give the URDF of a robot")))?;
    let name = name.clone().map_or_else(|| name_of(folder), Ok)?;
    let draft = Draft::of_urdf(&name, urdf, &text).map_err(Failure::input)?;
    let urdf_name = urdf.file_name().unwrap_or_default();
    let files = [(Path::new("robot.toml"), &draft.toml), (Path::new(urdf_name), &text)];
    for path in write_new_files(folder, &files)? {
        put_line!("{}", path.display());
    }
    let robot = &draft.robot;
    put_line!(
        "\n{}: {:.2} kg, legs of {:.3} m and {:.3} m",
        robot.name,
        robot.total_mass(),
        robot.leg_geometry.thigh,
        robot.leg_geometry.calf
    );
    put_line!("\nNot known from the URDF:");
    for missing in &draft.missing {
        put_line!("  {missing}");
    }
    put_line!("\nWith the present configuration:");
    for task in Task::ALL {
        put_line!("  {}: {}", task.name(), fitness(&config, &draft, task));
    }
    put_line!("\nNext: quadfrog --model {}", shell_word(folder));
    Ok(())
}

/// Returns the name of a robot whose folder this is; that of `.` is the name of the present folder.
fn name_of(folder: &Path) -> Result<String, Failure> {
    let whole = folder.canonicalize().unwrap_or_default();
    let name = folder.file_name().or(whole.file_name()).unwrap_or_default();
    printable_name(&name.to_string_lossy())
        .map_err(|reason| Failure::input(format!("{}: {reason}; give the robot's name with --name", folder.display())))
}

/// Returns whether a task can run on the simulated robot, in words.
fn fitness(config: &Config, draft: &Draft, task: Task) -> String {
    match config.settings(&draft.robot, task, Backend::Simulator) {
        Ok(_) => "the stance is in reach".to_owned(),
        Err(error) => error.to_string(),
    }
}
