//! Errors of writing, reading and recovering a recording.

use std::io;
use std::path::PathBuf;

/// A recording could not be written, read or recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// Error of the system.
    #[error("{}: could not {doing}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Attempted action.
        doing: &'static str,
        /// Error of the system.
        source: io::Error,
    },
    /// The file exists already; nothing is overwritten.
    #[error("{}: exists already and is not overwritten; move it away or choose another name", path.display())]
    Exists {
        /// The existing file.
        path: PathBuf,
    },
    /// A name that does not end in `.mcap`.
    #[error("{}: a recording's name must end in .mcap", path.display())]
    Name {
        /// The name.
        path: PathBuf,
    },
    /// The file has no bytes.
    #[error("{}: the file is empty; nothing was recorded in it", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Not an MCAP file at all.
    #[error("{}: not an MCAP file: it begins with {found}; recordings end in .mcap or .mcap.part", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes, in hexadecimal.
        found: String,
    },
    /// An MCAP file of another program.
    #[error(
        "{}: an MCAP file, but not a recording of quadfrog: it has no /session message; open it with its own program or with Foxglove",
        path.display()
    )]
    NoSession {
        /// The file.
        path: PathBuf,
    },
    /// The first chunk, which holds the schemas and channels, is damaged.
    #[error("{}: damaged at its beginning ({source}); the rest cannot be decoded without its schemas and channels", path.display())]
    Head {
        /// The file.
        path: PathBuf,
        /// Kind of damage.
        source: mcap::McapError,
    },
    /// Cut off before the first message.
    #[error("{}: cut off after {bytes} bytes, before the session's first message; nothing in it can be played", path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Length of the file.
        bytes: u64,
    },
    /// Error of the MCAP library while writing.
    #[error("{}: could not write: {source}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Error of the library.
        source: mcap::McapError,
    },
}
