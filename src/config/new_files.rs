//! Files of a new configuration, written whole or not at all: a cut file would be a valid one with fewer keys.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::ConfigError;
use crate::unfinished::Unfinished;

/// Writes files, by their paths in `folder`, and waits for the disk. A new folder appears with all of them or not at all; in a folder
/// that exists those written so far are removed on an error. Returns their paths.
///
/// # Errors
/// [`ConfigError::Exists`] when one of the files is there already: nothing is overwritten; [`ConfigError::Write`].
pub fn write_new_files<T: AsRef<Path>, U: AsRef<str>>(
    folder: &Path,
    files: &[(T, U)],
) -> Result<Vec<PathBuf>, ConfigError> {
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| folder.join(name)).collect();
    if let Some(path) = paths.iter().find(|path| path.symlink_metadata().is_ok()) {
        return Err(ConfigError::Exists { path: path.clone() });
    }
    let failed = |path: &Path, source| ConfigError::Write { path: path.to_owned(), source };
    if folder.is_dir() {
        for (written, (path, (_, text))) in paths.iter().zip(files).enumerate() {
            write_new_file(path, text.as_ref()).map_err(|source| {
                paths[..written].iter().for_each(|path| drop(fs::remove_file(path)));
                failed(path, source)
            })?;
        }
    } else {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        // Another program may make the same folder at the same time: the first one's stands.
        let part = folder.with_file_name(format!(".{name}.{}.part", std::process::id()));
        let _unfinished = Unfinished::enter(&part);
        let write = || {
            // A killed program may have left it: in a container each has the same number.
            if part.is_dir() {
                fs::remove_dir_all(&part)?;
            }
            for (name, text) in files {
                write_new_file(&part.join(name), text.as_ref())?;
            }
            File::open(&part)?.sync_all()?;
            fs::rename(&part, folder)?;
            // The new name is on the disk when its folder is.
            let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
            File::open(parent.unwrap_or(Path::new(".")))?.sync_all()
        };
        write().map_err(|source| {
            let _ = fs::remove_dir_all(&part);
            failed(folder, source)
        })?;
    }
    Ok(paths)
}

/// Writes a file that does not exist; of one that cannot be written whole nothing stays.
fn write_new_file(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut file = OpenOptions::new().write(true).create_new(true).open(path)?;
    let written = file.write_all(text.as_bytes()).and_then(|()| file.sync_all());
    if written.is_err() {
        // The error that is reported is that of the writing.
        let _ = fs::remove_file(path);
    }
    written
}
