//! Free space for recordings.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::sys::statvfs::statvfs;

/// Period of the measurements.
const PERIOD: Duration = Duration::from_millis(500);
/// Age from which a measurement says nothing about the present: of ten measurements none has come.
const STALE: Duration = Duration::from_secs(5);

/// Returns the free space for this user on the file system that holds `path`, MB (10^6 bytes).
///
/// # Errors
/// When the system cannot report it, for example for a missing path.
pub fn free_mb(path: &Path) -> io::Result<u64> {
    let about = statvfs(path)?;
    Ok(about.blocks_available() * about.fragment_size() / 1_000_000)
}

/// The last measurement and its time.
type Measurement = (Instant, Result<u64, String>);

/// Free space of a folder, measured on a thread of its own: a network's file system whose server is gone answers no call, and the
/// session that asked it would hang.
#[derive(Debug, Clone)]
pub struct FreeSpace {
    last: Arc<Mutex<Measurement>>,
}

impl FreeSpace {
    /// Measures `folder` now, and from then on until the last clone is dropped.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn watch(folder: PathBuf) -> io::Result<FreeSpace> {
        FreeSpace::watch_by(move || free_mb(&folder)).map(|(space, _)| space)
    }

    /// As [`FreeSpace::watch`], by `measure`; also returns the thread.
    ///
    /// # Errors
    /// As [`FreeSpace::watch`].
    pub fn watch_by(measure: impl Fn() -> io::Result<u64> + Send + 'static) -> io::Result<(FreeSpace, JoinHandle<()>)> {
        let measure = move || (Instant::now(), measure().map_err(|error| error.to_string()));
        let last = Arc::new(Mutex::new(measure()));
        let watched = Arc::downgrade(&last);
        let thread = std::thread::Builder::new().name("disk-space".into()).spawn(move || {
            loop {
                std::thread::sleep(PERIOD);
                let measured = measure();
                let Some(last) = watched.upgrade() else { return };
                *last.lock().unwrap_or_else(PoisonError::into_inner) = measured;
            }
        })?;
        Ok((FreeSpace { last }, thread))
    }

    /// Returns the free space, MB (10^6 bytes), at most 5 s old.
    ///
    /// # Errors
    /// The reason why it is not known.
    pub fn mb(&self) -> Result<u64, String> {
        let (at, measured) = &*self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match at.elapsed() {
            age if age > STALE => Err(format!("the file system has not answered for {} s", age.as_secs())),
            _ => measured.clone(),
        }
    }
}
