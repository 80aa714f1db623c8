//! Files that the operator asks for, beside the study: the trial table, and the best parameters as a configuration.

use std::io;
use std::path::{Path, PathBuf};

use quadfrog::recording::record::TrialRecord;

use crate::model::Model;
use crate::view::trial_text;

/// Share of a parameter's range to either side of the best value that an exported configuration searches.
const AROUND: f64 = 0.1;

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

/// Writes the best parameters as a folder `best` that `quadfrog --config` takes: bounds around them, and the gains that
/// the best trial ran with. Returns the folder.
///
/// # Errors
/// When no trial was accepted, or a file cannot be written.
pub fn best(model: &Model) -> Result<PathBuf, ExportError> {
    let best = model.best().ok_or(ExportError::NoBest)?;
    let folder = folder(model).join("best");
    std::fs::create_dir_all(&folder).map_err(|source| ExportError::System { path: folder.clone(), source })?;
    write(&folder.join("optimize.toml"), &bounds(model, best))?;
    if !best.gains.is_empty() {
        write(&folder.join("control.toml"), &gains(model, best))?;
    }
    Ok(folder)
}

/// `optimize.toml`: a tenth of each range to either side of the best value, within the study's bounds.
fn bounds(model: &Model, best: &TrialRecord) -> String {
    let session = &model.session;
    let value = best.value.map_or("none".to_owned(), |value| format!("{value:.4} {}", session.unit));
    let mut text = format!(
        "# Around the best of {} trials of {} on {}: trial {}, J = {value}.\n\n[bounds]\n",
        model.trials.len(),
        session.task,
        session.robot,
        best.trial
    );
    for (name, value) in &best.parameters {
        let Some(info) = session.parameters.iter().find(|info| info.name == *name) else { continue };
        let reach = AROUND * (info.high - info.low);
        let (low, high) = ((value - reach).max(info.low), (value + reach).min(info.high));
        // Rust writes the shortest digits that read back to the same number; TOML wants a point in a float.
        text.push_str(&format!("{name} = [{low:?}, {high:?}] # {}; the best is {value:?}\n", info.unit));
    }
    text
}

/// `control.toml`: the gains of the best trial, for its task.
fn gains(model: &Model, best: &TrialRecord) -> String {
    let mut text = format!("# The gains of trial {}.\n\n[tasks.{}]\n", best.trial, model.session.task);
    for (name, value) in &best.gains {
        let unit = model.gain(name).map_or("", |info| info.unit.as_str());
        text.push_str(&format!("{name} = {value:?} # {unit}\n"));
    }
    text
}
