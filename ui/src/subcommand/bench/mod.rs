//! `quadfrog bench`: measurements of this machine.

mod control_loop;
mod machine;
mod speed;

use clap::{Args, Subcommand};

use super::failure::Failure;

#[derive(Debug, Subcommand)]
enum BenchCommand {
    /// Measure the control loop: wake-up latency and duration of a tick
    Loop(control_loop::LoopArguments),
}

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct BenchArguments {
    #[command(subcommand)]
    command: Option<BenchCommand>,
    #[command(flatten)]
    speed: speed::SpeedArguments,
}

pub fn run(arguments: &BenchArguments) -> Result<(), Failure> {
    match &arguments.command {
        Some(BenchCommand::Loop(arguments)) => control_loop::run(arguments),
        None => speed::run(&arguments.speed),
    }
}
