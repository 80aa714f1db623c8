//! Free space for recordings.

use std::io;
use std::path::Path;

use nix::sys::statvfs::statvfs;

/// Returns the free space for this user on the file system that holds `path`, MB (10^6 bytes).
///
/// # Errors
/// When the system cannot report it, for example for a missing path.
pub fn free_mb(path: &Path) -> io::Result<u64> {
    let about = statvfs(path)?;
    Ok(about.blocks_available() * about.fragment_size() / 1_000_000)
}
