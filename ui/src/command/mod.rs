//! The command line: one file per subcommand; without one, the console opens.

mod bench;
mod bench_loop;
mod chosen;
mod console;
mod doctor;
mod emulate;
mod guard;
mod optimize;
mod recover;
mod replay;
mod study;

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use quadfrog::config::{Config, ConfigError};
use quadfrog::engine::{EngineError, newest_config};
use quadfrog::optimize::journal::JournalError;
use quadfrog::optimize::sampler::SamplerKind;
use quadfrog::optimize::study::StudyError;
use quadfrog::recording::RecordingError;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::Task;

/// Optimize the jumps of a quadruped, on the robot or on the built-in simulator.
///
/// Without a subcommand the console opens on the simulator: press the keys that it names.
#[derive(Debug, Parser)]
#[command(name = "quadfrog", version, max_term_width = 100, args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Subcommands>,
    #[command(flatten)]
    console: console::ConsoleArguments,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    /// Run a whole study on the simulator without a screen
    Optimize(optimize::OptimizeArguments),
    /// Play a recorded session in the console's panels
    Replay(replay::ReplayArguments),
    /// Make a whole file of a recording that was cut short
    Recover(recover::RecoverArguments),
    /// Serve the simulator as a Go1 on the network, with faults on demand
    Emulate(emulate::EmulateArguments),
    /// Measure the simulator's speed on this machine
    Bench(bench::BenchArguments),
    /// Say what this machine can do for a robot and a console, and what to do about the rest
    Doctor(doctor::DoctorArguments),
    /// Damp the robot when the process that started this one is no more
    #[command(name = quadfrog::engine::GUARD, hide = true)]
    Guard,
    /// Look at studies, take them elsewhere, bring trials in, queue a point
    Study(study::StudyCommand),
}

/// What ends the program before its time.
pub enum Failure {
    /// Input that cannot be used: which, and what to do.
    Input(String),
    /// Everything else.
    Other(color_eyre::Report),
}

impl Failure {
    fn input(message: impl ToString) -> Failure {
        Failure::Input(message.to_string())
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Failure {
        Failure::input(error)
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Failure {
        // A disk or a server that does not do its part is nobody's input.
        match &error {
            EngineError::System { .. } => Failure::Other(error.into()),
            EngineError::Study(StudyError::Journal(JournalError::Io { .. } | JournalError::Redis { .. })) => {
                Failure::Other(error.into())
            }
            EngineError::Recording(RecordingError::Io { .. }) => Failure::Other(error.into()),
            _ => Failure::input(error),
        }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Failure {
        EngineError::from(error).into()
    }
}

impl From<color_eyre::Report> for Failure {
    fn from(report: color_eyre::Report) -> Failure {
        Failure::Other(report)
    }
}

/// A task on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TaskName {
    /// Jump forward
    Forward,
    /// Jump to the left
    LateralLeft,
    /// Jump to the right
    LateralRight,
    /// Turn counterclockwise
    TwistCcw,
    /// Turn clockwise
    TwistCw,
}

impl From<TaskName> for Task {
    fn from(name: TaskName) -> Task {
        match name {
            TaskName::Forward => Task::Forward,
            TaskName::LateralLeft => Task::LateralLeft,
            TaskName::LateralRight => Task::LateralRight,
            TaskName::TwistCcw => Task::TwistCcw,
            TaskName::TwistCw => Task::TwistCw,
        }
    }
}

/// A sampler on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SamplerName {
    /// Tree-structured Parzen estimator, as Optuna
    Tpe,
    /// Gaussian process: better where there are some tens of trials
    Gp,
    /// Blind, uniform
    Random,
    /// Blind, even
    Sobol,
}

impl From<SamplerName> for SamplerKind {
    fn from(name: SamplerName) -> SamplerKind {
        match name {
            SamplerName::Tpe => SamplerKind::Tpe,
            SamplerName::Gp => SamplerKind::Gp,
            SamplerName::Random => SamplerKind::Random,
            SamplerName::Sobol => SamplerKind::Sobol,
        }
    }
}

/// What console and `optimize` share.
#[derive(Debug, Clone, Args)]
pub struct StudyArguments {
    /// How many trials are to count [default: that of optimize.toml]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    trials: Option<u32>,
    /// Folder whose TOML files replace those of the configuration, whole or key by key
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Robot model: go1, a1, or a folder with a URDF and a robot.toml
    #[arg(long, value_name = "MODEL", default_value = "go1")]
    model: String,
    /// Who proposes [default: that of optimize.toml]
    #[arg(long, value_name = "SAMPLER")]
    sampler: Option<SamplerName>,
    /// Where the folders of new studies are made
    #[arg(long, value_name = "DIR", default_value = "recordings")]
    output: PathBuf,
}

impl StudyArguments {
    /// The configuration asked for; a study that is continued goes on with the one that it ran with last.
    fn load_config(&self, resume: Option<&Path>) -> Result<Config, Failure> {
        let own = match &self.config {
            None => resume.and_then(newest_config).map(|(_, config)| config),
            Some(_) => None,
        };
        if let Some(own) = &own {
            eprintln!("quadfrog: the configuration is the one that the study ran with last, {}", own.display());
        }
        let mut config = Config::load(self.config.as_deref().or(own.as_deref()))?;
        if let Some(sampler) = self.sampler {
            config.choose_sampler(sampler.into());
        }
        Ok(config)
    }

    fn load_robot(&self) -> Result<RobotDescription, Failure> {
        let folder = Path::new(&self.model);
        let robot = if folder.is_dir() {
            RobotDescription::from_folder(folder)
        } else {
            RobotDescription::embedded(&self.model)
        };
        robot.map_err(Failure::input)
    }

    /// A new study's folder: `<output>/<date>T<time>-<task>-seed<seed>`, with a number behind it where that exists.
    fn new_folder(&self, task: Task, seed: u32) -> PathBuf {
        let now = jiff::Zoned::now().strftime("%Y-%m-%dT%H-%M-%S").to_string();
        let name = format!("{now}-{}-seed{seed}", task.name());
        let names = std::iter::once(name.clone()).chain((2..).map(|n| format!("{name}-{n}")));
        names
            .map(|name| self.output.join(name))
            .find(|folder| !folder.exists())
            .unwrap_or_else(|| self.output.join(name))
    }
}

/// Does what the arguments say.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.command {
        None => console::run(&arguments.console),
        Some(Subcommands::Optimize(optimize)) => optimize::run(&optimize),
        Some(Subcommands::Replay(replay)) => replay::run(&replay),
        Some(Subcommands::Recover(recover)) => recover::run(&recover),
        Some(Subcommands::Emulate(emulate)) => emulate::run(&emulate),
        Some(Subcommands::Bench(bench)) => bench::run(&bench),
        Some(Subcommands::Doctor(doctor)) => doctor::run(&doctor),
        Some(Subcommands::Guard) => guard::run(),
        Some(Subcommands::Study(study)) => study::run(&study),
    }
}
