//! Export of the configuration with a found point, as a folder for `--config`.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::{Config, ConfigError, write_new_files};
use crate::trial::{ParameterInfo, Task};

impl Config {
    /// Writes the files of this configuration into `folder`: a new study of `task` begins with `point` (`[first.<task>]` in
    /// `optimize.toml`), and its trials run with `gains`, both by name. A gain that is a parameter of `task` is part of the point
    /// only. `searched`: the parameters with the bounds of the study that has found the point; they replace those of this
    /// configuration, and hold the point. Returns the written files.
    ///
    /// # Errors
    /// As of [`write_new_files`]: nothing is overwritten.
    pub fn export(
        &self,
        folder: &Path,
        task: Task,
        point: &[(String, f64)],
        gains: &[(String, f64)],
        searched: &[ParameterInfo],
    ) -> Result<Vec<PathBuf>, ConfigError> {
        let number = |(name, value): &(String, f64)| (name.clone(), Value::Float(*value));
        let bounds: Vec<_> =
            self.parameters(task).iter().filter_map(|own| changed_bounds(own, searched, point)).collect();
        let gains: Vec<_> = gains.iter().filter(|(name, _)| !self.optimizes(task, name)).cloned().collect();
        let changed = |(name, text): &(String, String)| match name.as_str() {
            "optimize.toml" => {
                let first = with(text, &["first", task.name()], point.iter().map(number).collect());
                with(&first, &["bounds"], bounds.clone())
            }
            "control.toml" => with(text, &["tasks", task.name()], gains.iter().map(number).collect()),
            _ => text.clone(),
        };
        let files: Vec<_> = self.as_run.iter().map(|file| (&file.0, changed(file))).collect();
        write_new_files(folder, &files)
    }
}

/// Returns the bounds of the parameter `own` in `searched`, wide enough for `point`; none where its own are those.
fn changed_bounds(own: &ParameterInfo, searched: &[ParameterInfo], point: &[(String, f64)]) -> Option<(String, Value)> {
    let bounds = searched.iter().find(|p| p.name == own.name).unwrap_or(own);
    let value = point.iter().find(|(name, _)| *name == own.name).map_or(bounds.low, |(_, value)| *value);
    let (low, high) = (bounds.low.min(value), bounds.high.max(value));
    ((low, high) != (own.low, own.high))
        .then(|| (own.name.clone(), Value::Array(vec![Value::Float(low), Value::Float(high)])))
}

/// Returns the text of a file with values set in one of its tables, created if missing.
fn with(text: &str, tables: &[&str], values: Vec<(String, Value)>) -> String {
    if values.is_empty() {
        return text.to_owned();
    }
    let Ok(mut whole) = text.parse::<Table>() else { return text.to_owned() };
    let mut table = &mut whole;
    for name in tables {
        let inner = table.entry(*name).or_insert_with(|| Value::Table(Table::new()));
        match inner {
            Value::Table(inner) => table = inner,
            _ => return text.to_owned(),
        }
    }
    table.extend(values);
    whole.to_string()
}
