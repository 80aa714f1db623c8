//! The console on a running engine.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::app::{self, ConsoleExit, ConsoleOptions};
use crate::connection::TerminalLocation;
use crate::feed::Feed;
use crate::graphics::GraphicsChoice;
use crate::model::RobotFacts;
use crate::settings::ConsoleSettings;
use crate::terminal;
use crate::theme::{ColourChoice, ThemeChoice};
use crate::{notice, output, put_line};
use anyhow::{Context, anyhow};
use clap::Args;
use clap::builder::TypedValueParser;
use clap_complete::ArgValueCandidates;
use quadfrog::config::{Config, ConfigError};
use quadfrog::engine::{self, Options};
use quadfrog::optimize::journal::notice_waits;
use quadfrog::printable::shell_word;
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::recording::session_files::{recordings_in, unfinished_in};
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::hardware::{HardwareError, Network};
use quadfrog::trial::{Approval, Backend, Task};

use super::arguments::{self, DEFAULT_MODEL, DdsArguments, RealRobot, StudyArguments, one_of, whole_number};
use super::completion;
use super::failure::Failure;
use super::interrupt::{exit_status, on_signal};
use super::live;
use super::selection::{SelectedStudy, study_to_continue};

fn colour() -> impl TypedValueParser<Value = ColourChoice> {
    one_of([
        (ColourChoice::Auto, "auto", "As the terminal reports; none with NO_COLOR"),
        (ColourChoice::Named, "16", "16 colours"),
        (ColourChoice::Indexed, "256", "256 colours"),
        (ColourChoice::True, "true", "24 bits"),
        (ColourChoice::None, "never", "None"),
    ])
}

/// Parses the background that colours suit.
pub fn theme() -> impl TypedValueParser<Value = ThemeChoice> {
    one_of([
        (ThemeChoice::Auto, "auto", "As console.toml says, or as the terminal reports its background"),
        (ThemeChoice::Dark, "dark", "For a dark background"),
        (ThemeChoice::Light, "light", "For a light background"),
    ])
}

fn graphics() -> impl TypedValueParser<Value = GraphicsChoice> {
    one_of([
        (GraphicsChoice::Auto, "auto", "As console.toml says, or as the terminal is known to show or reports"),
        (GraphicsChoice::Cells, "cells", "Characters"),
        (GraphicsChoice::Kitty, "kitty", "Pixels by the graphics protocol of kitty"),
        (GraphicsChoice::Sixel, "sixel", "Pixels by sixel"),
        (GraphicsChoice::Iterm2, "iterm2", "Pixels by the inline images of iTerm2"),
    ])
}

/// The machine behind the console.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Machine {
    Simulator,
    Robot(RealRobot),
}

fn machine() -> impl TypedValueParser<Value = Machine> {
    let robot = |robot: RealRobot, help| (Machine::Robot(robot), robot.name(), help);
    one_of([
        (Machine::Simulator, Backend::Simulator.name(), "The built-in simulator"),
        robot(RealRobot::Go1, "A Unitree Go1 over UDP, or `quadfrog emulate`"),
        robot(RealRobot::Go2, "A Unitree Go2 over DDS, or `quadfrog emulate --robot go2`"),
    ])
}

fn approval() -> impl TypedValueParser<Value = Approval> {
    one_of(Approval::ALL.map(|approval| {
        let help = match approval {
            Approval::Each => "Approve and judge each jump",
            Approval::FallsOnly => {
                "Judge falls and anomalies; other jumps are accepted, and on the simulator approved, automatically"
            }
            Approval::Auto => "Nothing: on the simulator only",
        };
        (approval, approval.name(), help)
    }))
}

/// Arguments of the screen, live and in replay.
#[derive(Debug, Clone, Args)]
pub struct ScreenArguments {
    /// Draw ASCII characters only, for terminals without braille
    #[arg(long)]
    pub ascii: bool,
    /// Colours
    #[arg(long, value_name = "WHICH", default_value = "auto", value_parser = colour())]
    pub color: ColourChoice,
    /// Background that the colours suit
    #[arg(long, value_name = "WHICH", default_value = "auto", value_parser = theme())]
    pub theme: ThemeChoice,
    /// Picture of the robot
    #[arg(long, value_name = "WHICH", default_value = "auto", value_parser = graphics())]
    pub graphics: GraphicsChoice,
    /// Draw fewer frames and colours, for a slow link
    #[arg(long)]
    pub low_bandwidth: bool,
}

#[derive(Debug, Args)]
pub struct ConsoleArguments {
    /// Robot to drive
    #[arg(long, value_name = "WHICH", default_value = "sim", value_parser = machine())]
    robot: Machine,
    /// Address of the robot, with `--robot go1` [default: from its robot.toml]
    #[arg(long, value_name = "HOST:PORT")]
    address: Option<String>,
    #[command(flatten)]
    dds: DdsArguments,
    /// Task of the study [default: forward]
    #[arg(long, value_name = "TASK", value_parser = arguments::task())]
    task: Option<Task>,
    /// Seed of the study [default: from optimize.toml]
    #[arg(long, value_name = "N", value_parser = whole_number(0_u32..=u32::MAX))]
    seed: Option<u32>,
    #[command(flatten)]
    study: StudyArguments,
    /// Continue the study in this folder
    #[arg(long, value_name = "DIR", add = ArgValueCandidates::new(completion::studies))]
    resume: Option<PathBuf>,
    /// Continue a study that was made on another robot, or between simulator and robot
    #[arg(long, requires = "resume")]
    accept_backend_change: bool,
    /// Observe only: a robot of `--robot go1` or `--robot go2` is sent nothing but the damping of a STOP
    #[arg(long, conflicts_with_all = ["resume", "approve"])]
    observe: bool,
    /// Jumps that wait for the operator's approval and verdict
    #[arg(long, value_name = "WHAT", default_value = "each", value_parser = approval())]
    approve: Approval,
    /// Show the session to Foxglove on this machine, view only: open a connection to ws://127.0.0.1:8765 there
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = live::DEFAULT)]
    live: Option<String>,
    #[command(flatten)]
    screen: ScreenArguments,
}

pub fn run(arguments: &ConsoleArguments) -> Result<(), Failure> {
    let (backend, model) = match arguments.robot {
        Machine::Simulator => (Backend::Simulator, DEFAULT_MODEL),
        Machine::Robot(robot) => (Backend::Hardware, robot.name()),
    };
    if arguments.observe && backend == Backend::Simulator {
        let text =
            "--observe: the simulated robot moves by this session's commands alone; add --robot go1 or --robot go2";
        return Err(Failure::input(format!("{text}, or watch a running session: quadfrog attach")));
    }
    let (model, files, robot) = arguments.study.load_robot(model, arguments.resume.as_deref())?;
    let (config, continued) = arguments.study.load_config(&files, arguments.resume.as_deref())?;
    let network = network(arguments, &files, &model)?;
    let console = options(&arguments.screen, &config)?;
    let selected = match &arguments.resume {
        Some(folder) => study_to_continue(folder, arguments.task, arguments.seed, &robot)?,
        None => {
            let task = arguments.task.unwrap_or(Task::Forward);
            let seed = arguments.seed.unwrap_or(config.optimize.sampler.seed);
            SelectedStudy {
                name: None,
                task,
                seed,
                folder: arguments.study.new_folder(task, seed),
                new: true,
                budget: None,
            }
        }
    };
    let console = console.with_robot(RobotFacts::new(robot.clone(), &config, backend, selected.seed.into()));
    // The folder of a new study is not made yet: another session may have its name.
    let (earlier, incomplete) = match &arguments.resume {
        Some(folder) => (recordings_in(folder), unfinished_in(folder)),
        None => (Vec::new(), Vec::new()),
    };
    let console = console.with_earlier(earlier);
    let mut options = Options {
        seed: selected.seed,
        trials: arguments.study.trials.or(selected.budget),
        folder: (!arguments.observe).then(|| selected.folder.clone()),
        study: selected.name.clone().filter(|_| !arguments.observe),
        observe: arguments.observe,
        accept_backend_change: arguments.accept_backend_change,
        approve: arguments.approve,
        // The running program, even if its file was replaced since the start.
        guard: Some(PathBuf::from("/proc/self/exe")),
        unseen_connection: TerminalLocation::of(|name| std::env::var(name).ok()).unseen().map(str::to_owned),
        network,
        ..Options::new(config, robot, backend, selected.task)
    };
    // All that needs no robot, before it is taken over from its own controller.
    engine::check_backend(&options)?;
    engine::check_budget(&options)?;
    options.config.settings(&options.robot, options.task, options.backend)?;
    terminal::check().map_err(Failure::input)?;
    options.provenance = arguments.study.provenance();
    options.live = arguments.live.as_deref().map(live::start).transpose()?;
    // An observer writes no files.
    let selected = if arguments.observe { selected } else { selected.with_folder()? };
    let folder = selected.folder;
    options.folder = (!arguments.observe).then(|| folder.clone());
    let takeover = Arc::<Takeover>::default();
    let released = match &options.network {
        Some(network) if !arguments.observe => take_over(network, arguments, &model, &options.robot, &takeover)?,
        _ => None,
    };
    let ended = run_session(options, console, continued, &takeover);
    // A terminal that has hung up shows nothing.
    let hung_up = matches!(ended, Ok((ConsoleExit::HungUp, _)));
    if let Some(controller) = released.filter(|_| !hung_up) {
        put_line!("{}", way_back(arguments, &model, &controller, IS_RELEASED));
    }
    let (exit, recorded) = ended?;
    let recording = recorded.as_ref().map(|status| match status {
        // With the sessions before.
        RecorderStatus { finished: true, .. } | RecorderStatus { files: 2.., .. } => folder.clone(),
        // With an error the recording keeps the name of one that is written.
        RecorderStatus { file, .. } => part_of(file),
    });
    let failure = recorded.filter(|status| !status.finished || status.incomplete().is_some()).map(|status| {
        let cause = status.incomplete().unwrap_or("the recorder ended early; please report it");
        Failure::Other(anyhow!("the recording is not complete: {cause}"))
    });
    if exit == ConsoleExit::HungUp || arguments.observe {
        return failure.map_or(Ok(()), Err);
    }
    output::unbroken("The study and its recording are in", &folder.display().to_string());
    output::unbroken("  continue the study: ", &format!("quadfrog --resume {}", shell_word(&folder)));
    if let Some(recording) = recording {
        output::unbroken("  play the recording: ", &format!("quadfrog replay {}", shell_word(&recording)));
    }
    output::unbroken("  show its trials:    ", &format!("quadfrog study show {}", shell_word(&folder)));
    output::unbroken("  make its report:    ", &format!("quadfrog report {}", shell_word(&folder)));
    for part in incomplete {
        output::unbroken("  repair an incomplete recording: ", &format!("quadfrog recover {}", shell_word(&part)));
    }
    failure.map_or(Ok(()), Err)
}

/// Runs the engine with its console. Returns the way in which the console ended, and the last status of the recorder.
fn run_session(
    options: Options,
    console: ConsoleOptions,
    continued: Option<String>,
    takeover: &Takeover,
) -> Result<(ConsoleExit, Option<RecorderStatus>), Failure> {
    let handle = engine::start(options)?;
    if let Some(continued) = continued {
        notice!("{continued}");
    }
    let recorder = handle.recorder_watch();
    notice_waits(None);
    *takeover.phase() = TakeoverPhase::Running;
    let exit = app::run(Feed::live(handle), console)?;
    Ok((exit, recorder.map(|recorder| recorder.get())))
}

/// A takeover, until the console runs. A signal in this time ends the program once the way back was printed.
#[derive(Debug, Default)]
struct Takeover {
    interrupted: AtomicBool,
    phase: Mutex<TakeoverPhase>,
}

/// Phase of a takeover: it decides over a signal.
#[derive(Debug, Default)]
enum TakeoverPhase {
    /// A signal interrupts the takeover.
    #[default]
    TakingOver,
    /// The engine starts: a signal prints the way back of a released controller, and ends the program.
    Starting(Option<String>),
    /// The console takes the signals.
    Running,
}

impl Takeover {
    /// Begins to take signals.
    fn watch_signals(self: &Arc<Takeover>) -> Result<(), Failure> {
        let takeover = self.clone();
        let act = move |signal| {
            takeover.interrupted.store(true, Ordering::Release);
            if let TakeoverPhase::Starting(way_back) = &*takeover.phase() {
                if let Some(text) = way_back {
                    put_line!("{text}");
                }
                std::process::exit(exit_status(signal).into());
            }
        };
        on_signal(act).map_err(|error| Failure::Other(anyhow!("signals cannot be received: {error}")))
    }

    fn phase(&self) -> MutexGuard<'_, TakeoverPhase> {
        self.phase.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// State of the robot's own controller after a takeover, in [`way_back`].
const IS_RELEASED: &str = "is released, the legs are not supported";

/// Returns the text with the command that starts the robot's own controller again. `state` is what is known about it.
fn way_back(arguments: &ConsoleArguments, model: &str, controller: &str, state: &str) -> String {
    let DdsArguments { interface, domain } = &arguments.dds;
    let option =
        |name: &str, value: Option<String>| value.map_or_else(String::new, |value| format!(" --{name} {value}"));
    let model = option("model", (model != RealRobot::Go2.name()).then(|| shell_word(Path::new(model))));
    let interface = option("interface", interface.clone());
    let domain = option("domain", domain.map(|domain| domain.to_string()));
    format!(
        "The robot's own controller {controller} {state}. To start it again, lying:\n  \
         quadfrog give-back --controller {controller}{model}{interface}{domain}"
    )
}

/// Returns the settings of the network to the robot; none for the simulator, which takes no address.
fn network(arguments: &ConsoleArguments, files: &RobotFiles, model: &str) -> Result<Option<Network>, Failure> {
    let Machine::Robot(robot) = arguments.robot else {
        if let Some(text) = &arguments.address {
            return Err(Failure::input(format!("--address {text}: the simulator has none; add --robot go1")));
        }
        arguments.dds.refuse("the simulator has none")?;
        return Ok(None);
    };
    let mut network = robot.network(files, model)?;
    match (&arguments.address, &mut network) {
        (Some(text), Network::Go1(network)) => {
            network.address = arguments::address("--address", text, "192.168.123.10:8007")?;
        }
        (Some(text), Network::Go2(_)) => {
            return Err(Failure::input(format!(
                "--address {text}: a Go2 is found in its DDS domain; give --interface and --domain"
            )));
        }
        (None, _) => {}
    }
    arguments.dds.apply(&mut network)?;
    if !cfg!(feature = "go2") && matches!(network, Network::Go2(_)) {
        return Err(Failure::input(HardwareError::WithoutGo2));
    }
    Ok(Some(network))
}

/// Takes the robot over from its own controller, once the operator has agreed. Returns the name of the released controller.
fn take_over(
    network: &Network,
    arguments: &ConsoleArguments,
    model: &str,
    robot: &RobotDescription,
    takeover: &Arc<Takeover>,
) -> Result<Option<String>, Failure> {
    if matches!(network, Network::Go1(_)) {
        return Ok(None);
    }
    put_line!("The robot is asked to lie down, then its own controller is released: its legs lose their support.");
    put_line!("Keep clear of it, and hold its remote: L2+B damps it. Type yes to go on:");
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).context("the answer cannot be read")?;
    if answer.trim() != "yes" {
        return Err(Failure::input("the robot was not taken over: the answer was not yes"));
    }
    takeover.watch_signals()?;
    let interrupted = &takeover.interrupted;
    let taken = network.take_over(&robot.lying_position, interrupted, &mut |step| put_line!("  {step}"));
    let released = taken.map_err(|error| {
        if let Some(controller) = error.released_controller() {
            put_line!("{}", way_back(arguments, model, controller, "may be released: the legs may not be supported"));
        }
        if interrupted.load(Ordering::Acquire) { Failure::Other(error.into()) } else { Failure::input(error) }
    })?;
    let text = released.as_ref().map(|controller| way_back(arguments, model, controller, IS_RELEASED));
    *takeover.phase() = TakeoverPhase::Starting(text.clone());
    // A signal between the last request and this phase.
    if interrupted.load(Ordering::Acquire) {
        put_line!("{}", text.unwrap_or_default());
        return Err(Failure::Other(anyhow!("interrupted by the operator")));
    }
    Ok(released)
}

/// Returns the name of a recording while it is written.
fn part_of(recording: &Path) -> PathBuf {
    recording.with_extension("mcap.part")
}

/// Returns the settings of `console.toml`.
pub fn settings(config: &Config) -> Result<ConsoleSettings, ConfigError> {
    ConsoleSettings::from_table(&config.console)
        .map_err(|error| config.refuse("console.toml", &error.key, &error.value, &error.reason))
}

/// Returns the console's options from the arguments and `console.toml`.
pub fn options(screen: &ScreenArguments, config: &Config) -> Result<ConsoleOptions, Failure> {
    let colours = (screen.color != ColourChoice::Auto).then_some(screen.color);
    let mut settings = settings(config)?;
    if screen.graphics != GraphicsChoice::Auto {
        settings.graphics = screen.graphics;
    }
    Ok(ConsoleOptions::new(settings, colours, screen.theme, screen.ascii, screen.low_bandwidth))
}
