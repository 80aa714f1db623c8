//! The journal as a file shared by several programs: reading while others write, the lock, the append.

use super::JournalError;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// How long a lock may stand while the journal does not change before its owner counts as dead. Optuna's.
pub const LOCK_GRACE: Duration = Duration::from_secs(30);

/// Whether an append waits for the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Durability {
    /// The lines are on the disk when a call returns: a power cut loses nothing.
    #[default]
    Synced,
    /// The lines are with the operating system: a killed program loses nothing, a power cut may.
    Buffered,
}

/// A journal file and how far it has been read.
#[derive(Debug)]
pub struct JournalFile {
    path: PathBuf,
    lock: PathBuf,
    durability: Durability,
    grace: Duration,
    /// Bytes read so far, always the end of a line.
    offset: u64,
    /// Lines read so far.
    lines: usize,
}

/// What lies beyond the last good line: an unfinished or unreadable last line, cut off before the next append.
pub(super) struct Rest {
    bytes: Vec<u8>,
}

impl JournalFile {
    /// A journal at `path`, which need not exist yet.
    ///
    /// # Errors
    /// If the path has no folder, or the folder cannot be made.
    pub fn new(path: &Path, durability: Durability, grace: Duration) -> Result<Self, JournalError> {
        // Absolute, because other programs resolve the lock's link from where they run.
        let path = std::path::absolute(path).map_err(|e| JournalError::io("resolve", path, e))?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| JournalError::io("create the folder of", &path, e))?;
        }
        let mut lock = path.clone().into_os_string();
        lock.push(".lock");
        Ok(JournalFile { path, lock: lock.into(), durability, grace, offset: 0, lines: 0 })
    }

    /// Where the journal is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Feeds every line that has been completed since the last call to `accept`, which says what is wrong with one.
    /// A last line that is not complete or not readable is left for later and returned.
    ///
    /// # Errors
    /// If the file cannot be read, has become shorter, or holds an unreadable line before its last.
    pub(super) fn read(&mut self, mut accept: impl FnMut(&str) -> Result<(), String>) -> Result<Rest, JournalError> {
        let mut file = match File::open(&self.path) {
            Ok(file) => file,
            Err(e) if e.kind() == ErrorKind::NotFound && self.offset == 0 => return Ok(Rest { bytes: Vec::new() }),
            Err(e) => return Err(JournalError::io("open", &self.path, e)),
        };
        let io = |e| JournalError::io("read", &self.path, e);
        let length = file.metadata().map_err(io)?.len();
        if length < self.offset {
            return Err(JournalError::Shortened { path: self.path.clone(), had: self.offset, has: length });
        }
        if length == self.offset {
            return Ok(Rest { bytes: Vec::new() });
        }
        file.seek(SeekFrom::Start(self.offset)).map_err(io)?;
        let mut bytes = Vec::with_capacity((length - self.offset) as usize);
        file.take(length - self.offset).read_to_end(&mut bytes).map_err(io)?;
        let mut start = 0;
        while let Some(end) = bytes[start..].iter().position(|b| *b == b'\n').map(|i| start + i + 1) {
            let line = std::str::from_utf8(&bytes[start..end]).map_err(|e| format!("not UTF-8: {e}"));
            match line.and_then(|line| accept(line.trim_end_matches(['\n', '\r']))) {
                Ok(()) => {}
                // Writers cut an unreadable last line off, so it harms nobody; followed by another it stops every reader.
                Err(_) if !bytes[end..].contains(&b'\n') => break,
                Err(what) => {
                    return Err(JournalError::Line { path: self.path.clone(), line: self.lines + 1, what });
                }
            }
            self.lines += 1;
            self.offset += (end - start) as u64;
            start = end;
        }
        Ok(Rest { bytes: bytes.split_off(start) })
    }

    /// Takes the lock, waiting for others; a lock whose owner is dead is broken.
    ///
    /// # Errors
    /// If the lock can neither be made nor waited for.
    pub(super) fn lock(&self) -> Result<Lock, JournalError> {
        let mut pause = Duration::from_millis(1);
        let mut seen: Option<(Option<SystemTime>, Instant)> = None;
        loop {
            match make_link(&self.path, &self.lock) {
                Ok(()) => return Ok(Lock { path: self.lock.clone() }),
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(JournalError::io("lock", &self.lock, e)),
            }
            // The lock is stale when nobody has written for the grace time although somebody holds it.
            let changed = fs::metadata(&self.path).and_then(|m| m.modified()).ok();
            match seen {
                Some((before, since)) if before == changed => {
                    if since.elapsed() >= self.grace {
                        release(&self.lock);
                        seen = None;
                        continue;
                    }
                }
                _ => seen = Some((changed, Instant::now())),
            }
            std::thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_secs(1)).min(self.grace);
        }
    }

    /// Appends whole lines in one write. `_lock` shows that the lock is held; `rest`, what was found after the last good
    /// line, is kept aside in `<path>.torn-<n>` and cut off first.
    ///
    /// # Errors
    /// If the file cannot be written or synced.
    pub(super) fn append(&self, _lock: &Lock, rest: &Rest, lines: &str) -> Result<(), JournalError> {
        let io = |e| JournalError::io("append to", &self.path, e);
        let fresh = self.offset == 0 && !self.path.exists();
        let mut file = OpenOptions::new().create(true).append(true).open(&self.path).map_err(io)?;
        if !rest.bytes.is_empty() {
            self.keep_aside(&rest.bytes)?;
            file.set_len(self.offset).map_err(io)?;
        }
        file.write_all(lines.as_bytes()).map_err(io)?;
        if self.durability == Durability::Synced {
            file.sync_data().map_err(io)?;
            if fresh && let Some(folder) = self.path.parent() {
                // a new name is only safe once its folder is
                File::open(folder).and_then(|f| f.sync_all()).map_err(io)?;
            }
        }
        Ok(())
    }

    fn keep_aside(&self, bytes: &[u8]) -> Result<(), JournalError> {
        for n in 0.. {
            let mut name = self.path.clone().into_os_string();
            name.push(format!(".torn-{n}"));
            let aside = PathBuf::from(name);
            match OpenOptions::new().write(true).create_new(true).open(&aside) {
                Ok(mut file) => {
                    return file.write_all(bytes).map_err(|e| JournalError::io("keep a torn line in", &aside, e));
                }
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(JournalError::io("keep a torn line in", &aside, e)),
            }
        }
        unreachable!("there is always a free number")
    }
}

/// The lock of a journal, released when dropped.
pub(super) struct Lock {
    path: PathBuf,
}

impl Drop for Lock {
    fn drop(&mut self) {
        release(&self.path);
    }
}

/// Renames the lock to a name of its own before removing it, so that of two that release only one removes. A rename
/// that fails means that somebody else has broken the lock; nothing is left to do then.
fn release(lock: &Path) {
    let mut name = lock.as_os_str().to_owned();
    name.push(format!("{}.rename", uuid::Uuid::new_v4()));
    if fs::rename(lock, &name).is_ok() {
        let _ = fs::remove_file(&name);
    }
}

/// Makes the lock: a symbolic link to the journal, as Optuna's default lock; elsewhere a file.
#[cfg(unix)]
fn make_link(target: &Path, lock: &Path) -> std::io::Result<()> {
    std::os::unix::fs::symlink(target, lock)
}

#[cfg(not(unix))]
fn make_link(_target: &Path, lock: &Path) -> std::io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(lock).map(|_| ())
}
