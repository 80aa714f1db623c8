//! Observers of a running session on the same machine: they read the recording while it is written, and reach the session over a
//! Unix socket, where they learn what runs and may set STOP. Nothing else is accepted.
//!
//! The socket is in a folder that this user alone may enter, one for each process. A line of JSON each way: the session sends
//! [`Answer`]s, an observer sends [`Demand`]s.

mod client;
mod server;

use std::fs::DirBuilder;
use std::io::{self, BufRead, Read};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use nix::unistd::geteuid;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::recording::record::LogLevel;

pub use client::{FoundSessions, Observer, ObserverStatus, RunningSession, find_sessions};
pub use server::ObserverServer;

/// Longest line either end accepts, bytes.
const LONGEST_LINE: u64 = 16_384;

/// Begin of the warning about a STOP of an observer; the name follows.
const STOP_BY: &str = "STOP by ";

/// End of that message.
pub const WHO_WATCHES: &str = ", who watches this session";

/// News of the observers, for the session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SessionNews {
    /// An observer has set STOP; its name with [`WHO_WATCHES`].
    Stop(String),
    /// An observer has come or gone; a line for the log.
    Attendance(String),
}

impl SessionNews {
    /// Returns the line of the log.
    pub fn line(self) -> (LogLevel, String) {
        match self {
            SessionNews::Stop(observer) => (LogLevel::Warning, format!("{STOP_BY}{observer}")),
            SessionNews::Attendance(line) => (LogLevel::Info, line),
        }
    }
}

/// Whether a line of the session's log, or the message with it, is that of [`SessionNews::Stop`]. The text alone does not say it: an
/// observer may be called so.
pub fn is_stop_of_observer(level: LogLevel, text: &str) -> bool {
    level == LogLevel::Warning && text.starts_with(STOP_BY)
}

/// Facts of a running session, for those who want to observe it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SessionFacts {
    /// Number of its process.
    pub process: u32,
    /// Folder of its study and recording, absolute.
    pub folder: PathBuf,
    /// Name of the robot.
    pub robot: String,
    /// Name of the backend, `sim` or `hardware`.
    pub backend: String,
    /// Name of the task.
    pub task: String,
    /// Name of the operator.
    pub operator: String,
    /// Begin, UTC, to the second (RFC 3339).
    pub since: String,
}

/// Message of an observer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Demand {
    /// It watches from now on, under this name.
    Watch(String),
    /// STOP.
    Stop,
}

/// Message of the session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    /// At the begin of a connection.
    Session(SessionFacts),
    /// STOP is set.
    Stopped,
}

/// Returns a message as a line.
fn line(message: &impl Serialize) -> io::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(message)?;
    line.push(b'\n');
    Ok(line)
}

/// Reads on in a message, of which `received` has the beginning: none while its line is not complete, at the end of the read
/// timeout too.
///
/// # Errors
/// When the other end has closed the connection, or sent something else.
fn read_message<T: DeserializeOwned>(reader: &mut impl BufRead, received: &mut Vec<u8>) -> io::Result<Option<T>> {
    match reader.by_ref().take(LONGEST_LINE).read_until(b'\n', received) {
        Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
        Err(error) if !matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {
            return Err(error);
        }
        _ => {}
    }
    if received.ends_with(b"\n") {
        return Ok(Some(serde_json::from_slice(&std::mem::take(received))?));
    }
    match received.len() as u64 >= LONGEST_LINE {
        true => Err(io::Error::new(io::ErrorKind::InvalidData, "a line without an end")),
        false => Ok(None),
    }
}

/// Returns the folders that may hold sockets, the one for new ones first: `QUADFROG_SESSIONS` alone where it is set; else over SSH,
/// sudo or cron the environment may lack the first.
fn socket_folders() -> Vec<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if let Some(folder) = variable("QUADFROG_SESSIONS") {
        return vec![folder];
    }
    let of_user = variable("XDG_RUNTIME_DIR").map(|folder| folder.join("quadfrog"));
    of_user.into_iter().chain([PathBuf::from(format!("/tmp/quadfrog-{}", geteuid()))]).collect()
}

/// Makes the folder for new sockets, which only this user may enter.
///
/// # Errors
/// When it cannot be made, or is another user's or open to others.
fn make_socket_folder() -> io::Result<PathBuf> {
    let folder = socket_folders().swap_remove(0);
    let named = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", folder.display()));
    match DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(named(error)),
        _ => {}
    }
    require_own(&folder).map_err(named)?;
    Ok(folder)
}

/// Refuses a folder of sockets that is another user's, open to others, or a link: any user can make one in `/tmp`, with sockets that
/// answer as a session does.
///
/// # Errors
/// When it is one, or cannot be examined.
fn require_own(folder: &Path) -> io::Result<()> {
    let found = folder.symlink_metadata()?;
    if found.is_dir() && found.uid() == geteuid().as_raw() && found.mode() & 0o077 == 0 {
        return Ok(());
    }
    let reason = "not a folder of this user alone; remove it, or give its permissions to its owner alone";
    Err(io::Error::new(io::ErrorKind::PermissionDenied, reason))
}
