//! `quadfrog replay`: the console on a recorded session.

use std::path::PathBuf;

use clap::Args;
use quadfrog::config::Config;
use quadfrog::recording::player::Player;
use quadfrog::robot::description::RobotDescription;
use quadfrog_console::app::{self, ConsoleExit};
use quadfrog_console::feed::Feed;
use quadfrog_console::terminal;

use super::console::{ScreenArguments, options};
use super::failure::Failure;

#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The recording: a session.mcap, complete or incomplete
    file: PathBuf,
    /// Folder with your own console.toml
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    #[command(flatten)]
    screen: ScreenArguments,
}

pub fn run(arguments: &ReplayArguments) -> Result<(), Failure> {
    let config = Config::load(arguments.config.as_deref())?;
    let console = options(&arguments.screen, &config)?;
    let player = Player::open(&arguments.file).map_err(Failure::input)?;
    // An incomplete recording is played as far as it goes; the exit status reports the damage.
    let damage = player.damage().map(|damage| {
        let file = arguments.file.display();
        format!("{damage}; the rest can be played; quadfrog recover {file} repairs it")
    });
    terminal::check().map_err(|error| match &damage {
        Some(damage) => Failure::Input(format!("{damage}\n{error}")),
        None => Failure::input(error),
    })?;
    let console = match RobotDescription::embedded(&player.session().robot) {
        Ok(robot) => console.with_robot(robot),
        // A model of the operator's own: the panels that need its limits say so.
        Err(_) => console,
    };
    match (app::run(Feed::replay(player), console)?, damage) {
        (ConsoleExit::HungUp, _) | (_, None) => Ok(()),
        (_, Some(damage)) => Err(Failure::Input(damage)),
    }
}
