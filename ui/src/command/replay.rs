//! The console on a recorded session.

use std::path::PathBuf;

use clap::Args;
use quadfrog::config::Config;
use quadfrog::recording::player::Player;
use quadfrog::robot::description::RobotDescription;
use quadfrog_console::app::{self, Ended};
use quadfrog_console::feed::Feed;
use quadfrog_console::terminal;

use super::Failure;
use super::console::{ScreenArguments, options};

#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The recording: a session.mcap, also one that was cut short
    file: PathBuf,
    /// Folder with a console.toml of your own
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    #[command(flatten)]
    screen: ScreenArguments,
}

pub fn run(arguments: &ReplayArguments) -> Result<(), Failure> {
    let config = Config::load(arguments.config.as_deref())?;
    let console = options(&arguments.screen, &config)?;
    let player = Player::open(&arguments.file).map_err(Failure::input)?;
    // A recording that was cut short is played as far as it goes, but never as if it were whole: the exit status says so.
    let damage = player.damage().map(|damage| {
        let file = arguments.file.display();
        format!("{damage}; what is left can be played, and quadfrog recover {file} makes a whole file of it")
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
        (Ended::HungUp, _) | (_, None) => Ok(()),
        (_, Some(damage)) => Err(Failure::Input(damage)),
    }
}
