//! Places of a report's files: an existing file is replaced only if it is part of a report.

use std::path::{Path, PathBuf};

use quadfrog::report::figure::Figure;
use quadfrog::report::page::Page;
use quadfrog::report::{html, svg};

use crate::subcommand::failure::{Failure, not_written};
use crate::subcommand::output_file::{require_format, require_own};

/// Refuses a file for a page when its name is not that of a page, its folder does not exist, or it is something else than a report.
pub fn require_page(file: &Path) -> Result<(), Failure> {
    require_format(file, &["html", "htm"], "a report is a page in HTML")?;
    require_own("--output", file, html::is_report)
}

/// Returns the figures of a page, each with its SVG file in a folder, which is made.
///
/// # Errors
/// When the folder is a file or cannot be made, or one of the files is something else than a figure of a report.
pub fn figure_files<'a>(folder: &Path, page: &'a Page) -> Result<Vec<(PathBuf, &'a Figure)>, Failure> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::input(format!("--figures {}: it is a file; give a folder", folder.display())));
    }
    std::fs::create_dir_all(folder).map_err(|error| not_written(folder, &error))?;
    let with_file = |figure: &'a Figure| {
        let file = folder.join(format!("{}.svg", figure.name));
        require_own("--figures", &file, svg::is_figure)?;
        Ok((file, figure))
    };
    page.figures().map(with_file).collect()
}
