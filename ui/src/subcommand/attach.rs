//! `quadfrog attach` and `quadfrog sessions`: running sessions on this machine, seen by a second person.

use std::path::PathBuf;

use crate::app;
use crate::feed::Feed;
use crate::{notice, output, terminal};
use anyhow::{Context, anyhow};
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

#[derive(Debug, Args)]
pub struct AttachArguments {
    /// The session: number of its process or folder of its study, as `quadfrog sessions` lists them [default: the only one]
    #[arg(value_name = "SESSION", add = ArgValueCandidates::new(completion::sessions))]
    session: Option<String>,
    /// Your name in the session's log [default: the user's name]
    #[arg(long, value_name = "NAME", value_parser = arguments::operator)]
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
    let session = choose(arguments.session.as_deref(), sessions()?)?;
    let files = recordings_of(&session.facts.folder)?;
    let mut recording = Timeline::open(&files)?;
    terminal::check().map_err(Failure::input)?;
    let console = console.with_robot(recorded_robot(&mut recording));
    let name = arguments::operator_or_user(arguments.operator.as_ref());
    let observer = Observer::join(session, &name).context("the session ended")?;
    app::run(Feed::attached(recording, observer), console)?;
    Ok(())
}

/// Lists the sessions that run.
pub fn list() -> Result<(), Failure> {
    let sessions = sessions()?;
    if sessions.is_empty() {
        notice!("no session runs on this machine under this user");
        return Ok(());
    }
    let heading = ["process", "robot", "task", "operator", "since (UTC)", "folder"].map(str::to_owned).to_vec();
    let row = |session: &RunningSession| {
        let SessionFacts { process, folder, robot, backend, task, operator, since } = &session.facts;
        let (process, robot, folder) =
            (process.to_string(), format!("{backend} {robot}"), folder.display().to_string());
        vec![process, robot, task.clone(), operator.clone(), since.clone(), folder]
    };
    let rows: Vec<_> = std::iter::once(heading).chain(sessions.iter().map(row)).collect();
    output::text(&table::aligned(&rows, |_| true));
    Ok(())
}

fn sessions() -> Result<Vec<RunningSession>, Failure> {
    let FoundSessions { running, silent } =
        find_sessions().map_err(|error| Failure::Other(anyhow!("sessions: {error}")))?;
    for (socket, error) in silent {
        notice!("{}: {error}", socket.display());
    }
    Ok(running)
}

fn described(facts: &SessionFacts) -> String {
    let SessionFacts { process, folder, robot, backend, task, operator, since } = facts;
    format!("{process}  {backend} {robot}  {task}  {operator}, since {since}  {}", folder.display())
}

/// Returns the session that is meant.
fn choose(named: Option<&str>, sessions: Vec<RunningSession>) -> Result<RunningSession, Failure> {
    let known: Vec<String> = sessions.iter().map(|session| described(&session.facts)).collect();
    let meant = |session: &RunningSession| {
        let Some(named) = named else { return true };
        let folder = std::fs::canonicalize(named).ok();
        named.parse() == Ok(session.facts.process)
            || folder.is_some() && std::fs::canonicalize(&session.facts.folder).ok() == folder
    };
    let mut found: Vec<RunningSession> = sessions.into_iter().filter(meant).collect();
    let of_named = named.map(|named| format!("{named}: ")).unwrap_or_default();
    match (found.pop(), found.is_empty()) {
        (Some(session), true) => Ok(session),
        (Some(_), false) => Err(Failure::input(format!(
            "{of_named}several sessions run; give the number or the folder of one:\n{}",
            known.join("\n")
        ))),
        (None, _) if known.is_empty() => {
            Err(Failure::input(format!("{of_named}no session runs on this machine under this user")))
        }
        (None, _) => Err(Failure::input(format!(
            "{of_named}no session of that number or folder runs; these run:\n{}",
            known.join("\n")
        ))),
    }
}
