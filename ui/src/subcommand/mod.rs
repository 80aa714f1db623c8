//! The command line: one file per subcommand; without a subcommand the console opens.

mod arguments;
mod ask_tell;
mod attach;
mod bench;
mod completion;
mod configuration;
mod console;
mod damage;
mod doctor;
mod emulate;
mod evaluate;
mod export;
mod failure;
mod give_back;
mod guard;
mod init;
mod interrupt;
mod live;
mod man;
mod optimize;
mod output_file;
mod prior;
mod progress;
mod recover;
mod rejudge;
mod replay;
mod report;
mod reproduce;
mod screenshot;
mod selection;
mod study;
mod table;
mod verify;

use clap::{Arg, Command, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::output;
pub use arguments::VERSION;
pub use completion::answer_shell;
pub use failure::Failure;
pub use progress::{minutes, seconds_left};
use quadfrog::optimize::journal::notice_waits;
pub use reproduce::{EXAMPLES, ExperimentConfiguration};

/// Optimize the jumps of a quadruped, on the robot or on the built-in simulator.
///
/// Without a subcommand the console opens on the simulator; its last line names the next key.
#[derive(Debug, Parser)]
#[command(name = "quadfrog", version = VERSION, max_term_width = 100, args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Subcommands>,
    #[command(flatten)]
    console: console::ConsoleArguments,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    /// Run a complete study on the simulator without a screen
    Optimize(optimize::OptimizeArguments),
    /// Simulate the robots of the sampler sim before a study
    Prior(prior::PriorArguments),
    /// Run a sampler for any program: JSON lines on standard input and output
    #[command(name = "ask-tell")]
    AskTell(ask_tell::AskTellArguments),
    /// Run one point over several seeds on the simulator: falls, value, attitude
    Evaluate(evaluate::EvaluateArguments),
    /// Run the experiments of the paper on the simulator and compare them with its statements
    Reproduce(reproduce::ReproduceArguments),
    /// Play a recorded session in the console's panels
    Replay(replay::ReplayArguments),
    /// Watch a session that runs on this machine, with STOP
    Attach(attach::AttachArguments),
    /// List the sessions that run on this machine under this user
    Sessions,
    /// Judge recorded trials by another configuration: suggestions, old beside new
    Rejudge(rejudge::RejudgeArguments),
    /// Export the signals of a recording as CSV, JSON or Parquet
    Export(export::ExportArguments),
    /// Draw the screen of a replay as an SVG picture
    Screenshot(screenshot::ScreenshotArguments),
    /// Repair an incomplete recording
    Recover(recover::RecoverArguments),
    /// Run a simulated session again from its recording alone and compare every tick
    Verify(verify::VerifyArguments),
    /// Serve the simulator as a Go1 or Go2 on the network, with fault injection
    Emulate(emulate::EmulateArguments),
    /// Start the own controller of a Go2 again, which a session has released
    #[command(name = "give-back")]
    GiveBack(give_back::GiveBackArguments),
    /// Measure the simulator's speed on this machine
    Bench(bench::BenchArguments),
    /// Check whether this machine can run the console and control a robot, with remedies
    Doctor(doctor::DoctorArguments),
    /// Damp the robot when the parent process has ended
    #[command(name = quadfrog::engine::GUARD, hide = true)]
    Guard,
    /// List, show, export, import and extend studies
    Study(study::StudyCommand),
    /// Show, compare, check and begin configurations
    Config(configuration::ConfigCommand),
    /// Begin the description of a new robot from its URDF
    Init(init::InitArguments),
    /// Print the script with which a shell completes command lines: source <(quadfrog completions bash)
    Completions(completion::CompletionsArguments),
    /// Write the manual pages
    Man(man::ManArguments),
    /// Report studies: tables on the terminal, one HTML file with figures, SVG files, JSON
    Report(report::ReportArguments),
}

impl Subcommands {
    /// Whether a signal ends it by [`interrupt`]: the others have a screen, drive a robot, or outlive the signals.
    fn ends_by_signal(&self) -> bool {
        use Subcommands::{Attach, Emulate, GiveBack, Guard, Replay};
        !matches!(self, Attach(_) | Emulate(_) | GiveBack(_) | Guard | Replay(_))
    }
}

impl Arguments {
    /// Parses the command line of the process.
    ///
    /// # Errors
    /// Unusable arguments; help or version, which are asked for.
    pub fn of_process() -> Result<Arguments, clap::Error> {
        let mut command = take_negative_numbers(Arguments::command());
        let matches = command.try_get_matches_from_mut(std::env::args_os())?;
        Arguments::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
    }
}

/// Lets every option take a negative number: its own parser says what is asked for, where clap would call it an unknown option.
fn take_negative_numbers(command: Command) -> Command {
    let take = |arg: Arg| {
        let takes = arg.get_action().takes_values() && !arg.is_positional();
        arg.allow_negative_numbers(takes)
    };
    command.mut_args(take).mut_subcommands(take_negative_numbers)
}

/// Carries out a command line.
///
/// # Errors
/// Unusable input, or the reason for which the command ended before it was done.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    // While the console has the screen it shows the waits there.
    notice_waits(Some(Box::new(output::notice)));
    if arguments.command.as_ref().is_some_and(Subcommands::ends_by_signal) {
        interrupt::handle_signals();
    }
    match arguments.command {
        None => console::run(&arguments.console),
        Some(Subcommands::Optimize(optimize)) => optimize::run(&optimize),
        Some(Subcommands::Prior(prior)) => prior::run(&prior),
        Some(Subcommands::AskTell(ask_tell)) => ask_tell::run(&ask_tell),
        Some(Subcommands::Evaluate(evaluate)) => evaluate::run(&evaluate),
        Some(Subcommands::Reproduce(reproduce)) => reproduce::run(&reproduce),
        Some(Subcommands::Replay(replay)) => replay::run(&replay),
        Some(Subcommands::Attach(attach)) => attach::run(&attach),
        Some(Subcommands::Sessions) => attach::list(),
        Some(Subcommands::Rejudge(rejudge)) => rejudge::run(&rejudge),
        Some(Subcommands::Export(export)) => export::run(&export),
        Some(Subcommands::Screenshot(screenshot)) => screenshot::run(&screenshot),
        Some(Subcommands::Recover(recover)) => recover::run(&recover),
        Some(Subcommands::Verify(verify)) => verify::run(&verify),
        Some(Subcommands::Emulate(emulate)) => emulate::run(&emulate),
        Some(Subcommands::GiveBack(give_back)) => give_back::run(&give_back),
        Some(Subcommands::Bench(bench)) => bench::run(&bench),
        Some(Subcommands::Doctor(doctor)) => doctor::run(&doctor),
        Some(Subcommands::Guard) => guard::run(),
        Some(Subcommands::Study(study)) => study::run(&study),
        Some(Subcommands::Config(config)) => configuration::run(&config),
        Some(Subcommands::Init(init)) => init::run(&init),
        Some(Subcommands::Completions(completions)) => completion::run(&completions),
        Some(Subcommands::Man(man)) => man::run(&man, Arguments::command()),
        Some(Subcommands::Report(report)) => report::run(&report),
    }
}
