//! `quadfrog give-back`: starts the robot's own controller again, which a session on hardware has released. Scripts use it: it asks
//! nothing, and refuses a robot that does not lie or that another program commands.

use crate::put_line;
use clap::Args;
use clap_complete::ArgValueCandidates;

use super::arguments::{self, DdsArguments, RealRobot};
use super::completion;
use super::failure::Failure;

#[derive(Debug, Args)]
pub struct GiveBackArguments {
    /// Controller to start: the one that the session released
    #[arg(long, value_name = "NAME", default_value = "normal")]
    controller: String,
    /// Robot model: go2, or a folder with a URDF and the robot.toml of a robot over DDS
    #[arg(long, value_name = "MODEL", default_value = "go2", add = ArgValueCandidates::new(completion::robots))]
    model: String,
    #[command(flatten)]
    dds: DdsArguments,
}

pub fn run(arguments: &GiveBackArguments) -> Result<(), Failure> {
    let (files, robot) = arguments::load_model(&arguments.model)?;
    let mut network = RealRobot::Go2.network(&files, &arguments.model)?;
    arguments.dds.apply(&mut network)?;
    network.give_back(&robot.lying_position, &arguments.controller).map_err(Failure::input)?;
    put_line!("The robot's own controller {} is active again.", arguments.controller);
    Ok(())
}
