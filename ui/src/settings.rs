//! `console.toml`: how the console looks and which keys it listens to. Every key is explained in the file itself,
//! which is also the default.

use std::collections::BTreeMap;
use std::fmt::Display;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::column::Column;
use crate::keymap::Keymap;
use crate::series::{SIGNALS, Series};

/// The defaults, and the documentation of every key.
pub const DEFAULT: &str = include_str!("../../config/console.toml");

/// The console's settings, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How often the screen is drawn at most, per second.
    pub frames_per_second: u32,
    /// How many colours.
    pub colours: ColourChoice,
    /// Which characters the charts are made of.
    pub glyphs: GlyphChoice,
    /// Whether charts sweep or scroll.
    pub chart_mode: ChartMode,
    /// Time that a chart shows, s.
    pub chart_window_s: f64,
    /// The series that the live view begins with, in the order of the charts.
    pub chart_series: Vec<Series>,
    /// The columns that the trial table begins with.
    pub trial_columns: Vec<Column>,
    /// Whether clicks and the wheel reach the console.
    pub mouse: bool,
    /// What rings the terminal's bell.
    pub bell: Vec<BellCause>,
    /// Whether a slow link is to be spared; said on the command line, not in the file.
    pub low_bandwidth: bool,
    /// The keys.
    pub keymap: Keymap,
}

/// How many colours the console uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum ColourChoice {
    /// As the terminal says in `NO_COLOR`, `COLORTERM` and `TERM`.
    #[serde(rename = "auto")]
    Auto,
    /// 24 bit.
    #[serde(rename = "true")]
    True,
    /// The 256 indexed colours.
    #[serde(rename = "256")]
    Indexed,
    /// The 16 named colours.
    #[serde(rename = "16")]
    Named,
    /// None; bold and reverse remain.
    #[serde(rename = "none")]
    None,
}

/// Which characters charts and lines are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GlyphChoice {
    /// As the locale and `TERM` allow.
    Auto,
    /// Braille: 2 x 4 dots in a character.
    Braille,
    /// One dot in a character, and line characters.
    Dots,
    /// Nothing beyond ASCII.
    Ascii,
}

/// How time runs over a chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChartMode {
    /// The axis stands still and a cursor moves over it, as on a heart monitor: little to send.
    Sweep,
    /// The newest value stands at the right edge: the whole chart is sent in every frame.
    Scroll,
}

/// What can ring the bell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BellCause {
    /// A fault was latched.
    Fault,
    /// A fall is suspected.
    Fall,
    /// A trial waits for its verdict.
    Verdict,
    /// A proposal waits for approval.
    Proposal,
}

/// A setting that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("console.toml: {key} = {value}: {reason}")]
pub struct SettingsError {
    /// The key, with its table.
    pub key: String,
    /// As written.
    pub value: String,
    /// What is wrong with it, and what to do.
    pub reason: String,
}

impl Settings {
    /// The embedded defaults.
    pub fn built_in() -> Settings {
        let table = DEFAULT.parse().expect("the embedded console.toml is TOML: a test reads it");
        Settings::from_table(&table).expect("the embedded console.toml is valid: a test reads it")
    }

    /// Checks a `console.toml` that has every key (the configuration lays an operator's file over the defaults).
    ///
    /// # Errors
    /// When a key is missing or not of its kind, a value is out of its range, or two actions share a key.
    pub fn from_table(table: &Table) -> Result<Settings, SettingsError> {
        let frames_per_second: u32 = read(table, "frames_per_second")?;
        if !(1..=30).contains(&frames_per_second) {
            return Err(refused("frames_per_second", frames_per_second, "must be 1 to 30"));
        }
        let chart_window_s: f64 = read(table, "chart_window_s")?;
        if !(1.0..=60.0).contains(&chart_window_s) {
            return Err(refused("chart_window_s", chart_window_s, "must be 1 to 60 s"));
        }
        let keys: BTreeMap<String, Vec<String>> = read(table, "keys")?;
        let keymap = Keymap::new(keys.iter().map(|(action, keys)| (action.as_str(), keys.as_slice())))
            .map_err(|error| refused(&format!("keys.{}", error.action), &error.key, &error.reason))?;
        Ok(Settings {
            frames_per_second,
            colours: read(table, "colours")?,
            glyphs: read(table, "glyphs")?,
            chart_mode: read(table, "chart_mode")?,
            chart_window_s,
            chart_series: named(table, "chart_series", Series::from_name, SIGNALS.map(|signal| signal.name))?,
            trial_columns: named(table, "trial_columns", Column::from_name, Column::ALL.map(Column::name))?,
            mouse: read(table, "mouse")?,
            bell: read(table, "bell")?,
            low_bandwidth: false,
            keymap,
        })
    }
}

fn refused(key: &str, value: impl Display, reason: impl Display) -> SettingsError {
    SettingsError { key: key.to_owned(), value: value.to_string(), reason: reason.to_string() }
}

fn read<T: DeserializeOwned>(table: &Table, key: &'static str) -> Result<T, SettingsError> {
    let value = table.get(key).ok_or_else(|| refused(key, "nothing", "is missing"))?;
    Value::try_into(value.clone()).map_err(|error: toml::de::Error| refused(key, value, error.message()))
}

/// A list of names, each of something that is known, without repetition.
fn named<T: PartialEq, const N: usize>(
    table: &Table,
    key: &'static str,
    find: impl Fn(&str) -> Option<T>,
    known: [&'static str; N],
) -> Result<Vec<T>, SettingsError> {
    let names: Vec<String> = read(table, key)?;
    let mut found = Vec::with_capacity(names.len());
    for name in names {
        let Some(item) = find(&name) else {
            return Err(refused(key, name, format!("is not one of {}", known.join(", "))));
        };
        if found.contains(&item) {
            return Err(refused(key, name, "is named twice"));
        }
        found.push(item);
    }
    if found.is_empty() {
        return Err(refused(key, "[]", format!("needs at least one of {}", known.join(", "))));
    }
    Ok(found)
}
