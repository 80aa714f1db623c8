//! Errors of a journal.

use std::path::{Path, PathBuf};

/// Errors of a journal.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum JournalError {
    #[error("cannot {action} {}: {source}", path.display())]
    Io { action: &'static str, path: PathBuf, source: std::io::Error },
    #[error(
        "{}, line {line}: {fault}. Every reader of this journal stops here: keep a copy, then remove or repair the line",
        path.display()
    )]
    Line { path: PathBuf, line: usize, fault: String },
    #[error(
        "{}, line {line} is complete and cannot be read ({fault}): nothing is written after it, because another program may \
         need it. Keep a copy, then remove or repair the line",
        path.display()
    )]
    LastLine { path: PathBuf, line: usize, fault: String },
    #[error(
        "{} is no journal of a study ({fault}); give the study's folder, its `study.log`, or another Optuna journal",
        path.display()
    )]
    NoJournal { path: PathBuf, fault: String },
    #[error(
        "{path} is an SQLite database, not a journal. If Optuna keeps studies in it, copy them into a journal: python3 -c \
         \"import optuna; from optuna.storages import JournalStorage; from optuna.storages.journal import JournalFileBackend; \
         storage = 'sqlite:///{path}'; to = JournalStorage(JournalFileBackend('study.log')); \
         [optuna.copy_study(from_study_name=name, from_storage=storage, to_storage=to) \
         for name in optuna.get_all_study_names(storage)]\"",
        path = path.display()
    )]
    Sqlite { path: PathBuf },
    #[error(
        "{} has {has} bytes, after {had} were read: it was shortened or replaced; open the study again",
        path.display()
    )]
    Shortened { path: PathBuf, had: u64, has: u64 },
    #[error("{}: another program holds the lock of the study; the wait was ended, nothing was written", lock.display())]
    Interrupted { lock: PathBuf },
    #[error(
        "the journal on the Redis server {address} has {has} lines, after {had} were read: the server lost its data or it was \
         cleared; every trial reported before is gone from the server. Open the study again once the data is restored"
    )]
    RedisShortened { address: String, had: i64, has: i64 },
    #[error(
        "the journal on the Redis server {address} has the key {prefix}:log:{index}, and {prefix}:log_number does not count it: \
         nothing is written, because lines would be overwritten. Set {prefix}:log_number to the number of the last line, counted \
         from 0, or, for a new study, remove the keys {prefix}:log:*"
    )]
    RedisUncounted { address: String, prefix: String, index: i64 },
    #[error("{address} is not an address of a Redis server ({fault}); write it as redis://HOST:PORT/DB")]
    RedisAddress { address: String, fault: String },
    #[error("the wait for the Redis server {address} was ended; it is not known whether the last lines were written")]
    ServerWaitEnded { address: String },
    /// The address has no password.
    #[error("cannot {action} the journal on the Redis server {address}: {reason}")]
    Redis { action: &'static str, address: String, reason: String },
}

impl JournalError {
    pub(super) fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        JournalError::Io { action, path: path.to_owned(), source }
    }
}
