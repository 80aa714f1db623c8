//! TOML files to checked values. The files of `config/` are embedded as the defaults; another folder may replace any of
//! them, whole or key by key. A key that the defaults do not have is refused, with file, line and the nearest known key.

mod checked;
mod export;
mod merge;
mod safety;

pub use checked::{Config, ConfirmFile, ControlFile, OptimizeFile, WorkersFile};
pub use safety::SafetyFile;

use std::path::PathBuf;

/// A configuration that cannot be used: which file, which key, which value, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The folder is not there.
    #[error("{}: no such configuration folder; give a folder that holds control.toml, safety.toml, ... or leave --config away", path.display())]
    NoFolder {
        /// The folder.
        path: PathBuf,
    },
    /// A file that no one reads: probably a misspelt name.
    #[error("{}: not a configuration file; the files are {known}", path.display())]
    UnknownFile {
        /// The file.
        path: PathBuf,
        /// The names that are read.
        known: String,
    },
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file cannot be written, or is there already.
    #[error("{}: cannot be written: {source}; give a new folder", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{file}:{line}: {message}")]
    Syntax {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What the parser says.
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
    /// A value of another kind than it must be.
    #[error("{file}:{line}: `{key}` must be {expected}, not {found}")]
    Kind {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The key with its tables.
        key: String,
        /// The kind that it must have.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A value that cannot be.
    #[error("{file}: `{key}` = {value}: {reason}")]
    Value {
        /// The file, with the line where the file gives one.
        file: String,
        /// The key with its tables.
        key: String,
        /// What stands there.
        value: String,
        /// Why it cannot be, and what can.
        reason: String,
    },
}
