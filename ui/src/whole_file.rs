//! Files that are written whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::Path;

use quadfrog::unfinished::Unfinished;

/// Writes a file under another name beside its place, after links, until it is complete, so that an error leaves what was there. A
/// file that it replaces hands its permissions on. A device or a pipe is written in place.
///
/// # Errors
/// Those of the file system.
pub fn write_whole(file: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    // What does not exist, or leads nowhere, is written as it is named.
    let file = &fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
    let replaced = fs::metadata(file).ok();
    if replaced.as_ref().is_some_and(|about| !about.is_file()) {
        return OpenOptions::new().write(true).open(file).and_then(|opened| whole(opened, write)).map(drop);
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let part = file.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let _unfinished = Unfinished::enter(&part);
    let written = File::create(&part)
        .and_then(|part| replaced.map_or(Ok(()), |old| part.set_permissions(old.permissions())).map(|()| part))
        .and_then(|part| whole(part, write))
        .and_then(|part| part.sync_all())
        .and_then(|()| fs::rename(&part, file));
    if written.is_err() {
        // The error that is reported is that of the writing.
        let _ = fs::remove_file(&part);
    }
    written
}

fn whole(file: File, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<File> {
    let mut file = BufWriter::new(file);
    write(&mut file)?;
    file.into_inner().map_err(io::IntoInnerError::into_error)
}
