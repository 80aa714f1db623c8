//! Export of the configuration with a found point, as a folder for `--config`.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::{Config, ConfigError};
use crate::trial::Task;

impl Config {
    /// Writes the files of this configuration into `folder`: a new study of `task` begins with `point` (`[first.<task>]` in
    /// `optimize.toml`), and its trials run with `gains`, both by name. A gain that is a parameter of `task` is part of the point
    /// only. Returns the written files.
    ///
    /// # Errors
    /// [`ConfigError::Write`] when a file exists already or cannot be written: nothing is overwritten.
    pub fn export(
        &self,
        folder: &Path,
        task: Task,
        point: &[(String, f64)],
        gains: &[(String, f64)],
    ) -> Result<Vec<PathBuf>, ConfigError> {
        let write = |path: &Path| {
            let path = path.to_owned();
            move |source| ConfigError::Write { path, source }
        };
        std::fs::create_dir_all(folder).map_err(write(folder))?;
        let paths: Vec<PathBuf> = self.as_run.iter().map(|(name, _)| folder.join(name)).collect();
        if let Some(path) = paths.iter().find(|path| path.exists()) {
            return Err(ConfigError::Write { path: path.clone(), source: std::io::ErrorKind::AlreadyExists.into() });
        }
        let gains: Vec<_> = gains.iter().filter(|(name, _)| !self.optimizes(task, name)).cloned().collect();
        for ((name, text), path) in self.as_run.iter().zip(&paths) {
            let text = match name.as_str() {
                "optimize.toml" => with(text, &["first", task.name()], point),
                "control.toml" => with(text, &["tasks", task.name()], &gains),
                _ => text.clone(),
            };
            let mut file = OpenOptions::new().write(true).create_new(true).open(path).map_err(write(path))?;
            file.write_all(text.as_bytes()).map_err(write(path))?;
        }
        Ok(paths)
    }
}

/// Returns the text of a file with numbers set in one of its tables, created if missing.
fn with(text: &str, tables: &[&str], values: &[(String, f64)]) -> String {
    let Ok(mut whole) = text.parse::<Table>() else { return text.to_owned() };
    let mut table = &mut whole;
    for name in tables {
        let inner = table.entry(*name).or_insert_with(|| Value::Table(Table::new()));
        match inner {
            Value::Table(inner) => table = inner,
            _ => return text.to_owned(),
        }
    }
    for (name, value) in values {
        table.insert(name.clone(), Value::Float(*value));
    }
    if values.is_empty() { text.to_owned() } else { whole.to_string() }
}
