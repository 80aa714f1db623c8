//! A study of 20 jumps on the simulated Go1 without the console: the engine as a library. Prints one line per trial, and the
//! best. The same seed gives the same values.
//!
//! `cargo run --release --example study`

use quadfrog::config::Config;
use quadfrog::engine::{Options, open_experiment};
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::{automatic, rollout::Rollout};
use quadfrog::sim::Simulator;
use quadfrog::trial::{Backend, Task};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = Config::load(None)?;
    let robot = RobotDescription::embedded("go1")?;
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator)?;
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator)?, &settings);
    let options = Options { trials: Some(20), ..Options::new(config, robot, Backend::Simulator, Task::Forward) };
    // Without a folder nothing is kept; `folder: Some(path)` keeps an Optuna journal.
    let mut experiment = open_experiment(&options, Durability::Buffered, "")?;
    automatic::run(&mut experiment, &mut rollout, |row, _ticks| {
        println!("trial {:2}: {:.3} m, {}", row.trial, row.value.unwrap_or(0.0), row.cause);
    })?;
    let best = experiment.best().ok_or("no trial stood")?;
    let point = best.parameters.iter().map(|(name, value)| format!("{name} {value:.2}")).collect::<Vec<_>>().join(", ");
    println!("best: trial {} with {:.3} m at {point}", best.trial, best.value.unwrap_or(0.0));
    Ok(())
}
