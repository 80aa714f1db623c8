//! `console.toml`: the console's appearance and keys. The file itself explains every key and holds the defaults.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::str::FromStr;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use strum::VariantArray;
use toml::{Table, Value};

use crate::column::Column;
use crate::graphics::GraphicsChoice;
use crate::keymap::Keymap;
use crate::series::Series;
use crate::theme::{ColourChoice, GlyphChoice, ThemeChoice};

/// The defaults, and the documentation of every key.
pub const DEFAULT: &str = include_str!("../data/console.toml");

/// The console's settings, checked.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct ConsoleSettings {
    /// Highest frame rate, 1/s.
    pub frames_per_second: u32,
    pub colours: ColourChoice,
    pub glyphs: GlyphChoice,
    /// Pictures of pixels.
    pub graphics: GraphicsChoice,
    /// Background that the colours suit.
    pub theme: ThemeChoice,
    /// Whether charts sweep or scroll.
    pub chart_mode: ChartMode,
    /// Time that a chart shows, s.
    pub chart_window_s: f64,
    /// Initial series of the live view, in the order of the charts.
    pub chart_series: Vec<Series>,
    /// Initial columns of the trial table.
    pub trial_columns: Vec<Column>,
    /// Whether clicks and the wheel reach the console.
    pub mouse: bool,
    pub bell: Vec<BellCause>,
    /// Whether Space stops an energised robot in a text field, too.
    pub space_always_stops: bool,
    /// Whether to save bandwidth; from the command line, not from the file.
    pub low_bandwidth: bool,
    pub keymap: Keymap,
}

/// Time axis of a chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChartMode {
    /// Fixed axis with a moving cursor, as on a heart monitor: little to send.
    Sweep,
    /// Newest value at the right edge: every frame sends the whole chart.
    Scroll,
}

/// Cause of a bell.
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
    /// Each second of the countdown to a jump.
    Countdown,
}

/// A setting that is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("console.toml: {key} = {value}: {reason}")]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct SettingsError {
    pub key: String,
    pub value: String,
    pub reason: String,
}

impl ConsoleSettings {
    /// The embedded defaults.
    pub fn built_in() -> ConsoleSettings {
        let table = DEFAULT.parse().expect("the embedded console.toml is TOML: a test reads it");
        ConsoleSettings::from_table(&table).expect("the embedded console.toml is valid: a test reads it")
    }

    /// Checks a `console.toml` that has every key (the configuration lays an operator's file over the defaults).
    ///
    /// # Errors
    /// When a key is missing or not of its kind, a value is out of its range, or two actions share a key.
    pub fn from_table(table: &Table) -> Result<ConsoleSettings, SettingsError> {
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
        Ok(ConsoleSettings {
            frames_per_second,
            colours: read(table, "colours")?,
            glyphs: read(table, "glyphs")?,
            graphics: read(table, "graphics")?,
            theme: read(table, "theme")?,
            chart_mode: read(table, "chart_mode")?,
            chart_window_s,
            chart_series: named(table, "chart_series")?,
            trial_columns: named(table, "trial_columns")?,
            mouse: read(table, "mouse")?,
            bell: read(table, "bell")?,
            space_always_stops: read(table, "space_always_stops")?,
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

/// A list of names of the variants of `T`, without repetition.
fn named<T>(table: &Table, key: &'static str) -> Result<Vec<T>, SettingsError>
where
    T: Copy + PartialEq + FromStr + VariantArray + Into<&'static str>,
{
    let known = || T::VARIANTS.iter().map(|item| (*item).into()).collect::<Vec<&str>>().join(", ");
    let names: Vec<String> = read(table, key)?;
    let mut found = Vec::with_capacity(names.len());
    for name in names {
        let Ok(item) = name.parse::<T>() else { return Err(refused(key, name, format!("is not one of {}", known()))) };
        if found.contains(&item) {
            return Err(refused(key, name, "is named twice"));
        }
        found.push(item);
    }
    if found.is_empty() {
        return Err(refused(key, "[]", format!("needs at least one of {}", known())));
    }
    Ok(found)
}
