//! Files and folders of this process that have another name until they are complete. A process that a signal ends removes them.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder that is not complete, until this is dropped. Who makes it removes it on an error.
#[derive(Debug)]
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Enters the path, before anything is made there.
    pub fn enter(path: &Path) -> Unfinished {
        // Absolute, because the working directory may change.
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        unfinished().push(path.clone());
        Unfinished(path)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut all = unfinished();
        if let Some(index) = all.iter().position(|path| *path == self.0) {
            all.swap_remove(index);
        }
    }
}

/// Removes all unfinished files and folders of this process, which is to end at once: as long as the result lives none is begun and
/// none is completed.
pub fn remove_unfinished() -> impl Sized {
    let mut all = unfinished();
    for path in all.drain(..) {
        // What cannot be removed stays: nothing reads it.
        let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
    all
}
