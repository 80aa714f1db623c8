//! Shared by tests: golden files and the largest difference.
#![allow(dead_code, reason = "each test uses its own part")]

use std::path::PathBuf;

use serde::de::DeserializeOwned;

/// The folder of golden data: the environment variable `QUADFROG_GOLDEN` where it is set, `tests/golden` otherwise.
pub fn golden_folder() -> PathBuf {
    match std::env::var_os("QUADFROG_GOLDEN") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden"),
    }
}

/// A file of Optuna's results, if it exists; the folder of golden data can be theirs alone.
pub fn golden_tpe_file(name: &str) -> Option<PathBuf> {
    [golden_folder().join("tpe").join(name), golden_folder().join(name)].into_iter().find(|path| path.exists())
}

/// Reads one golden JSON file.
pub fn golden<T: DeserializeOwned>(name: &str) -> T {
    let path = golden_folder().join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The largest absolute difference and where it was.
#[derive(Default)]
pub struct Largest {
    /// The largest absolute difference.
    pub value: f64,
    place: String,
}

impl Largest {
    /// Looks at one difference. A NaN counts as infinite: it must never pass for agreement.
    pub fn see(&mut self, difference: f64, place: impl FnOnce() -> String) {
        let size = if difference.is_nan() { f64::INFINITY } else { difference.abs() };
        if size > self.value {
            self.value = size;
            self.place = place();
        }
    }
}

impl std::fmt::Display for Largest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.2e} ({})", self.value, if self.place.is_empty() { "nowhere" } else { &self.place })
    }
}
