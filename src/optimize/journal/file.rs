//! The journal as a file shared by several programs: reading, locking, appending (`docs/journal.md`).

use super::error::JournalError;
use super::json::is_torn;
use super::wait::{JournalWait, LongWait, WaitedFor};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, TryLockError};
use std::time::{Duration, Instant, SystemTime};

/// Age at which a lock without a change of the journal counts as stale; the value of Optuna.
pub const LOCK_GRACE: Duration = Duration::from_secs(30);

/// Longest pause between two attempts to lock: an interrupted wait ends within it.
const LONGEST_PAUSE: Duration = Duration::from_millis(50);

/// Longest line, bytes: a thousand times the longest that this program writes; room for the attributes of other programs.
const LONGEST_LINE: usize = 16 << 20;

/// Beginning of an SQLite database (<https://www.sqlite.org/fileformat.html>, "The Database Header").
const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";

/// Returns the path of a file behind all symbolic links, also of one that does not exist yet: programs that reach a journal by
/// several names share one lock.
fn behind_links(path: &Path) -> io::Result<PathBuf> {
    match fs::canonicalize(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => match fs::read_link(path) {
            Ok(target) => behind_links(&path.with_file_name(target)),
            Err(_) => Ok(path.to_owned()),
        },
        found => found,
    }
}

fn too_long(length: usize) -> String {
    format!("the line has {length} bytes, more than {LONGEST_LINE}")
}

/// Whether an append waits for the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Durability {
    /// The lines are on the disk when a call returns: safe against power loss.
    #[default]
    Synced,
    /// The lines are in the buffers of the operating system: safe against a crash of the program, not against power loss.
    Buffered,
}

/// A journal file with the read position.
#[derive(Debug)]
pub struct JournalFile {
    path: PathBuf,
    lock: PathBuf,
    wait: JournalWait,
    durability: Durability,
    grace: Duration,
    /// Bytes read, always up to the end of a line.
    offset: u64,
    /// Lines read.
    lines: usize,
}

/// The bytes after the last valid line: an incomplete or invalid line, removed before the next append.
#[derive(Default)]
pub(super) struct UnreadTail {
    bytes: Vec<u8>,
    /// The fault of a complete line that other programs can read: it is not removed, and nothing is appended.
    fault: Option<String>,
}

impl JournalFile {
    /// The journal at `path`, which need not exist.
    pub fn new(path: &Path, durability: Durability, grace: Duration) -> Result<Self, JournalError> {
        // Absolute, because other programs resolve the lock's link from their own working directories.
        let path = std::path::absolute(path).map_err(|e| JournalError::io("resolve", path, e))?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| JournalError::io("create the folder of", &path, e))?;
        }
        let path = behind_links(&path).map_err(|e| JournalError::io("resolve", &path, e))?;
        let mut lock = path.clone().into_os_string();
        lock.push(".lock");
        let wait = JournalWait::default();
        Ok(JournalFile { path, lock: lock.into(), wait, durability, grace, offset: 0, lines: 0 })
    }

    /// Passes every line completed since the last call to `accept`, which returns the fault of an invalid line. A last line
    /// that is incomplete or invalid is returned and read again by the next call.
    ///
    /// # Errors
    /// If the file cannot be read, has become shorter, or has an invalid line before its last.
    pub(super) fn read(
        &mut self,
        mut accept: impl FnMut(&str) -> Result<(), String>,
    ) -> Result<UnreadTail, JournalError> {
        let mut file = match File::open(&self.path) {
            Ok(file) => file,
            Err(e) if e.kind() == ErrorKind::NotFound && self.offset == 0 => return Ok(UnreadTail::default()),
            Err(e) => return Err(JournalError::io("open", &self.path, e)),
        };
        let io = |e| JournalError::io("read", &self.path, e);
        let length = file.metadata().map_err(io)?.len();
        if length < self.offset {
            return Err(JournalError::Shortened { path: self.path.clone(), had: self.offset, has: length });
        }
        file.seek(SeekFrom::Start(self.offset)).map_err(io)?;
        let mut bytes = Vec::new();
        // A journal of a length beyond the memory is refused, not the end of the program.
        bytes.try_reserve_exact((length - self.offset) as usize).map_err(|_| io(ErrorKind::OutOfMemory.into()))?;
        file.take(length - self.offset).read_to_end(&mut bytes).map_err(io)?;
        if self.offset == 0 && bytes.starts_with(SQLITE_MAGIC) {
            return Err(JournalError::Sqlite { path: self.path.clone() });
        }
        let (mut start, mut unreadable) = (0, None);
        while let Some(end) = bytes[start..].iter().position(|b| *b == b'\n').map(|i| start + i + 1) {
            let line = match end - start {
                length if length > LONGEST_LINE => Err(too_long(length)),
                _ => std::str::from_utf8(&bytes[start..end]).map_err(|e| format!("not UTF-8: {e}")),
            };
            match line.and_then(|line| accept(line.trim_end_matches(['\n', '\r']))) {
                Ok(()) => {}
                // Writers remove a torn last line; an invalid line before another stops every reader.
                Err(fault) if !bytes[end..].contains(&b'\n') => {
                    unreadable = Some(fault).filter(|_| !is_torn(&bytes[start..end]));
                    break;
                }
                // A journal whose first line is damaged is as rare as a wrong name is frequent, and nothing is to be repaired there.
                Err(fault) if self.lines == 0 => {
                    return Err(JournalError::NoJournal { path: self.path.clone(), fault: format!("line 1: {fault}") });
                }
                Err(fault) => return Err(JournalError::Line { path: self.path.clone(), line: self.lines + 1, fault }),
            }
            self.lines += 1;
            self.offset += (end - start) as u64;
            start = end;
        }
        let tail = bytes.split_off(start);
        if tail.len() > LONGEST_LINE {
            let fault = too_long(tail.len());
            return Err(JournalError::Line { path: self.path.clone(), line: self.lines + 1, fault });
        }
        Ok(UnreadTail { bytes: tail, fault: unreadable })
    }

    /// Returns the wait for the lock.
    pub(super) fn wait(&self) -> &JournalWait {
        &self.wait
    }

    /// Acquires the lock, waiting for other writers; a stale lock is broken. The wait can be interrupted by a signal, because
    /// [`stop_locking`] finds no lock during it.
    ///
    /// # Errors
    /// [`JournalError::Interrupted`] after [`JournalWait::interrupt`].
    pub(super) fn lock(&self) -> Result<JournalLock, JournalError> {
        let locked = self.acquire();
        self.wait.set(None);
        locked
    }

    fn acquire(&self) -> Result<JournalLock, JournalError> {
        let mut pause = Duration::from_millis(1);
        let mut waited = LongWait::begin();
        let mut seen: Option<(Option<SystemTime>, Option<LinkIdentity>, Instant)> = None;
        loop {
            if self.wait.is_interrupted() {
                return Err(JournalError::Interrupted { lock: self.lock.clone() });
            }
            let holder = LOCK_HOLDERS.read().unwrap_or_else(PoisonError::into_inner);
            // A symbolic link to the journal, as Optuna's default lock.
            match std::os::unix::fs::symlink(&self.path, &self.lock) {
                Ok(()) => match LinkIdentity::of(&self.lock) {
                    Some(identity) => return Ok(JournalLock { path: self.lock.clone(), identity, _holder: holder }),
                    None => continue,
                },
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(JournalError::io("lock", &self.lock, e)),
            }
            drop(holder);
            // Stale: held for the grace time by one writer without a change of the journal. Of several that wait for a dead writer one
            // breaks its lock, and finds its own not broken by the others.
            let changed = fs::metadata(&self.path).and_then(|m| m.modified()).ok();
            let link = LinkIdentity::of(&self.lock);
            match seen {
                Some((before, seen_link, since)) if (before, seen_link) == (changed, link) => {
                    if since.elapsed() >= self.grace {
                        release(&self.lock);
                        seen = None;
                        continue;
                    }
                }
                _ => seen = Some((changed, link, Instant::now())),
            }
            self.wait.set(Some(WaitedFor::Lock));
            waited.announce(|| {
                format!(
                    "waiting for {}, which another program holds; a lock without a change of the journal is broken after {} s; \
                     Ctrl-C ends the wait",
                    self.lock.display(),
                    self.grace.as_secs()
                )
            });
            std::thread::sleep(pause);
            pause = (pause * 2).min(LONGEST_PAUSE).min(self.grace);
        }
    }

    /// Appends whole lines in one write, or nothing; `rest` is first moved to `<path>.torn-<n>`. Returns false, with nothing
    /// changed, if another writer has broken the lock: this program was stopped for longer than the grace time, and
    /// `rest` may be the beginning of that writer's lines.
    ///
    /// # Errors
    /// If the file cannot be written, or `rest` is a complete line that this program cannot read; nothing is appended then.
    pub(super) fn append(&self, lock: &JournalLock, rest: &UnreadTail, lines: &str) -> Result<bool, JournalError> {
        let io = |e| JournalError::io("append to", &self.path, e);
        let fresh = self.offset == 0 && !self.path.exists();
        let mut file = OpenOptions::new().create(true).append(true).open(&self.path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        if length != self.offset + rest.bytes.len() as u64 || !lock.is_held() {
            return Ok(false);
        }
        if let Some(fault) = rest.fault.clone() {
            return Err(JournalError::LastLine { path: self.path.clone(), line: self.lines + 1, fault });
        }
        if !rest.bytes.is_empty() {
            self.keep_aside(&rest.bytes)?;
            file.set_len(self.offset).map_err(io)?;
        }
        let synced = self.durability == Durability::Synced;
        let written = file.write_all(lines.as_bytes()).and_then(|()| if synced { file.sync_data() } else { Ok(()) });
        if let Err(error) = written {
            // On a full disk the first lines may be whole: half a commit, which every reader would apply.
            if lock.is_held() {
                file.set_len(self.offset).map_err(io)?;
            }
            return Err(io(error));
        }
        if synced
            && fresh
            && let Some(folder) = self.path.parent()
        {
            // A new name is durable only after a sync of its folder.
            File::open(folder).and_then(|f| f.sync_all()).map_err(io)?;
        }
        Ok(true)
    }

    fn keep_aside(&self, bytes: &[u8]) -> Result<(), JournalError> {
        let torn = |n: u32| {
            let mut name = self.path.clone().into_os_string();
            name.push(format!(".torn-{n}"));
            PathBuf::from(name)
        };
        let aside = (0..).map(torn).find(|aside| !aside.exists()).expect("one of all numbers is free");
        let created = OpenOptions::new().write(true).create_new(true).open(&aside);
        let kept = created.and_then(|mut file| file.write_all(bytes));
        kept.map_err(|e| JournalError::io("keep a torn line in", &aside, e))
    }
}

/// Identity of a symbolic link: inode and time of its creation, because inode numbers are used again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct LinkIdentity {
    inode: u64,
    created: (i64, i64),
}

impl LinkIdentity {
    fn of(link: &Path) -> Option<LinkIdentity> {
        let metadata = fs::symlink_metadata(link).ok()?;
        Some(LinkIdentity { inode: metadata.ino(), created: (metadata.mtime(), metadata.mtime_nsec()) })
    }
}

/// The lock of a journal, released when dropped.
pub(super) struct JournalLock {
    path: PathBuf,
    identity: LinkIdentity,
    _holder: RwLockReadGuard<'static, ()>,
}

/// Locked for reading by each thread of this process that holds the lock of a journal.
static LOCK_HOLDERS: RwLock<()> = RwLock::new(());

/// Longest pause between two looks for threads that hold a lock.
const HOLDER_PAUSE: Duration = Duration::from_millis(1);

/// Waits until this process holds no lock of a journal, for `longest` at most; as long as the result lives it acquires none. For a
/// process that is to end at once: a lock that stays delays every other program by [`LOCK_GRACE`]. None if a lock is held longer.
pub fn stop_locking(longest: Duration) -> Option<impl Sized> {
    let begin = Instant::now();
    loop {
        // Not `write`: a thread that holds one lock and acquires another would then wait for this one.
        match LOCK_HOLDERS.try_write() {
            Ok(held) => return Some(held),
            Err(TryLockError::Poisoned(held)) => return Some(held.into_inner()),
            Err(TryLockError::WouldBlock) if begin.elapsed() >= longest => return None,
            Err(TryLockError::WouldBlock) => std::thread::sleep(HOLDER_PAUSE),
        }
    }
}

impl JournalLock {
    /// Whether no other writer has broken the lock.
    fn is_held(&self) -> bool {
        LinkIdentity::of(&self.path) == Some(self.identity)
    }
}

impl Drop for JournalLock {
    fn drop(&mut self) {
        if self.is_held() {
            release(&self.path);
        }
    }
}

/// Removes the lock after renaming it to a unique name, so that only one of two concurrent releases removes it. A failed
/// rename means that another writer has broken the lock.
fn release(lock: &Path) {
    let mut name = lock.as_os_str().to_owned();
    name.push(format!("{}.rename", uuid::Uuid::new_v4()));
    if fs::rename(lock, &name).is_ok() {
        let _ = fs::remove_file(&name);
    }
}
