//! Export of the configuration with a found point, as a folder for `--config`.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::{Config, ConfigError, write_new_files};
use crate::trial::Task;

impl Config {
    /// Writes the files of this configuration into `folder`: a new study of `task` begins with `point` (`[first.<task>]` in
    /// `optimize.toml`), and its trials run with `gains`, both by name. A gain that is a parameter of `task` is part of the point
    /// only. Returns the written files.
    ///
    /// # Errors
    /// As of [`write_new_files`]: nothing is overwritten.
    pub fn export(
        &self,
        folder: &Path,
        task: Task,
        point: &[(String, f64)],
        gains: &[(String, f64)],
    ) -> Result<Vec<PathBuf>, ConfigError> {
        let gains: Vec<_> = gains.iter().filter(|(name, _)| !self.optimizes(task, name)).cloned().collect();
        let changed = |(name, text): &(String, String)| match name.as_str() {
            "optimize.toml" => with(text, &["first", task.name()], point),
            "control.toml" => with(text, &["tasks", task.name()], &gains),
            _ => text.clone(),
        };
        let files: Vec<_> = self.as_run.iter().map(|file| (&file.0, changed(file))).collect();
        write_new_files(folder, &files)
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
