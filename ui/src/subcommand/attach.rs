//! `quadfrog attach` and `quadfrog sessions`: running sessions on this machine, seen by a second person.

use std::io;
use std::path::PathBuf;

use crate::app;
use crate::feed::Feed;
use crate::{notice, output, terminal};
use anyhow::Context;
use clap::Args;
use clap_complete::ArgValueCandidates;
use quadfrog::engine::{FoundSessions, Observer, RunningSession, SessionFacts, find_sessions};
use quadfrog::recording::session_files::recordings_of;
use quadfrog::recording::timeline::Timeline;
use quadfrog::report::table;

use super::arguments;
use super::completion;
use super::console::{ScreenArguments, options};
use super::failure::Failure;
use super::replay::recorded_robot;

/// Answer where there is no session.
const NONE_RUNS: &str = "no session runs on this machine under this user";

#[derive(Debug, Args)]
pub struct AttachArguments {
    /// The session: number of its process or folder of its study, as `quadfrog sessions` lists them [default: the only one]
    #[arg(value_name = "SESSION", add = ArgValueCandidates::new(completion::sessions))]
    session: Option<String>,
    /// Your name in the session's log [default: the user's name]
    #[arg(long, value_name = "NAME", value_parser = arguments::printable_name)]
    operator: Option<String>,
    /// Folder with your own console.toml
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    #[command(flatten)]
    screen: ScreenArguments,
}

/// Watches a running session: what its recording shows, at most some 1.3 s later, and STOP.
pub fn run(arguments: &AttachArguments) -> Result<(), Failure> {
    let config = arguments::load_config(arguments.config.as_deref())?;
    let console = options(&arguments.screen, &config)?;
    let session = choose(arguments.session.as_deref(), sessions())?;
    let files = recordings_of(&session.facts.folder)?;
    let mut recording = Timeline::open(&files)?;
    terminal::check().map_err(Failure::input)?;
    let console = console.with_robot(recorded_robot(&mut recording));
    let name = arguments::operator_or_user(arguments.operator.as_ref());
    let observer = Observer::join(session, &name).context("the session ended")?;
    let status = observer.watch();
    app::run(Feed::attached(recording, observer), console)?;
    if status().stopped < status().demanded {
        notice!("the session did not confirm STOP: look at the robot; its remote and its power switch stop it");
    }
    Ok(())
}

/// Lists the sessions that run.
pub fn list() -> Result<(), Failure> {
    let FoundSessions { running, silent, .. } = sessions();
    if running.is_empty() {
        if !silent.iter().any(hangs) {
            notice!("{NONE_RUNS}");
        }
        return Ok(());
    }
    let heading = ["process", "robot", "task", "operator", "since (UTC)", "folder"].map(str::to_owned).to_vec();
    let row = |session: &RunningSession| {
        let SessionFacts { process, folder, robot, backend, task, operator, since } = &session.facts;
        let (process, robot, folder) =
            (process.to_string(), format!("{backend} {robot}"), folder.display().to_string());
        vec![process, robot, task.clone(), operator.clone(), since.clone(), folder]
    };
    let rows: Vec<_> = std::iter::once(heading).chain(running.iter().map(row)).collect();
    output::text(&table::aligned(&rows, |_| true));
    Ok(())
}

/// Finds the sessions, and names those that do not answer and the folders that were not searched.
fn sessions() -> FoundSessions {
    let found = find_sessions();
    for (folder, error) in &found.skipped {
        notice!("{}: {error}. Sessions in it are not listed", folder.display());
    }
    for silent in &found.silent {
        let (socket, error) = silent;
        let name = socket.file_stem().unwrap_or_default().display();
        match hangs(silent) {
            true => notice!(
                "process {name}: {error}; it is stopped (`kill -CONT {name}` continues it) or hangs, and passes no STOP on"
            ),
            false => notice!("{}: {error}", socket.display()),
        }
    }
    found
}

/// Whether a session is there, named by its process as its socket is, that does not answer.
fn hangs((_, error): &(PathBuf, io::Error)) -> bool {
    error.kind() == io::ErrorKind::TimedOut
}

fn described(facts: &SessionFacts) -> String {
    let SessionFacts { process, folder, robot, backend, task, operator, since } = facts;
    format!("{process}  {backend} {robot}  {task}  {operator}, since {since}  {}", folder.display())
}

/// Returns the session that is meant.
fn choose(named: Option<&str>, sessions: FoundSessions) -> Result<RunningSession, Failure> {
    let FoundSessions { running, silent, .. } = sessions;
    let known: Vec<String> = running.iter().map(|session| described(&session.facts)).collect();
    let meant = |session: &RunningSession| {
        let Some(named) = named else { return true };
        let folder = std::fs::canonicalize(named).ok();
        named.parse() == Ok(session.facts.process)
            || folder.is_some() && std::fs::canonicalize(&session.facts.folder).ok() == folder
    };
    let mut found: Vec<RunningSession> = running.into_iter().filter(meant).collect();
    let of_named = named.map(|named| format!("{named}: ")).unwrap_or_default();
    match (found.pop(), found.is_empty()) {
        (Some(session), true) => Ok(session),
        (Some(_), false) => Err(Failure::input(format!(
            "{of_named}several sessions run; give the number or the folder of one:\n{}",
            known.join("\n")
        ))),
        (None, _) => {
            let text = match known.is_empty() {
                false => format!("no session of that number or folder runs; these run:\n{}", known.join("\n")),
                true if silent.iter().any(hangs) => "no session answers".to_owned(),
                true => NONE_RUNS.to_owned(),
            };
            Err(Failure::input(format!("{of_named}{text}")))
        }
    }
}
