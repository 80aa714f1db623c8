//! What can go wrong with a recording: what, where, what to do.

use std::io;
use std::path::PathBuf;

/// A recording could not be written, read or recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The system refused.
    #[error("{}: could not {doing}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why it failed.
        source: io::Error,
    },
    /// Nothing may be overwritten.
    #[error("{}: exists already and is not overwritten; move it away or choose another name", path.display())]
    Exists {
        /// The file in the way.
        path: PathBuf,
    },
    /// A name that the writer cannot turn into a `.part`.
    #[error("{}: a recording's name must end in .mcap", path.display())]
    Name {
        /// The name.
        path: PathBuf,
    },
    /// Nothing was written into it.
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
    /// The beginning, which says what the rest means, is damaged.
    #[error("{}: damaged at its beginning ({source}); what follows cannot be understood without it", path.display())]
    Head {
        /// The file.
        path: PathBuf,
        /// How it is damaged.
        source: mcap::McapError,
    },
    /// Cut off before the first message.
    #[error("{}: cut off after {bytes} bytes, before the session's first message; nothing in it can be played", path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
    },
    /// The MCAP library refused to write.
    #[error("{}: could not write: {source}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: mcap::McapError,
    },
}
