//! `quadfrog completions`: completion in the shell, with the studies, sessions, robots and trials of this machine.
//!
//! The shell's script calls the program with [`VARIABLE`] set; the program answers and ends before it does anything else.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::output;
use anyhow::Context as _;
use clap::{Args, Command, ValueEnum};
use clap_complete::env::{Bash, EnvCompleter, Fish, Zsh};
use clap_complete::{CompleteEnv, CompletionCandidate};
use quadfrog::config::Config;
use quadfrog::engine::{RunningSession, STUDY_FILE, find_sessions, open_stored, stored_studies, study_files};
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::Trial;
use quadfrog::robot::description::RobotDescription;

use super::failure::Failure;

/// Environment variable with the name of the shell that completes a command line.
const VARIABLE: &str = "QUADFROG_COMPLETE";

#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// A shell that can complete command lines of the program.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Shell {
    Bash,
    Zsh,
    Fish,
}

/// Prints the script that registers the completion in the shell.
pub fn run(arguments: &CompletionsArguments) -> Result<(), Failure> {
    let script = registration(arguments.shell).context("the script of the completion cannot be written")?;
    output::data(&script);
    Ok(())
}

/// Returns the script that registers the completion in `shell`.
pub fn registration(shell: Shell) -> anyhow::Result<String> {
    let completer: &dyn EnvCompleter = match shell {
        Shell::Bash => &Bash,
        Shell::Zsh => &Zsh,
        Shell::Fish => &Fish,
    };
    let mut script = Vec::new();
    completer.write_registration(VARIABLE, "quadfrog", "quadfrog", "quadfrog", &mut script)?;
    Ok(String::from_utf8(script)?)
}

/// Answers a shell that completes a command line of `program`, and ends; does nothing otherwise.
pub fn answer_shell(program: impl Fn() -> Command) {
    CompleteEnv::with_factory(program).var(VARIABLE).complete();
}

/// Returns the studies below `recordings`, for the places of studies.
pub fn studies() -> Vec<CompletionCandidate> {
    let files = study_files(Path::new("recordings")).unwrap_or_default();
    let candidate = |file: &PathBuf| {
        let folder = file.parent().filter(|folder| *folder != Path::new("")).unwrap_or(file);
        let stored = stored_studies(&Storage::File(file.clone())).ok()?.into_iter().next()?;
        let help = format!("{}, seed {}, {}", stored.task.name(), stored.seed, stored.robot);
        Some(CompletionCandidate::new(folder.as_os_str()).help(Some(help.into())))
    };
    files.iter().filter_map(candidate).collect()
}

/// Returns the sessions that run on this machine under this user.
pub fn sessions() -> Vec<CompletionCandidate> {
    let running = find_sessions().running;
    let candidate = |session: &RunningSession| {
        let facts = &session.facts;
        CompletionCandidate::new(facts.folder.as_os_str()).help(Some(format!("process {}", facts.process).into()))
    };
    running.iter().map(candidate).collect()
}

/// Returns the built-in robots and the folders of other ones below `robots`.
pub fn robots() -> Vec<CompletionCandidate> {
    let mut found: Vec<_> = RobotDescription::embedded_names().map(CompletionCandidate::new).collect();
    let folders = std::fs::read_dir("robots").into_iter().flatten().flatten().map(|entry| entry.path());
    let own = folders.filter(|folder| folder.join("robot.toml").is_file());
    found.extend(own.map(|folder| CompletionCandidate::new(OsStr::new(&folder))));
    found
}

/// Returns the trials of the study whose folder, or a file of whose folder, the command line names.
pub fn trials() -> Vec<CompletionCandidate> {
    let places = std::env::args_os().skip(1).map(PathBuf::from);
    let folder = |place: PathBuf| if place.is_dir() { Some(place) } else { place.parent().map(Path::to_owned) };
    let journal = places.filter_map(folder).map(|folder| folder.join(STUDY_FILE)).find(|journal| journal.is_file());
    let Ok(config) = Config::layered(&[]) else { return Vec::new() };
    let opened = journal.and_then(|journal| open_stored(&Storage::File(journal), None, &config).ok());
    let Some(opened) = opened else { return Vec::new() };
    let candidate = |trial: &Trial| {
        let help = trial.value.map(|value| format!("{value:.3} {}", opened.unit()).into());
        CompletionCandidate::new(trial.number.to_string()).help(help)
    };
    opened.study.trials().iter().map(candidate).collect()
}
