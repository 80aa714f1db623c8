//! The study on disk: Optuna's journal, an append-only list of JSON operations that Optuna and optuna-dashboard read and
//! write at the same time.
//!
//! The state is the replay of all lines. A writer takes the lock, reads what others have appended, decides, appends its
//! lines in one write and reads them back; so what it decides on is what it appends to.

mod file;
mod json;
mod operation;
mod redis;
mod replay;

pub use self::redis::JournalRedis;
pub use file::{Durability, JournalFile, LOCK_GRACE};
pub use operation::{Operation, Template};
pub use replay::{Effect, Replay, StudyRecord};

use std::path::{Path, PathBuf};

/// What can go wrong with a journal.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A line that no reader can accept.
    #[error(
        "{}, line {line}: {what}. Every program that reads this journal stops here: keep a copy, then remove or repair the line",
        path.display()
    )]
    Line {
        /// The journal.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        what: String,
    },
    /// The file is not the one that was read before.
    #[error(
        "{} has {has} bytes, though {had} were read from it before: it was shortened or replaced; open the study again",
        path.display()
    )]
    Shortened {
        /// The journal.
        path: PathBuf,
        /// Bytes read before.
        had: u64,
        /// Bytes it has now.
        has: u64,
    },
    /// The Redis server refused or was not there.
    #[error("cannot {action} the journal on the Redis server {address}: {source}")]
    Redis {
        /// What was tried.
        action: &'static str,
        /// The server, without any password.
        address: String,
        /// Why not.
        source: ::redis::RedisError,
    },
}

impl JournalError {
    pub(super) fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        JournalError::Io { action, path: path.to_owned(), source }
    }
}

/// Where a journal's lines are kept.
#[derive(Debug)]
enum Backend {
    Memory,
    File(JournalFile),
    Redis(Box<JournalRedis>),
}

/// A journal: its state and the way to change it.
#[derive(Debug)]
pub struct Journal {
    backend: Backend,
    worker: String,
    replay: Replay,
}

impl Journal {
    /// A journal that ends with the program; nothing is read or written.
    pub fn in_memory() -> Self {
        Journal { backend: Backend::Memory, worker: worker_id(), replay: Replay::default() }
    }

    /// The journal of a file, which is made by the first commit if it does not exist.
    ///
    /// # Errors
    /// [`JournalError`] if the file cannot be read.
    pub fn open(file: JournalFile) -> Result<Self, JournalError> {
        let mut journal = Journal { backend: Backend::File(file), worker: worker_id(), replay: Replay::default() };
        journal.refresh()?;
        Ok(journal)
    }

    /// The journal on a Redis server.
    ///
    /// # Errors
    /// [`JournalError`] if the server cannot be reached or its journal not be read.
    pub fn connect(redis: JournalRedis) -> Result<Self, JournalError> {
        let mut journal =
            Journal { backend: Backend::Redis(Box::new(redis)), worker: worker_id(), replay: Replay::default() };
        journal.refresh()?;
        Ok(journal)
    }

    /// The same state in memory: what happens to it reaches no disk and nobody else.
    pub fn fork(&self) -> Self {
        Journal { backend: Backend::Memory, worker: self.worker.clone(), replay: self.replay.clone() }
    }

    /// The state as of the last refresh or commit.
    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    /// This writer's identity, unique per opened journal.
    pub fn worker(&self) -> &str {
        &self.worker
    }

    /// Takes in what others have written.
    ///
    /// # Errors
    /// [`JournalError`] if the journal cannot be read.
    pub fn refresh(&mut self) -> Result<(), JournalError> {
        match &mut self.backend {
            Backend::Memory => Ok(()),
            Backend::File(file) => file.read(|line| accept(&mut self.replay, line).map(drop)).map(drop),
            Backend::Redis(redis) => redis.read(|line| accept(&mut self.replay, line).map(drop)),
        }
    }

    /// Decides on the newest state and appends: `decide` sees the journal exactly as it is before its operations are
    /// appended, and says which, none if nothing is to be done. It is asked again if another writer of a Redis journal was
    /// faster. Returns what became of each operation.
    ///
    /// # Errors
    /// What `decide` refuses, with nothing written; [`JournalError`] if the journal cannot be read or written.
    pub fn commit<E: From<JournalError>>(
        &mut self,
        mut decide: impl FnMut(&Replay) -> Result<Vec<Operation>, E>,
    ) -> Result<Vec<Effect>, E> {
        match &mut self.backend {
            Backend::Memory => {
                let operations = decide(&self.replay)?;
                Ok(operations.into_iter().map(|o| self.replay.apply(o, &self.worker)).collect())
            }
            Backend::File(file) => {
                let lock = file.lock()?;
                let rest = file.read(|line| accept(&mut self.replay, line).map(drop))?;
                let operations = decide(&self.replay)?;
                if operations.is_empty() {
                    return Ok(Vec::new());
                }
                let lines: String = operations.iter().map(|o| o.to_line(&self.worker)).collect();
                file.append(&lock, &rest, &lines)?;
                drop(lock);
                let mut effects = Vec::with_capacity(operations.len());
                file.read(|line| collect(&mut self.replay, line, &self.worker, &mut effects))?;
                Ok(effects)
            }
            Backend::Redis(redis) => loop {
                redis.read(|line| accept(&mut self.replay, line).map(drop))?;
                let operations = decide(&self.replay)?;
                if operations.is_empty() {
                    return Ok(Vec::new());
                }
                let lines: Vec<String> = operations.iter().map(|o| o.to_line(&self.worker)).collect();
                if redis.append(&lines)? {
                    let mut effects = Vec::with_capacity(operations.len());
                    redis.read(|line| collect(&mut self.replay, line, &self.worker, &mut effects))?;
                    return Ok(effects);
                }
                std::thread::sleep(std::time::Duration::from_millis(1));
            },
        }
    }
}

fn accept(replay: &mut Replay, line: &str) -> Result<(String, Effect), String> {
    let (worker, operation) = Operation::parse(line)?;
    let effect = replay.apply(operation, &worker);
    Ok((worker, effect))
}

/// Accepts a line and keeps its effect if it is our own.
fn collect(replay: &mut Replay, line: &str, own: &str, effects: &mut Vec<Effect>) -> Result<(), String> {
    let (worker, effect) = accept(replay, line)?;
    if worker == own {
        effects.push(effect);
    }
    Ok(())
}

fn worker_id() -> String {
    uuid::Uuid::new_v4().to_string()
}
