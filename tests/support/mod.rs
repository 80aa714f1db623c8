//! Shared by tests: golden files and the largest difference.
#![allow(dead_code, reason = "each test uses its own part")]

use std::path::PathBuf;

use serde::Deserialize;
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

/// A golden file with a list of cases.
#[derive(Deserialize)]
struct GoldenCases<T> {
    cases: Vec<T>,
}

/// Reads the cases of `folder/name` in the golden folder, or of `name` if the golden folder is `folder` itself.
pub fn golden_cases<T: DeserializeOwned>(folder: &str, name: &str) -> Vec<T> {
    let nested = format!("{folder}/{name}");
    let name = if golden_folder().join(&nested).exists() { &nested } else { name };
    golden::<GoldenCases<T>>(name).cases
}

/// Returns the bytes of a text of hexadecimal digits.
pub fn bytes(hex: &str) -> Vec<u8> {
    assert!(hex.len().is_multiple_of(2));
    (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()).collect()
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
