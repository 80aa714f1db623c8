//! The error of a command and its exit status.

use quadfrog::config::ConfigError;
use quadfrog::engine::EngineError;
use quadfrog::optimize::journal::JournalError;
use quadfrog::optimize::study::StudyError;
use quadfrog::recording::RecordingError;

/// The reason for which a command ends before it is done.
pub enum Failure {
    /// Unusable input, with the remedy; exit status 2.
    Input(String),
    /// Every other error; exit status 1.
    Other(color_eyre::Report),
}

impl Failure {
    pub fn input(message: impl ToString) -> Failure {
        Failure::Input(message.to_string())
    }

    /// Prints the message on standard error.
    pub fn print(&self) {
        match self {
            Failure::Input(message) => eprintln!("quadfrog: {message}"),
            Failure::Other(report) => eprintln!("quadfrog: {report:?}"),
        }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Failure {
        Failure::input(error)
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Failure {
        match &error {
            EngineError::System { .. }
            | EngineError::Study(StudyError::Journal(JournalError::Io { .. } | JournalError::Redis { .. }))
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

impl From<color_eyre::Report> for Failure {
    fn from(report: color_eyre::Report) -> Failure {
        Failure::Other(report)
    }
}
