//! Files written beside the study on request: the trial table, and the best parameters as a configuration.

use std::io;
use std::path::{Path, PathBuf};

use quadfrog::config::{Config, ConfigError};
use quadfrog::engine::newest_config;

use crate::model::Model;
use crate::text;

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// An operating system error.
    #[error("{path}: {source}")]
    System {
        /// The file or folder.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// The configuration cannot be read or written.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// There is nothing to write.
    #[error("no trial was accepted yet")]
    NoBest,
}

fn write(path: &Path, text: &str) -> Result<(), ExportError> {
    std::fs::write(path, text).map_err(|source| ExportError::System { path: path.to_owned(), source })
}

/// The folder of the study, or the working directory where that folder does not exist (a replay from elsewhere).
fn folder(model: &Model) -> PathBuf {
    let folder = Path::new(&model.session.info.study).parent().filter(|folder| folder.is_dir());
    folder.map_or_else(PathBuf::new, Path::to_owned)
}

/// Writes the trial table as shown, `trials.csv` and `trials.md`; returns the first.
///
/// # Errors
/// When one of them cannot be written.
pub fn table(model: &Model) -> Result<PathBuf, ExportError> {
    let csv = folder(model).join("trials.csv");
    write(&csv, &text::as_csv(model))?;
    write(&csv.with_extension("md"), &text::as_markdown(model))?;
    Ok(csv)
}

/// Writes the newest configuration of the study with its best point and the gains of that trial, as a folder
/// `best-trial-<number>` for `quadfrog --config`. Returns the folder; nothing is overwritten.
///
/// # Errors
/// When no trial was accepted, the study's configuration cannot be read, or a file is there already or cannot be written.
pub fn best(model: &Model) -> Result<PathBuf, ExportError> {
    let best = model.session.trials.best().ok_or(ExportError::NoBest)?;
    let task = model.session.info.task.ok_or(ExportError::NoBest)?;
    let study = folder(model);
    let as_run = newest_config(&study).map(|(_, config)| config);
    let config = Config::load(as_run.as_deref())?;
    let folder = study.join(format!("best-trial-{}", best.trial));
    config.export(&folder, task, &best.parameters, &best.gains)?;
    Ok(folder)
}
