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
mod wait;

pub(super) use self::redis::{JournalRedis, public_address};
pub use codec::JournalLine;
pub use error::JournalError;
use file::UnreadTail;
pub use file::{Durability, JournalFile, LOCK_GRACE, stop_locking};
pub(super) use json::moment;
pub use json::{InOrder, TimeForm};
pub use operation::{AttributeKind, Operation};
pub use state::{Applied, JournalState, StudyRecord};
pub use wait::{JournalWait, LongWait, WaitedFor, notice_waits};

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
    /// Form of the times that are written: local once a line with local times was read.
    times: TimeForm,
}

impl Journal {
    pub(super) fn in_memory() -> Self {
        Journal::new(JournalBackend::Memory)
    }

    /// The journal of a file, created by the first commit if it does not exist.
    pub fn open(file: JournalFile) -> Result<Self, JournalError> {
        Self::read(JournalBackend::File(file))
    }

    pub(super) fn connect(redis: JournalRedis) -> Result<Self, JournalError> {
        Self::read(JournalBackend::Redis(Box::new(redis)))
    }

    fn new(backend: JournalBackend) -> Self {
        let worker = uuid::Uuid::new_v4().to_string();
        Journal { backend, worker, state: JournalState::default(), times: TimeForm::default() }
    }

    fn read(backend: JournalBackend) -> Result<Self, JournalError> {
        let mut journal = Journal::new(backend);
        journal.refresh().map(|()| journal)
    }

    /// Copies the state to a journal in memory.
    pub fn fork(&self) -> Self {
        let (worker, state) = (self.worker.clone(), self.state.clone());
        Journal { backend: JournalBackend::Memory, worker, state, times: self.times }
    }

    /// The state as of the last refresh or commit.
    pub fn state(&self) -> &JournalState {
        &self.state
    }

    /// Identity of this writer, unique per opened journal.
    pub fn worker(&self) -> &str {
        &self.worker
    }

    /// Returns the wait for the lock of the journal's file, or for its server.
    pub fn wait(&self) -> JournalWait {
        match &self.backend {
            JournalBackend::File(file) => file.wait().clone(),
            JournalBackend::Redis(redis) => redis.wait().clone(),
            JournalBackend::Memory => JournalWait::default(),
        }
    }

    /// Reads the lines of other writers.
    pub fn refresh(&mut self) -> Result<(), JournalError> {
        self.apply_lines().map(drop)
    }

    /// Applies new lines. Returns the results of this writer's own lines and what follows the last valid line.
    fn apply_lines(&mut self) -> Result<(Vec<Applied>, UnreadTail), JournalError> {
        let mut own = Vec::new();
        let accept = |line: &str| {
            let JournalLine { worker, operation, times } = Operation::parse(line)?;
            if times == TimeForm::Local {
                self.times = times;
            }
            let result = self.state.apply(operation, &worker);
            own.extend((worker == self.worker).then_some(result));
            Ok(())
        };
        let tail = match &mut self.backend {
            JournalBackend::Memory => UnreadTail::default(),
            JournalBackend::File(file) => file.read(accept)?,
            JournalBackend::Redis(redis) => redis.read(accept).map(|()| UnreadTail::default())?,
        };
        Ok((own, tail))
    }

    /// Appends the operations that `decide` returns for the newest state; no other line comes in between. `decide` is called
    /// again if another writer of a Redis journal was faster, or has broken the lock of a file. Returns the result of each operation.
    ///
    /// # Errors
    /// The error of `decide`, with nothing written; [`JournalError`] if the journal cannot be read or written.
    pub fn commit<E: From<JournalError>>(
        &mut self,
        mut decide: impl FnMut(&JournalState) -> Result<Vec<Operation>, E>,
    ) -> Result<Vec<Applied>, E> {
        self.append_decided(&mut decide)
    }

    /// [`Journal::commit`], compiled once for all of its callers.
    fn append_decided<E: From<JournalError>>(
        &mut self,
        decide: &mut dyn FnMut(&JournalState) -> Result<Vec<Operation>, E>,
    ) -> Result<Vec<Applied>, E> {
        loop {
            let lock = if let JournalBackend::File(file) = &self.backend { Some(file.lock()?) } else { None };
            let (_, tail) = self.apply_lines()?;
            let operations = decide(&self.state)?;
            let (worker, times) = (&self.worker, self.times);
            let lines = operations.iter().map(|operation| operation.to_line(worker, times));
            let appended = match (&mut self.backend, &lock) {
                _ if operations.is_empty() => return Ok(Vec::new()),
                (JournalBackend::Redis(redis), _) => redis.append(&lines.collect::<Vec<_>>())?,
                (JournalBackend::File(file), Some(lock)) => file.append(lock, &tail, &lines.collect::<String>())?,
                _ => return Ok(operations.into_iter().map(|o| self.state.apply(o, &self.worker)).collect()),
            };
            drop(lock);
            if appended {
                return Ok(self.apply_lines()?.0);
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
}
