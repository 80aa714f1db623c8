//! `quadfrog ask-tell`: a sampler on standard input and output, for any program as the objective.

use std::path::PathBuf;

use crate::output;
use anyhow::Context as _;
use clap::Args;
use clap_complete::ArgValueCandidates;
use quadfrog::engine::{self, Options};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::session::ask_tell::AskTell;
use quadfrog::trial::{Backend, Task};

use super::arguments::{self, whole_number};
use super::completion;
use super::failure::Failure;
use super::prior;

#[derive(Debug, Args)]
pub struct AskTellArguments {
    /// Task, for the parameters and their bounds
    #[arg(long, value_name = "TASK", default_value = "forward", value_parser = arguments::task())]
    task: Task,
    /// Sampler that proposes the parameters [default: from optimize.toml]
    #[arg(long, value_name = "SAMPLER", value_parser = arguments::sampler())]
    sampler: Option<SamplerKind>,
    /// Seed of the sampler [default: from optimize.toml]
    #[arg(long, value_name = "N", value_parser = whole_number(0_u32..=u32::MAX))]
    seed: Option<u32>,
    /// Folder whose TOML files replace those of the configuration, whole or key by key
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Robot model, for the prior of the sampler sim: go1, a1, go2, or a folder with a URDF and a robot.toml
    #[arg(long, value_name = "MODEL", default_value = "go1", add = ArgValueCandidates::new(completion::robots))]
    model: String,
    /// Folder whose priors/ holds the priors of the sampler sim
    #[arg(long, value_name = "DIR", default_value = "recordings")]
    output: PathBuf,
}

pub fn run(arguments: &AskTellArguments) -> Result<(), Failure> {
    let (files, robot) = arguments::load_model(&arguments.model)?;
    let mut config = arguments::load_config_for(&files, arguments.config.as_deref())?;
    if let Some(sampler) = arguments.sampler {
        config.choose_sampler(sampler);
    }
    let task = arguments.task;
    let needs_prior = config.optimize.sampler.kind == SamplerKind::Sim;
    let ready = needs_prior.then(|| prior::obtain(&config, &robot, task, &[], &arguments.output)).transpose()?;
    let options = Options {
        seed: arguments.seed.unwrap_or(config.optimize.sampler.seed),
        prior: ready.map(|ready| ready.model),
        ..Options::new(config, robot, Backend::Simulator, task)
    };
    let study = engine::open_study(&options, Durability::Buffered)?;
    let mut served = AskTell::new(study);
    served.serve(&mut std::io::stdin().lock(), output::line).context("standard input").map_err(Failure::Other)
}
