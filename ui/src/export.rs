//! Files written beside the study on request: the trial table, and the best parameters as a configuration.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use quadfrog::config::Config;
use quadfrog::engine::newest_config;

use crate::message::ExportedRows;
use crate::model::Model;
use crate::text;
use crate::whole_file::write_whole;

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    write_whole(path, |to| to.write_all(text.as_bytes())).map_err(|error| anyhow!("{}: {error}", path.display()))
}

/// The folder of the study, or the working directory where that folder does not exist (a replay from elsewhere).
fn folder(model: &Model) -> PathBuf {
    let folder = Path::new(&model.session.info.study).parent().filter(|folder| folder.is_dir());
    folder.map_or_else(PathBuf::new, Path::to_owned)
}

/// Writes the trial table, `trials.csv` and `trials.md`; returns the first. That of a replay, `trials-replay.csv`, does not replace the
/// table of the session.
///
/// # Errors
/// When one of them cannot be written.
pub fn table(model: &Model, rows: ExportedRows) -> anyhow::Result<PathBuf> {
    let csv = folder(model).join(if model.replay.is_some() { "trials-replay.csv" } else { "trials.csv" });
    write(&csv, &text::as_csv(model, rows))?;
    write(&csv.with_extension("md"), &text::as_markdown(model, rows))?;
    Ok(csv)
}

/// Writes the newest configuration of the study with its best point, the gains of that trial and the bounds of the search, as a folder
/// `best-trial-<number>` for `quadfrog --config`, `best-trial-<number>-2` where that exists. Returns the folder; nothing is
/// overwritten.
///
/// # Errors
/// When no trial was accepted, the study's configuration cannot be read, or a file cannot be written.
pub fn best(model: &Model) -> anyhow::Result<PathBuf> {
    let (best, task) = model.session.trials.best().zip(model.session.info.task).context("no trial was accepted yet")?;
    let study = folder(model);
    let as_run = newest_config(&study).map(|(_, config)| config);
    let config = Config::load(as_run.as_deref())?;
    // A second export of the same trial may differ in its gains or its configuration: it has the next free name.
    let name = format!("best-trial-{}", best.trial);
    let names = std::iter::once(name.clone()).chain((2..1000).map(|number| format!("{name}-{number}")));
    let free = names.map(|name| study.join(name)).find(|folder| !folder.exists());
    let folder =
        free.with_context(|| format!("{}: no name is free for another export", study.join(&name).display()))?;
    let session = &model.session;
    let searched: Vec<_> = session.info.parameters.iter().filter_map(|p| session.parameter(&p.name)).collect();
    config.export(&folder, task, &best.parameters, &best.gains, &searched)?;
    Ok(folder)
}
