//! `quadfrog prior`: the prior of the sampler `sim`, made before a study.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use crate::{notice, output, put_line};
use clap::Args;
use clap::builder::TypedValueParser;
use clap_complete::ArgValueCandidates;
use quadfrog::config::Config;
use quadfrog::engine::{PriorFileError, PriorMaker, ReadyPrior};
use quadfrog::optimize::prior::World;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::parallel::cores;
use quadfrog::session::prior::ensemble;
use quadfrog::sim::ensemble::EnsembleSettings;
use quadfrog::trial::{Backend, Task};
use serde_json::json;

use super::arguments::{self, whole_number};
use super::completion;
use super::failure::Failure;
use super::output_file::{require_name, require_writable};
use super::progress::Progress;

#[derive(Debug, Args)]
pub struct PriorArguments {
    /// Task of the jumps
    #[arg(long, value_name = "TASK", default_value = "forward", value_parser = arguments::task())]
    task: Task,
    /// Folder whose TOML files replace those of the configuration, whole or key by key
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Robot model: go1, a1, go2, or a folder with a URDF and a robot.toml
    #[arg(long, value_name = "MODEL", default_value = "go1", add = ArgValueCandidates::new(completion::robots))]
    model: String,
    /// Machine of the studies: on hardware controller and objective have the estimate in place of the true state
    #[arg(long, value_name = "WHICH", default_value = Backend::Simulator.name(), value_parser = backend())]
    backend: Backend,
    /// File of the prior [default: in the folder priors of recordings, where new studies find it]
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Jumps at the same time; the prior does not depend on it [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = whole_number(1_u16..=u16::MAX))]
    jobs: Option<u16>,
    /// Print one JSON object on standard output
    #[arg(long)]
    json: bool,
}

fn backend() -> impl TypedValueParser<Value = Backend> {
    arguments::one_of([
        (Backend::Simulator, Backend::Simulator.name(), "The built-in simulator"),
        (Backend::Hardware, Backend::Hardware.name(), "A robot over its network, or `quadfrog emulate`"),
    ])
}

pub fn run(arguments: &PriorArguments) -> Result<(), Failure> {
    let (files, robot) = arguments::load_model(&arguments.model)?;
    let config = arguments::load_config_for(&files, arguments.config.as_deref())?;
    let maker = PriorMaker::new(&config, &robot, arguments.task, arguments.backend)?;
    let given = arguments.output.clone();
    let file = given.clone().unwrap_or_else(|| maker.shared_file(Path::new("recordings")));
    if let Some(given) = &given {
        require_name("--output", given)?;
        may_replace(&maker, given)?;
    }
    let files = [file.clone()];
    let ready = find_or_make(&maker, &files, &file, arguments.jobs.map_or_else(cores, usize::from))?;
    ready.keep(&files)?;
    let reused = ready.from.is_some();
    let prior = ready.model.prior();
    let unit = config.task(arguments.task).unit(arguments.task);
    let robots = ensemble(&config.prior);
    if arguments.json {
        let worlds = prior.worlds.iter().zip(&robots).map(
            |(world, robot)| json!({ "name": world.name, "falls": falls(world), "best": best(world), "robot": robot }),
        );
        let made = json!({
            "task": arguments.task.name(),
            "file": file.to_string_lossy(),
            "key": maker.key(),
            "reused": reused,
            "points": prior.points.len(),
            "worlds": worlds.collect::<Vec<_>>(),
        });
        output::line(&made.to_string());
        return Ok(());
    }
    put_line!("prior of {}: {} robots, {} jumps each", arguments.task.name(), prior.worlds.len(), prior.points.len());
    for (world, robot) in prior.worlds.iter().zip(&robots) {
        let best = best(world).map_or("none stood".to_owned(), |best| format!("best {best:.3} {unit}"));
        put_line!(
            "  {}: {} falls, {best}; mass x {:.2}, torque x {:.2}, friction {:.2}, delay {} ms, lag {:.1} ms, joint friction {:.2} N m",
            world.name,
            falls(world),
            robot.mass,
            robot.torque_limit,
            robot.friction,
            robot.delay_ms,
            1e3 * robot.torque_lag_s,
            robot.dry_friction_nm,
        );
    }
    let what = if reused { "nothing has changed: reused" } else { "kept in" };
    put_line!("{what} {}", file.display());
    Ok(())
}

/// Refuses to write over a file that is no prior.
fn may_replace(maker: &PriorMaker, file: &Path) -> Result<(), Failure> {
    match maker.read(file) {
        Err(error @ (PriorFileError::Foreign { .. } | PriorFileError::Newer { .. })) => {
            Err(Failure::input(format!("--output {error}; give another name or remove it")))
        }
        Err(PriorFileError::Read { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error @ PriorFileError::Read { .. }) => Err(Failure::input(format!("--output {error}; give another name"))),
        _ => Ok(()),
    }
}

/// Returns the prior of a task for a study on the simulator: from one of `files`, or from the priors in `output`, or made now and kept there.
pub fn obtain(
    config: &Config,
    robot: &RobotDescription,
    task: Task,
    files: &[PathBuf],
    output: &Path,
) -> Result<ReadyPrior, Failure> {
    let maker = PriorMaker::new(config, robot, task, Backend::Simulator)?;
    let shared = maker.shared_file(output);
    let all: Vec<PathBuf> = files.iter().cloned().chain([shared.clone()]).collect();
    let ready = find_or_make(&maker, &all, &shared, cores())?;
    ready.keep(&[shared])?;
    Ok(ready)
}

/// Returns the prior that one of `files` has, or makes it. `kept` is the file that it will be kept in: refused before the work where it
/// cannot be written.
fn find_or_make(maker: &PriorMaker, files: &[PathBuf], kept: &Path, jobs: usize) -> Result<ReadyPrior, Failure> {
    let task = maker.plan().task.name();
    if let Some(ready) = maker.find(files, &mut |text| notice!("{text}")) {
        if let Some(file) = &ready.from {
            notice!("the prior of {task} is that of {}", file.display());
        }
        return Ok(ready);
    }
    require_writable(kept, "give another place by --output")?;
    let EnsembleSettings { worlds, points, .. } = maker.plan().ensemble;
    notice!("the prior of {task}: {worlds} simulated robots, {points} jumps each, on {jobs} threads");
    let progress = Progress::new(format!("prior of {task}"), u64::from(worlds) * u64::from(points), Some("jumps"));
    let ready = maker.make(jobs, &|_| progress.add(1, ""), &AtomicBool::new(false))?;
    notice!("the prior of {task} took {}", progress.finish());
    Ok(ready)
}

fn falls(world: &World) -> usize {
    world.values.iter().filter(|value| value.is_none()).count()
}

fn best(world: &World) -> Option<f64> {
    world.values.iter().flatten().copied().max_by(f64::total_cmp)
}
