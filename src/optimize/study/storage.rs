//! Place of storage of a study.

use std::path::PathBuf;

use crate::optimize::journal::{
    Durability, Journal, JournalError, JournalFile, JournalRedis, LOCK_GRACE, public_address,
};

/// Place of storage of a study.
#[derive(Debug, Clone, PartialEq)]
pub enum Storage {
    /// Memory of the program.
    Memory,
    /// A journal file, created if it does not exist.
    File(PathBuf),
    /// A Redis server, `redis://host:port/db`: for workers on several hosts.
    Redis(String),
}

impl Storage {
    /// Opens the journal.
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
            Storage::Redis(url) => f.write_str(&public_address(url)),
        }
    }
}
