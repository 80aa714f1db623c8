//! Where a study is kept.

use std::path::PathBuf;

use crate::optimize::journal::{Durability, Journal, JournalError, JournalFile, JournalRedis, LOCK_GRACE};

/// Where a study is kept.
#[derive(Debug, Clone, PartialEq)]
pub enum Storage {
    /// Nowhere: it ends with the program.
    Memory,
    /// In a journal file, made if it does not exist.
    File(PathBuf),
    /// On a Redis server, given as `redis://host:port/db`: for workers on many hosts.
    Redis(String),
}

impl Storage {
    /// The journal that is kept there.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn journal(&self, durability: Durability) -> Result<Journal, JournalError> {
        match self {
            Storage::Memory => Ok(Journal::in_memory()),
            Storage::File(path) => Journal::open(JournalFile::new(path, durability, LOCK_GRACE)?),
            Storage::Redis(url) => Journal::connect(JournalRedis::new(url, "")?),
        }
    }
}

impl std::fmt::Display for Storage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Storage::Memory => write!(f, "memory"),
            Storage::File(path) => write!(f, "{}", path.display()),
            // An address may hold a password before an @.
            Storage::Redis(url) => match url.rsplit_once('@') {
                Some((_, address)) => write!(f, "redis://{address}"),
                None => write!(f, "{url}"),
            },
        }
    }
}
