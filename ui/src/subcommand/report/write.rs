//! Files of a report: written beside their place and renamed, so that a file is whole or as before.

use std::path::Path;

use quadfrog::report::{html, svg};

use crate::subcommand::failure::Failure;
use crate::subcommand::output_file::{not_written, require_format, require_place, write_text};

/// Writes a page; an existing file is replaced only if it is a report.
///
/// # Errors
/// When the name is not that of a page, the file is something else, its folder does not exist, or it cannot be written.
pub fn write_page(file: &Path, text: &str) -> Result<(), Failure> {
    require_format(file, &["html", "htm"], "a report is a page in HTML")?;
    check(file, "--output", html::is_report)?;
    write_text(file, text)
}

/// Writes figures as SVG files of their names into a folder, which is made; an existing file is replaced only if it is a
/// figure of a report. Returns their number. Nothing is written if one of them is refused.
///
/// # Errors
/// As of [`write_page`].
pub fn write_figures<'a>(
    folder: &Path,
    figures: impl IntoIterator<Item = (&'a str, String)>,
) -> Result<usize, Failure> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::input(format!("--figures {}: it is a file; give a folder", folder.display())));
    }
    let files: Vec<_> = figures.into_iter().map(|(name, text)| (folder.join(format!("{name}.svg")), text)).collect();
    std::fs::create_dir_all(folder).map_err(|error| not_written(folder, &error))?;
    for (file, _) in &files {
        check(file, "--figures", svg::is_figure)?;
    }
    for (file, text) in &files {
        write_text(file, text)?;
    }
    Ok(files.len())
}

fn check(file: &Path, option: &str, is_ours: fn(&str) -> bool) -> Result<(), Failure> {
    let refuse = |what: &str| Err(Failure::input(format!("{option} {}: {what}", file.display())));
    require_place(option, file)?;
    if file.metadata().is_ok_and(|about| !about.is_file()) {
        return refuse("it is not a regular file; give another name");
    }
    match std::fs::read(file) {
        Ok(bytes) if is_ours(&String::from_utf8_lossy(&bytes)) => Ok(()),
        Ok(_) => refuse("the file exists and is not part of a report; give another name or remove it"),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => refuse(&format!("cannot be read: {error}; give another name")),
    }
}
