//! Trials as tables: CSV and JSON, out and in. The columns are those of Optuna's `Study.trials_dataframe`, so that either
//! program reads what the other has written: `number`, `value`, `datetime_start`, `datetime_complete`, `params_<name>`,
//! `user_attrs_<name>`, `state`; besides them `note`.

use std::collections::BTreeSet;

use jiff::Timestamp;
use serde_json::{Map, Value, json};

use super::trial::{Trial, TrialState};

/// The states as Optuna writes them.
const STATES: [(TrialState, &str); 5] = [
    (TrialState::Running, "RUNNING"),
    (TrialState::Complete, "COMPLETE"),
    (TrialState::Pruned, "PRUNED"),
    (TrialState::Fail, "FAIL"),
    (TrialState::Waiting, "WAITING"),
];

const PARAMETER: &str = "params_";
const ATTRIBUTE: &str = "user_attrs_";

/// A table that cannot be read: where, what is wrong, what would do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExchangeError {
    /// Not the format that it was said to be.
    #[error("not {format}: {what}")]
    Format {
        /// `CSV` or `JSON`.
        format: &'static str,
        /// What the parser says.
        what: String,
    },
    /// A column or member is missing that every trial needs.
    #[error(
        "there is no {0}; give one parameter per column `params_<name>` (JSON: an object `params`), `value` and `state`"
    )]
    Missing(&'static str),
    /// A cell that is not what its column says.
    #[error("trial {row}: {column} = {found}: {expected}")]
    Cell {
        /// Which trial of the table, from 1.
        row: usize,
        /// The column.
        column: String,
        /// What stands there.
        found: String,
        /// What can stand there.
        expected: &'static str,
    },
}

/// A trial of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableTrial {
    /// Its state.
    pub state: TrialState,
    /// Its value, of a complete one.
    pub value: Option<f64>,
    /// Parameters by name.
    pub parameters: Vec<(String, f64)>,
    /// Attributes of the user.
    pub attributes: Map<String, Value>,
    /// When it began.
    pub started: Option<Timestamp>,
    /// When it ended.
    pub completed: Option<Timestamp>,
}

fn state_name(state: TrialState) -> &'static str {
    STATES.iter().find(|(s, _)| *s == state).map_or("FAIL", |(_, name)| name)
}

/// The parameters that a trial has, or will have if it waits.
pub fn parameters_of(trial: &Trial) -> Vec<(String, f64)> {
    if trial.state == TrialState::Waiting { trial.fixed() } else { trial.parameters.clone() }
}

/// The trials as CSV with a header; `note` gives the note of a trial by its number.
pub fn to_csv(trials: &[Trial], note: impl Fn(u32) -> String) -> String {
    let mut parameters: Vec<String> = Vec::new();
    let mut attributes: BTreeSet<&str> = BTreeSet::new();
    for trial in trials {
        for (name, _) in parameters_of(trial) {
            if !parameters.contains(&name) {
                parameters.push(name);
            }
        }
        attributes.extend(trial.user_attributes.keys().map(String::as_str));
    }
    let mut header: Vec<String> =
        ["number", "value", "datetime_start", "datetime_complete"].map(str::to_owned).to_vec();
    header.extend(parameters.iter().map(|name| format!("{PARAMETER}{name}")));
    header.extend(attributes.iter().map(|name| format!("{ATTRIBUTE}{name}")));
    header.extend(["note".to_owned(), "state".to_owned()]);
    let mut writer = csv::Writer::from_writer(Vec::new());
    let time = |at: Option<Timestamp>| at.map(|at| at.to_string()).unwrap_or_default();
    let number = |value: Option<f64>| value.map(|value| format!("{value:?}")).unwrap_or_default();
    let text = |value: Option<&Value>| match value {
        None | Some(Value::Null) => String::new(),
        // A text that would be read as something else, like the digits of a seed, keeps its quotes.
        Some(Value::String(text)) if plain(text).is_string() => text.clone(),
        Some(other) => other.to_string(),
    };
    let mut rows = vec![header];
    for trial in trials {
        let given = parameters_of(trial);
        let mut row = vec![trial.number.to_string(), number(trial.value), time(trial.started), time(trial.completed)];
        row.extend(parameters.iter().map(|name| number(given.iter().find(|(n, _)| n == name).map(|(_, v)| *v))));
        row.extend(attributes.iter().map(|name| text(trial.user_attributes.get(*name))));
        row.extend([note(trial.number), state_name(trial.state).to_owned()]);
        rows.push(row);
    }
    for row in rows {
        writer.write_record(row).expect("memory takes rows of equal length");
    }
    String::from_utf8(writer.into_inner().expect("memory is written at once")).expect("text was put in")
}

/// The trials as a JSON array of objects; `note` gives the note of a trial by its number.
pub fn to_json(trials: &[Trial], note: impl Fn(u32) -> String) -> String {
    let object = |trial: &Trial| {
        let parameters: Map<String, Value> = parameters_of(trial).into_iter().map(|(n, v)| (n, json!(v))).collect();
        json!({
            "number": trial.number,
            "state": state_name(trial.state),
            "value": trial.value,
            "datetime_start": trial.started.map(|at| at.to_string()),
            "datetime_complete": trial.completed.map(|at| at.to_string()),
            "params": parameters,
            "user_attrs": trial.user_attributes,
            "note": note(trial.number),
        })
    };
    let lines: Vec<String> = trials.iter().map(|trial| object(trial).to_string()).collect();
    format!("[\n{}\n]\n", lines.join(",\n"))
}

/// The trials of a CSV table.
///
/// # Errors
/// [`ExchangeError`] if it is none, or a cell is not what its column says.
pub fn from_csv(text: &str) -> Result<Vec<TableTrial>, ExchangeError> {
    let format = |error: csv::Error| ExchangeError::Format { format: "CSV", what: error.to_string() };
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().map_err(format)?.clone();
    if !header.iter().any(|column| column.starts_with(PARAMETER)) {
        return Err(ExchangeError::Missing("column `params_<name>`"));
    }
    let mut trials = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(format)?;
        let mut members = Map::new();
        let (mut parameters, mut attributes) = (Map::new(), Map::new());
        for (column, cell) in header.iter().zip(&record) {
            if cell.is_empty() {
                continue;
            }
            if let Some(name) = column.strip_prefix(PARAMETER) {
                parameters.insert(name.to_owned(), plain(cell));
            } else if let Some(name) = column.strip_prefix(ATTRIBUTE) {
                attributes.insert(name.to_owned(), plain(cell));
            } else {
                members.insert(column.to_owned(), plain(cell));
            }
        }
        members.insert("params".to_owned(), Value::Object(parameters));
        members.insert("user_attrs".to_owned(), Value::Object(attributes));
        trials.push(trial(row + 1, &members)?);
    }
    Ok(trials)
}

/// The trials of a JSON array.
///
/// # Errors
/// [`ExchangeError`] if it is none, or a member is not what its name says.
pub fn from_json(text: &str) -> Result<Vec<TableTrial>, ExchangeError> {
    let format = |what: String| ExchangeError::Format { format: "JSON", what };
    let value: Value = serde_json::from_str(text).map_err(|error| format(error.to_string()))?;
    let Value::Array(list) = value else { return Err(format("an array of trials is expected".to_owned())) };
    let object = |(row, item): (usize, &Value)| match item {
        Value::Object(members) => trial(row + 1, members),
        other => Err(format(format!("trial {} is {other}, not an object", row + 1))),
    };
    list.iter().enumerate().map(object).collect()
}

/// The text of a cell as the value that it shows: Python writes `True`, JSON `true`.
fn plain(cell: &str) -> Value {
    match cell {
        "True" => Value::Bool(true),
        "False" => Value::Bool(false),
        _ => serde_json::from_str(cell).unwrap_or_else(|_| Value::String(cell.to_owned())),
    }
}

fn trial(row: usize, members: &Map<String, Value>) -> Result<TableTrial, ExchangeError> {
    let cell = |column: &str, found: &Value, expected: &'static str| {
        let found = found.to_string();
        ExchangeError::Cell { row, column: column.to_owned(), found, expected }
    };
    let number = |column: &str, value: &Value| {
        let number = value.as_f64().filter(|number| number.is_finite());
        number.ok_or_else(|| cell(column, value, "must be a finite number"))
    };
    let value = match members.get("value").or_else(|| members.get("values_0")) {
        None | Some(Value::Null) => None,
        Some(value) => Some(number("value", value)?),
    };
    let state = match members.get("state") {
        // A table of points and results needs no state.
        None => {
            if value.is_some() {
                TrialState::Complete
            } else {
                TrialState::Waiting
            }
        }
        Some(name) => {
            let known = STATES.iter().find(|(_, known)| name.as_str() == Some(known));
            known.ok_or_else(|| cell("state", name, "must be COMPLETE, PRUNED, FAIL, RUNNING or WAITING"))?.0
        }
    };
    if state == TrialState::Complete && value.is_none() {
        return Err(cell("value", &Value::Null, "a complete trial has a value"));
    }
    let Some(Value::Object(given)) = members.get("params") else {
        return Err(ExchangeError::Missing("object `params`"));
    };
    let parameters =
        given.iter().map(|(name, value)| Ok((name.clone(), number(&format!("{PARAMETER}{name}"), value)?)));
    let time = |column: &str| match members.get(column) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => {
            let text = value.as_str().unwrap_or_default();
            moment(text).map(Some).ok_or_else(|| cell(column, value, "must be a time such as 2026-11-21T09:30:00Z"))
        }
    };
    Ok(TableTrial {
        state,
        value,
        parameters: parameters.collect::<Result<_, _>>()?,
        attributes: match members.get("user_attrs") {
            Some(Value::Object(attributes)) => attributes.clone(),
            _ => Map::new(),
        },
        started: time("datetime_start")?,
        completed: time("datetime_complete")?,
    })
}

/// A time with its offset, or without one as Optuna's tables have it: then it is this machine's local time.
fn moment(text: &str) -> Option<Timestamp> {
    if let Ok(at) = text.parse::<Timestamp>() {
        return Some(at);
    }
    let local: jiff::civil::DateTime = text.replacen(' ', "T", 1).parse().ok()?;
    Some(local.to_zoned(jiff::tz::TimeZone::system()).ok()?.timestamp())
}
