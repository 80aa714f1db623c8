//! TOML files to checked values. The files of `config/` are embedded as the defaults; another folder may replace any of
//! their keys. A key that the defaults do not have is rejected with file, line and the nearest known key.

mod checked;
mod export;
mod files;
mod merge;
mod ranges;
mod rules;

pub use checked::Config;
pub use files::{ConfirmFile, ControlFile, OptimizeFile, SafetyFile, WorkersFile};

use std::path::PathBuf;

/// Error of a configuration: file, key, value and remedy.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The folder does not exist.
    #[error("{}: no such configuration folder; give a folder that holds control.toml, safety.toml, ... or leave --config away", path.display())]
    NoFolder {
        /// The folder.
        path: PathBuf,
    },
    /// A file that is not read: probably a misspelt name.
    #[error("{}: not a configuration file; the files are {known}", path.display())]
    UnknownFile {
        /// The file.
        path: PathBuf,
        /// Names of the files that are read.
        known: String,
    },
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file cannot be written, or exists already.
    #[error("{}: cannot be written: {source}; give a new folder", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{file}:{line}: {message}")]
    Syntax {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Message of the parser.
        message: String,
    },
    /// A key that does not exist.
    #[error("{file}:{line}: unknown key `{key}`{}", nearest.as_ref().map(|k| format!("; did you mean `{k}`?")).unwrap_or_default())]
    UnknownKey {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The key with its tables.
        key: String,
        /// The most similar known key.
        nearest: Option<String>,
    },
    /// A value of the wrong kind.
    #[error("{file}:{line}: `{key}` must be {expected}, not {found}")]
    Kind {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The key with its tables.
        key: String,
        /// Kind of the default.
        expected: String,
        /// Value in the file.
        found: String,
    },
    /// A value that is not allowed.
    #[error("{file}: `{key}` = {value}: {reason}")]
    Value {
        /// The file, with the line if the file has the key.
        file: String,
        /// The key with its tables.
        key: String,
        /// Value in the file.
        value: String,
        /// Reason, with the allowed values.
        reason: String,
    },
}
