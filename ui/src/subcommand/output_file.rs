//! Files that commands write for their user: whole or not at all, and never over a file of another kind.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::whole_file::write_whole;

use super::failure::{Failure, not_written};

/// Writes a file, as [`write_whole`]. An existing file is replaced only where its name, after links, ends in `.extension`: a journal, a
/// recording or a script is none of the tables and pictures that commands write.
///
/// # Errors
/// As of [`require_place`], or when a file of another kind exists, before anything is written; when it cannot be written, with the
/// cause.
pub fn write_file(
    file: &Path,
    extension: &str,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Failure> {
    require_place("--output", file)?;
    if fs::canonicalize(file).is_ok_and(|place| place.is_file() && !has_extension(&place, extension)) {
        return Err(Failure::input(format!(
            "--output {}: the file exists and its name does not end in .{extension}; give another name or remove it",
            file.display()
        )));
    }
    write_whole(file, write).map_err(|error| not_written(file, &error))
}

/// Refuses the name by which other programs write to standard output. `option` is the argument that gives it.
pub fn require_name(option: &str, file: &Path) -> Result<(), Failure> {
    if file.as_os_str() == "-" {
        let text =
            format!("{option} -: it is not standard output here; leave {option} out; a file of this name is ./-");
        return Err(Failure::input(text));
    }
    Ok(())
}

/// Refuses a folder, and a file in a folder that does not exist; also as of [`require_name`].
pub fn require_place(option: &str, file: &Path) -> Result<(), Failure> {
    require_name(option, file)?;
    let refuse = |what: &str| Err(Failure::input(format!("{option} {}: {what}", file.display())));
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        return refuse(&format!("the folder {} does not exist; make it first", folder.display()));
    }
    if file.is_dir() || file.file_name().is_none() {
        return refuse("it is a folder; give the name of a file in it");
    }
    Ok(())
}

/// Refuses to replace a file that `is_own` does not recognize as one that the command writes; also as of [`require_place`].
pub fn require_own(option: &str, file: &Path, is_own: fn(&str) -> bool) -> Result<(), Failure> {
    let refuse = |what: &str| Err(Failure::input(format!("{option} {}: {what}", file.display())));
    require_place(option, file)?;
    if file.metadata().is_ok_and(|about| !about.is_file()) {
        return refuse("it is not a regular file; give another name");
    }
    match fs::read(file) {
        Ok(bytes) if is_own(&String::from_utf8_lossy(&bytes)) => Ok(()),
        Ok(_) => refuse("the file exists and is not part of a report; give another name or remove it"),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => refuse(&format!("cannot be read: {error}; give another name")),
    }
}

/// Refuses a name that says another format than that of the first of `extensions`; one that says none passes. `contents` names
/// what is written: "a report is a page in HTML".
pub fn require_format(file: &Path, extensions: &[&str], contents: &str) -> Result<(), Failure> {
    match file.extension() {
        Some(other) if !extensions.iter().any(|extension| has_extension(file, extension)) => {
            Err(Failure::input(format!(
                "--output {}: {contents}, not .{}; end its name in .{}",
                file.display(),
                other.to_string_lossy(),
                extensions[0]
            )))
        }
        _ => Ok(()),
    }
}

/// In capital letters or not.
fn has_extension(file: &Path, extension: &str) -> bool {
    file.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// Writes a text, as [`write_whole`].
///
/// # Errors
/// Those of the file system, with the name of the file.
pub fn write_text(file: &Path, text: &str) -> Result<(), Failure> {
    write_whole(file, |to| to.write_all(text.as_bytes())).map_err(|error| not_written(file, &error))
}

/// Refuses a file in whose folder, made if it is missing, no file can be written: before work whose result it is to hold. `remedy`
/// says what to give instead.
pub fn require_writable(file: &Path, remedy: &str) -> Result<(), Failure> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let probe = file.with_file_name(format!(".{}.probe", std::process::id()));
    fs::create_dir_all(folder)
        .and_then(|()| File::create(&probe))
        .and_then(|_| fs::remove_file(&probe))
        .map_err(|error| Failure::input(format!("{}: cannot be written: {error}; {remedy}", file.display())))
}
