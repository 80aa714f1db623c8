//! Errors of writing, reading and recovering a recording.

use std::io;
use std::path::{Path, PathBuf};

use mcap::McapError;

/// A chunk could not be read.
#[expect(missing_docs, reason = "the messages name variants and fields")]
#[derive(Debug, thiserror::Error)]
pub enum ChunkError {
    #[error(transparent)]
    Mcap(#[from] McapError),
    #[error("it holds more than {most} messages: damaged, or not written by quadfrog")]
    TooManyMessages { most: usize },
    #[error("compression {name} cannot be read, zstd and none can: `mcap compress` writes a copy with zstd")]
    Compression { name: String },
}

/// A recording could not be written, read or recovered.
#[expect(missing_docs, reason = "the messages name variants and fields")]
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    #[error("{}: could not {doing}: {source}", path.display())]
    Io { path: PathBuf, doing: &'static str, source: io::Error },
    #[error("{}: there is no such file or folder; name a recording (session.mcap) or a study's folder", path.display())]
    Missing { path: PathBuf },
    #[error("{}: exists already and is not overwritten; move it away or choose another name", path.display())]
    Exists { path: PathBuf },
    #[error("{}: another program recovers into this file; wait until it has ended", path.display())]
    Recovering { path: PathBuf },
    #[error("{}: the name of a finished recording must end in .mcap", path.display())]
    Name { path: PathBuf },
    #[error("{}: not a regular file; name a recording, *.mcap or *.mcap.part, that can be read from any place", path.display())]
    NotAFile { path: PathBuf },
    #[error(
        "{}: no recording there: no session.mcap in it or in a folder directly below it; name a file or a study's folder{}",
        path.display(),
        deeper.as_ref().map_or(String::new(), |deeper| format!(", for example {}", deeper.display()))
    )]
    NoRecording { path: PathBuf, deeper: Option<PathBuf> },
    #[error("{}: not of the study of {}: {reason}; name one of them at a time", path.display(), first.display())]
    OtherStudy { path: PathBuf, first: PathBuf, reason: String },
    #[error("{}: the file is empty; nothing was recorded in it", path.display())]
    Empty { path: PathBuf },
    #[error("{}: not an MCAP file: it begins with {found}; recordings end in .mcap or .mcap.part; give one, or the folder of its study", path.display())]
    NotMcap { path: PathBuf, found: String },
    #[error(
        "{}: an MCAP file, but not a recording of quadfrog: it has no /session message; open it with its own program or with Foxglove",
        path.display()
    )]
    NoSession { path: PathBuf },
    #[error("{}: no /session message of it can be read: {reason}", path.display())]
    UnreadableSession { path: PathBuf, reason: String },
    #[error("{}: damaged at its beginning ({source}); the rest cannot be decoded without its schemas and channels", path.display())]
    Head { path: PathBuf, source: ChunkError },
    #[error("{}: cut off after {bytes} bytes, before the session's first message; nothing in it can be played", path.display())]
    TooShort { path: PathBuf, bytes: u64 },
    #[error("{}: could not write: {source}", path.display())]
    Write { path: PathBuf, source: McapError },
    #[error("{}: could not read: {source}", path.display())]
    Read { path: PathBuf, source: McapError },
}

impl RecordingError {
    /// Returns the error of reading the file `path`.
    pub(super) fn of_reading(path: &Path, error: McapError) -> RecordingError {
        let path = path.into();
        match error {
            McapError::Io(source) => RecordingError::Io { path, doing: "read", source },
            source => RecordingError::Read { path, source },
        }
    }

    /// Returns the error of writing the file `path`.
    pub(super) fn of_writing(path: &Path, error: McapError) -> RecordingError {
        let path = path.into();
        match error {
            McapError::Io(source) => RecordingError::Io { path, doing: "write", source },
            source => RecordingError::Write { path, source },
        }
    }
}
