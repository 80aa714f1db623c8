//! The console on a running engine.

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use quadfrog::engine::{self, Options};
use quadfrog::trial::{Approval, Backend, Task};
use quadfrog_console::app::{self, ConsoleOptions, Ended};
use quadfrog_console::feed::Feed;
use quadfrog_console::settings::{ColourChoice, Settings};
use quadfrog_console::terminal;

use super::chosen::{Chosen, continued};
use super::{Failure, StudyArguments, TaskName};

/// How many colours are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Colour {
    /// As many as the terminal says it has; none with NO_COLOR
    Auto,
    /// 16 colours
    #[value(name = "16")]
    Sixteen,
    /// 256 colours
    #[value(name = "256")]
    TwoHundredFiftySix,
    /// 24 bits
    True,
    /// None
    Never,
}

/// What the person at the console is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Asked {
    /// Approve and judge each jump
    Each,
    /// Judge falls and what is odd; the rest is accepted, and on the simulator approved, by itself
    FallsOnly,
    /// Nothing: on the simulator only
    Auto,
}

impl From<Asked> for Approval {
    fn from(asked: Asked) -> Approval {
        match asked {
            Asked::Each => Approval::Each,
            Asked::FallsOnly => Approval::FallsOnly,
            Asked::Auto => Approval::Auto,
        }
    }
}

/// How the console looks, live and in replay.
#[derive(Debug, Clone, Args)]
pub struct ScreenArguments {
    /// Only ASCII characters, for consoles without braille
    #[arg(long)]
    pub ascii: bool,
    /// Colours
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    pub color: Colour,
    /// Fewer frames and colours, for a slow link
    #[arg(long)]
    pub low_bandwidth: bool,
}

/// Which machine is driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Machine {
    /// The built-in simulator
    Sim,
    /// A Unitree Go1 over its network, or `quadfrog emulate`
    Go1,
}

#[derive(Debug, Args)]
pub struct ConsoleArguments {
    /// Which machine is driven
    #[arg(long, value_name = "WHICH", default_value = "sim")]
    robot: Machine,
    /// Where the robot listens, with `--robot go1` [default: that of its robot.toml]
    #[arg(long, value_name = "HOST:PORT")]
    address: Option<String>,
    /// What the robot is to learn [default: forward]
    #[arg(long, value_name = "TASK")]
    task: Option<TaskName>,
    /// Seed of the study [default: that of optimize.toml]
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    #[command(flatten)]
    study: StudyArguments,
    /// Continue the study in this folder
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Look, and change nothing
    #[arg(long)]
    observe: bool,
    /// What is asked of you: every jump, only falls, or (on the simulator) nothing
    #[arg(long, value_name = "WHAT", default_value = "each")]
    approve: Asked,
    #[command(flatten)]
    screen: ScreenArguments,
}

pub fn run(arguments: &ConsoleArguments) -> Result<(), Failure> {
    let config = arguments.study.load_config(arguments.resume.as_deref())?;
    let mut robot = arguments.study.load_robot()?;
    let backend = match arguments.robot {
        Machine::Sim => Backend::Simulator,
        Machine::Go1 => Backend::Hardware,
    };
    match (&arguments.address, &mut robot.network) {
        (Some(text), _) if backend == Backend::Simulator => {
            return Err(Failure::input(format!("--address {text}: the simulator has none; add --robot go1")));
        }
        (Some(text), Some(network)) => network.address = address(text)?,
        // A robot without a network is refused by the engine, with or without an address.
        _ => {}
    }
    let console = options(&arguments.screen, &config)?.with_robot(robot.clone());
    terminal::check().map_err(Failure::input)?;
    let (task, seed) = (arguments.task.map(Task::from), arguments.seed);
    let chosen = match &arguments.resume {
        Some(folder) => continued(folder, task, seed, &robot)?,
        None => {
            let task = task.unwrap_or(Task::Forward);
            let seed = seed.unwrap_or(config.optimize.sampler.seed);
            Chosen { task, seed, folder: arguments.study.new_folder(task, seed), budget: None }
        }
    };
    let folder = chosen.folder.clone();
    let cut_short = left_behind(&folder);
    let handle = engine::start(Options {
        seed: chosen.seed,
        trials: arguments.study.trials.or(chosen.budget),
        // Who only looks leaves nothing behind.
        folder: (!arguments.observe).then_some(chosen.folder),
        observe: arguments.observe,
        approve: arguments.approve.into(),
        // This program, also where its file was replaced since it was started.
        guard: Some(PathBuf::from("/proc/self/exe")),
        ..Options::new(config, robot, backend, chosen.task)
    })?;
    let recording = handle.recording().map(Path::to_owned);
    if app::run(Feed::live(handle), console)? == Ended::HungUp {
        // There is nowhere to print to.
        return Ok(());
    }
    if arguments.observe {
        return Ok(());
    }
    println!("The study and its recording are in {}", folder.display());
    println!("  continue it:  quadfrog --resume {}", folder.display());
    if let Some(recording) = recording {
        println!("  look at it:   quadfrog replay {}", recording.display());
    }
    for part in cut_short {
        println!("  an earlier recording was cut short; make it whole:  quadfrog recover {}", part.display());
    }
    Ok(())
}

/// The address that `HOST:PORT` means.
fn address(text: &str) -> Result<SocketAddr, Failure> {
    let no_address = |reason: String| {
        Failure::input(format!("--address {text}: {reason}; give HOST:PORT, for example 192.168.123.10:8007"))
    };
    let mut found = text.to_socket_addrs().map_err(|error| no_address(error.to_string()))?;
    found.next().ok_or_else(|| no_address("no such host".to_owned()))
}

/// Recordings that an earlier session of this study could not finish.
fn left_behind(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.filter(|path| path.extension().is_some_and(|extension| extension == "part")).collect()
}

/// The console's options from the arguments and `console.toml`.
pub fn options(screen: &ScreenArguments, config: &quadfrog::config::Config) -> Result<ConsoleOptions, Failure> {
    let settings = Settings::from_table(&config.console)
        .map_err(|error| config.refuse("console.toml", &error.key, &error.value, &error.reason))?;
    let colours = match screen.color {
        Colour::Auto => None,
        Colour::Sixteen => Some(ColourChoice::Named),
        Colour::TwoHundredFiftySix => Some(ColourChoice::Indexed),
        Colour::True => Some(ColourChoice::True),
        Colour::Never => Some(ColourChoice::None),
    };
    Ok(ConsoleOptions::new(settings, colours, screen.ascii, screen.low_bandwidth))
}
