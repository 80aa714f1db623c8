//! The error of a command and its exit status.

use std::io;
use std::path::Path;

use crate::notice;
use anyhow::anyhow;
use nix::sys::signal::Signal;
use quadfrog::config::ConfigError;
use quadfrog::engine::EngineError;
use quadfrog::optimize::journal::JournalError;
use quadfrog::optimize::study::StudyError;
use quadfrog::recording::RecordingError;

use super::interrupt::exit_status;

/// The reason for which a command ends before it is done.
pub enum Failure {
    /// Unusable input, with the remedy; exit status 2.
    Input(String),
    /// Every other error; exit status 1.
    Other(anyhow::Error),
    /// A signal has ended the command after its work was put in order; exit status 128 and the signal's number.
    Interrupted(Signal),
}

impl Failure {
    /// Unusable input, with a message that names it and the remedy.
    pub fn input(message: impl ToString) -> Failure {
        Failure::Input(message.to_string())
    }

    /// Returns the exit status of the program.
    pub fn status(&self) -> u8 {
        match self {
            Failure::Input(_) => 2,
            Failure::Other(_) => 1,
            Failure::Interrupted(signal) => exit_status(*signal),
        }
    }

    /// Prints the message on standard error.
    pub fn print(&self) {
        match self {
            Failure::Input(message) => notice!("{message}"),
            Failure::Other(error) => notice!("{}", with_causes(error)),
            // Printed when the signal came.
            Failure::Interrupted(_) => {}
        }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Failure {
        EngineError::from(error).into()
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Failure {
        match &error {
            EngineError::Config(ConfigError::Write { path, source }) => not_written(path, source),
            EngineError::System { .. }
            | EngineError::Study(StudyError::Journal(
                JournalError::Io { .. }
                | JournalError::Redis { .. }
                | JournalError::RedisShortened { .. }
                | JournalError::RedisUncounted { .. }
                | JournalError::ServerWaitEnded { .. },
            ))
            | EngineError::Recording(RecordingError::Io { .. }) => Failure::Other(error.into()),
            _ => Failure::input(error),
        }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Failure {
        EngineError::from(error).into()
    }
}

impl From<anyhow::Error> for Failure {
    fn from(report: anyhow::Error) -> Failure {
        Failure::Other(report)
    }
}

/// Returns the error of a file or a folder that cannot be written. Where another place would do, it is one of the input.
pub fn not_written(path: &Path, error: &io::Error) -> Failure {
    let text = format!("{}: cannot be written: {error}", path.display());
    match is_of_place(error.kind()) {
        true => Failure::input(format!("{text}; give another place")),
        false => Failure::Other(anyhow!(text)),
    }
}

/// Whether an error of the file system is one of the named place, so that another would do.
pub fn is_of_place(error: io::ErrorKind) -> bool {
    use io::ErrorKind::{AlreadyExists, InvalidFilename, IsADirectory, NotADirectory, NotFound};
    use io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
    matches!(error, AlreadyExists | InvalidFilename | IsADirectory | NotADirectory | NotFound)
        || matches!(error, PermissionDenied | ReadOnlyFilesystem)
}

/// Returns the message of an error and of its causes, each once: many messages end with their cause already.
fn with_causes(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text += &format!(": {cause}");
        }
    }
    text
}
