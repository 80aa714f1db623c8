//! The recordings in a folder: `session.mcap`, `session-2.mcap`, ...; while they are written, with the ending `.part`.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::error::RecordingError;

/// Returns the number of a recording by its name: 1 for `session.mcap`, N for `session-N.mcap`; none for another file.
fn number(path: &Path) -> Option<u32> {
    let name = path.file_name()?.to_str()?;
    match name.strip_suffix(".part").unwrap_or(name).strip_suffix(".mcap")? {
        "session" => Some(1),
        other => other.strip_prefix("session-")?.parse().ok(),
    }
}

/// Returns the folder of a recording and its number there: a later session has a higher number. None for a file with another name.
pub fn place(path: &Path) -> Option<(&Path, u32)> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some((folder, number(path)?))
}

/// Returns the name of a recording by its number.
fn name(number: u32) -> String {
    if number == 1 { "session.mcap".to_owned() } else { format!("session-{number}.mcap") }
}

/// Returns the path of the next recording in a folder: the first free name after that of `last`, or after all.
pub fn next_recording(folder: &Path, last: Option<&Path>) -> Option<PathBuf> {
    let last = last.and_then(number).or_else(|| number(recordings_in(folder).last()?));
    let first = last.map_or(1, |number| number.saturating_add(1));
    let taken = |path: &PathBuf| path.exists() || path.with_extension("mcap.part").exists();
    (first..=u32::MAX).map(|number| folder.join(name(number))).find(|path| !taken(path))
}

/// Returns the recordings in a folder, by their number; none of a folder that cannot be read. Of a file with and without the
/// ending `.part` only the finished one: the other was recovered.
pub fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut files: Vec<(u32, bool, PathBuf)> = entries(folder)
        .filter_map(|path| Some((number(&path)?, path.extension().is_some_and(|end| end == "part"), path)))
        .collect();
    files.sort();
    files.dedup_by_key(|(number, ..)| *number);
    files.into_iter().map(|(.., path)| path).collect()
}

/// Returns the recordings in a folder that no session has finished, without those that were recovered. That of a session that runs
/// is among them.
pub fn unfinished_in(folder: &Path) -> Vec<PathBuf> {
    let unfinished = |path: &PathBuf| path.extension().is_some_and(|end| end == "part");
    recordings_in(folder).into_iter().filter(unfinished).collect()
}

/// Returns the files that a path names: itself, the recordings of a folder, or those of the newest study in it.
///
/// # Errors
/// When there is no such path, a folder and the folders in it have no recording, or one of them cannot be read.
pub fn recordings_of(path: &Path) -> Result<Vec<PathBuf>, RecordingError> {
    if !path.is_dir() {
        return match path.try_exists() {
            Ok(false) => Err(RecordingError::Missing { path: path.into() }),
            _ => Ok(vec![path.into()]),
        };
    }
    // A folder that cannot be read is not one without a recording.
    let readable = |folder: &Path| match std::fs::read_dir(folder) {
        Err(source) if source.kind() == ErrorKind::PermissionDenied => {
            Err(RecordingError::Io { path: folder.into(), doing: "read the folder", source })
        }
        _ => Ok(()),
    };
    readable(path)?;
    let own = recordings_in(path);
    if !own.is_empty() {
        return Ok(own);
    }
    let newest = entries(path).map(|folder| recordings_in(&folder)).max_by_key(|files| changed(files));
    if let Some(files) = newest.filter(|files| !files.is_empty()) {
        return Ok(files);
    }
    entries(path).try_for_each(|folder| readable(&folder))?;
    let studies = entries(path).flat_map(|folder| entries(&folder).collect::<Vec<_>>());
    let deeper = studies.filter(|study| !recordings_in(study).is_empty()).min();
    Err(RecordingError::NoRecording { path: path.into(), deeper })
}

/// The paths in a folder; none of one that cannot be read.
fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()))
}

/// Returns the time of the last change of the files, with the first name to decide between equal ones.
fn changed(files: &[PathBuf]) -> Option<(SystemTime, PathBuf)> {
    let time = |file: &PathBuf| std::fs::metadata(file).and_then(|metadata| metadata.modified()).ok();
    Some((files.iter().filter_map(time).max()?, files.first()?.clone()))
}
