//! Errors of a journal.

use std::path::{Path, PathBuf};

/// Errors of a journal.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// An operation of the operating system failed.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// Operation.
        action: &'static str,
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// An invalid line.
    #[error(
        "{}, line {line}: {fault}. Every reader of this journal stops here: keep a copy, then remove or repair the line",
        path.display()
    )]
    Line {
        /// Path of the journal.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// Fault of the line.
        fault: String,
    },
    /// The file was truncated or replaced.
    #[error(
        "{} has {has} bytes, after {had} were read: it was shortened or replaced; open the study again",
        path.display()
    )]
    Shortened {
        /// Path of the journal.
        path: PathBuf,
        /// Bytes read earlier.
        had: u64,
        /// Present size, bytes.
        has: u64,
    },
    /// The Redis server refused or could not be reached.
    #[error("cannot {action} the journal on the Redis server {address}: {source}")]
    Redis {
        /// Operation.
        action: &'static str,
        /// Address of the server, without password.
        address: String,
        /// Cause.
        source: ::redis::RedisError,
    },
}

impl JournalError {
    pub(super) fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        JournalError::Io { action, path: path.to_owned(), source }
    }
}
