//! TOML files to checked values. The files of `config/` are embedded as the defaults; another folder may replace any of
//! their keys. A key that the defaults do not have is rejected with file, line and the nearest known key.

mod checked;
mod defaults;
mod export;
mod files;
mod kneeling;
mod merge;
mod new_files;
mod ranges;
mod reference;
mod rules;

pub use crate::sim::ranges::NumberRange;
pub use checked::{Config, ConfigLayer};
pub use files::{ConfirmFile, ControlFile, OptimizeFile, SafetyFile, WorkersFile};
pub use new_files::write_new_files;
pub use reference::{FileReference, KeyReference, SectionReference, range_of, reference};
pub use rules::LEAST_F1_HZ;

use std::path::PathBuf;

/// Error of a configuration: file, key, value and remedy.
#[expect(missing_docs, reason = "the messages name variants and fields")]
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("{}: no such configuration folder; give a folder that holds control.toml, safety.toml, ... or none, for the defaults", path.display())]
    NoFolder { path: PathBuf },
    #[error("{}: holds no configuration file; the files are {known}; give a folder that holds one, or none, for the defaults", path.display())]
    NoFile { path: PathBuf, known: String },
    #[error("{}: not a configuration file; the files are {known}", path.display())]
    UnknownFile { path: PathBuf, known: String },
    #[error("{}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error(
        "{}: is empty, as after a full disk, so it is not known what the study ran with; give its configuration with --config",
        path.display()
    )]
    Empty { path: PathBuf },
    #[error("{}: exists already; give a new folder, or remove the file first", path.display())]
    Exists { path: PathBuf },
    #[error("{}: cannot be written: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("{file}:{line}: {message}")]
    Syntax { file: String, line: usize, message: String },
    #[error("{file}:{line}: unknown key `{key}`; {}", match nearest {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => "remove it; `quadfrog config show` lists the keys of each file".to_owned(),
    })]
    UnknownKey { file: String, line: usize, key: String, nearest: Option<String> },
    #[error("{file}:{line}: `{key}` must be {expected}, not {found}")]
    Kind { file: String, line: usize, key: String, expected: String, found: String },
    #[error("{file}: `{key}` = {value}: {reason}")]
    Value { file: String, key: String, value: String, reason: String },
}
