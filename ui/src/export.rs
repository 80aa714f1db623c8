//! Files that the operator asks for, beside the study: the trial table, and the best parameters as a configuration.

use std::io;
use std::path::{Path, PathBuf};

use quadfrog::config::{Config, ConfigError};

use crate::model::Model;
use crate::view::trial_text;

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The system refused.
    #[error("{path}: {source}")]
    System {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
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

/// The folder of the study; where it is not there (a replay of a recording from elsewhere), the present one.
fn folder(model: &Model) -> PathBuf {
    let folder = Path::new(&model.session.study).parent().filter(|folder| folder.is_dir());
    folder.map_or_else(PathBuf::new, Path::to_owned)
}

/// Writes the trial table as shown, `trials.csv` and `trials.md`; returns the first.
///
/// # Errors
/// When one of them cannot be written.
pub fn table(model: &Model) -> Result<PathBuf, ExportError> {
    let csv = folder(model).join("trials.csv");
    write(&csv, &trial_text::as_csv(model))?;
    write(&csv.with_extension("md"), &trial_text::as_markdown(model))?;
    Ok(csv)
}

/// Writes the configuration of the study with its best point and the gains that it ran with, as a folder
/// `best-trial-<number>` that `quadfrog --config` takes: a new study begins there. Returns the folder; nothing is
/// overwritten.
///
/// # Errors
/// When no trial was accepted, the study's configuration cannot be read, or a file is there already or cannot be written.
pub fn best(model: &Model) -> Result<PathBuf, ExportError> {
    let best = model.best().ok_or(ExportError::NoBest)?;
    let task = model.session.task.ok_or(ExportError::NoBest)?;
    let study = folder(model);
    let as_run = Some(study.join("config")).filter(|config| config.is_dir());
    let config = Config::load(as_run.as_deref())?;
    let folder = study.join(format!("best-trial-{}", best.trial));
    config.export(&folder, task, &best.parameters, &best.gains)?;
    Ok(folder)
}
