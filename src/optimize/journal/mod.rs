//! The journal of studies: Optuna's append-only list of JSON operations (`docs/journal.md`), which Optuna and
//! optuna-dashboard can read and write at the same time.
//!
//! The state is the result of all lines. A writer locks the journal, reads new lines, decides, appends its lines in one
//! write and reads them back; so it decides on exactly the state to which it appends.

mod codec;
mod error;
mod file;
mod json;
mod operation;
mod redis;
mod state;

pub use self::redis::JournalRedis;
pub use error::JournalError;
pub use file::{Durability, JournalFile, LOCK_GRACE};
pub use operation::{Operation, TrialTemplate};
pub use state::{Applied, JournalState, StudyRecord};

/// Place of storage of the lines.
#[derive(Debug)]
enum JournalBackend {
    Memory,
    File(JournalFile),
    Redis(Box<JournalRedis>),
}

/// A journal with its state.
#[derive(Debug)]
pub struct Journal {
    backend: JournalBackend,
    worker: String,
    state: JournalState,
}

impl Journal {
    /// A journal in memory only.
    pub fn in_memory() -> Self {
        Journal::new(JournalBackend::Memory)
    }

    /// The journal of a file, created by the first commit if it does not exist.
    ///
    /// # Errors
    /// [`JournalError`] if the file cannot be read.
    pub fn open(file: JournalFile) -> Result<Self, JournalError> {
        Self::read(JournalBackend::File(file))
    }

    /// The journal on a Redis server.
    ///
    /// # Errors
    /// [`JournalError`] if the server cannot be reached or its journal cannot be read.
    pub fn connect(redis: JournalRedis) -> Result<Self, JournalError> {
        Self::read(JournalBackend::Redis(Box::new(redis)))
    }

    fn new(backend: JournalBackend) -> Self {
        Journal { backend, worker: uuid::Uuid::new_v4().to_string(), state: JournalState::default() }
    }

    fn read(backend: JournalBackend) -> Result<Self, JournalError> {
        let mut journal = Journal::new(backend);
        journal.refresh().map(|()| journal)
    }

    /// Copies the state to a journal in memory.
    pub fn fork(&self) -> Self {
        Journal { backend: JournalBackend::Memory, worker: self.worker.clone(), state: self.state.clone() }
    }

    /// The state as of the last refresh or commit.
    pub fn state(&self) -> &JournalState {
        &self.state
    }

    /// Identity of this writer, unique per opened journal.
    pub fn worker(&self) -> &str {
        &self.worker
    }

    /// Reads the lines of other writers.
    ///
    /// # Errors
    /// [`JournalError`] if the journal cannot be read.
    pub fn refresh(&mut self) -> Result<(), JournalError> {
        match &mut self.backend {
            JournalBackend::Memory => Ok(()),
            JournalBackend::File(file) => file.read(|line| accept(&mut self.state, line).map(drop)).map(drop),
            JournalBackend::Redis(redis) => redis.read(|line| accept(&mut self.state, line).map(drop)),
        }
    }

    /// Appends the operations that `decide` returns for the newest state; no other line comes in between. `decide` is called
    /// again if another writer of a Redis journal was faster. Returns the result of each operation.
    ///
    /// # Errors
    /// The error of `decide`, with nothing written; [`JournalError`] if the journal cannot be read or written.
    pub fn commit<E: From<JournalError>>(
        &mut self,
        mut decide: impl FnMut(&JournalState) -> Result<Vec<Operation>, E>,
    ) -> Result<Vec<Applied>, E> {
        match &mut self.backend {
            JournalBackend::Memory => {
                let operations = decide(&self.state)?;
                Ok(operations.into_iter().map(|o| self.state.apply(o, &self.worker)).collect())
            }
            JournalBackend::File(file) => {
                let lock = file.lock()?;
                let rest = file.read(|line| accept(&mut self.state, line).map(drop))?;
                let operations = decide(&self.state)?;
                if operations.is_empty() {
                    return Ok(Vec::new());
                }
                let lines: String = operations.iter().map(|o| o.to_line(&self.worker)).collect();
                file.append(&lock, &rest, &lines)?;
                drop(lock);
                let mut applied = Vec::with_capacity(operations.len());
                file.read(|line| collect(&mut self.state, line, &self.worker, &mut applied))?;
                Ok(applied)
            }
            JournalBackend::Redis(redis) => loop {
                redis.read(|line| accept(&mut self.state, line).map(drop))?;
                let operations = decide(&self.state)?;
                if operations.is_empty() {
                    return Ok(Vec::new());
                }
                let lines: Vec<String> = operations.iter().map(|o| o.to_line(&self.worker)).collect();
                if redis.append(&lines)? {
                    let mut applied = Vec::with_capacity(operations.len());
                    redis.read(|line| collect(&mut self.state, line, &self.worker, &mut applied))?;
                    return Ok(applied);
                }
                std::thread::sleep(std::time::Duration::from_millis(1));
            },
        }
    }
}

fn accept(state: &mut JournalState, line: &str) -> Result<(String, Applied), String> {
    let (worker, operation) = Operation::parse(line)?;
    let result = state.apply(operation, &worker);
    Ok((worker, result))
}

/// Accepts a line and stores its result if it is of writer `own`.
fn collect(state: &mut JournalState, line: &str, own: &str, applied: &mut Vec<Applied>) -> Result<(), String> {
    let (worker, result) = accept(state, line)?;
    if worker == own {
        applied.push(result);
    }
    Ok(())
}
