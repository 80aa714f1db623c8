//! Export and import of trials as CSV and JSON tables. The columns are those of Optuna's `Study.trials_dataframe`, for
//! exchange in both directions: `number`, `value`, `datetime_start`, `datetime_complete`, `params_<name>`,
//! `user_attrs_<name>`, `state`; in addition `note`.

use std::collections::BTreeSet;

use jiff::Timestamp;
use serde_json::{Map, Value, json};

use super::trial::{Trial, TrialState, value_of};

const PARAMETER: &str = "params_";
const ATTRIBUTE: &str = "user_attrs_";

/// Error in a table of trials.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum ExchangeError {
    /// Text that the parser of the format, `CSV` or `JSON`, rejects.
    #[error("not {format}: {message}")]
    Format { format: &'static str, message: String },
    #[error(
        "there is no {0}; give one parameter per column `params_<name>` (JSON: an object `params`), `value` and `state`"
    )]
    Missing(&'static str),
    /// Rows are counted from 1.
    #[error("trial {row}: {column} = {found}: {expected}")]
    Cell { row: usize, column: String, found: String, expected: &'static str },
}

/// A trial of a table.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the fields are those of a trial")]
pub struct TableTrial {
    pub state: TrialState,
    pub value: Option<f64>,
    pub parameters: Vec<(String, f64)>,
    pub attributes: Map<String, Value>,
    pub started: Option<Timestamp>,
    pub completed: Option<Timestamp>,
}

/// The parameters of a trial; of a waiting one those that are given.
pub fn parameters_of(trial: &Trial) -> Vec<(String, f64)> {
    if trial.state == TrialState::Waiting { trial.fixed() } else { trial.parameters.clone() }
}

/// The trials as CSV with a header; `note` returns the note of a trial by its number.
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
    let mut header = ["number", "value", "datetime_start", "datetime_complete"].map(str::to_owned).to_vec();
    header.extend(parameters.iter().map(|name| format!("{PARAMETER}{name}")));
    header.extend(attributes.iter().map(|name| format!("{ATTRIBUTE}{name}")));
    header.extend(["note", "state"].map(str::to_owned));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let time = |at: Option<Timestamp>| at.map(|at| at.to_string()).unwrap_or_default();
    let number = |value: Option<f64>| value.map(|value| format!("{value:?}")).unwrap_or_default();
    let text = |value: Option<&Value>| match value {
        None | Some(Value::Null) => String::new(),
        // A text that would be read as another type, such as the digits of a seed, keeps its quotes.
        Some(Value::String(text)) if plain(text).is_string() => text.clone(),
        Some(other) => other.to_string(),
    };
    writer.write_record(header).expect("a write to memory");
    for trial in trials {
        let given = parameters_of(trial);
        let mut row = vec![trial.number.to_string(), number(trial.value), time(trial.started), time(trial.completed)];
        row.extend(parameters.iter().map(|name| number(value_of(&given, name))));
        row.extend(attributes.iter().map(|name| text(trial.user_attributes.get(*name))));
        row.extend([note(trial.number), <&str>::from(trial.state).to_owned()]);
        writer.write_record(row).expect("rows of equal length");
    }
    String::from_utf8(writer.into_inner().expect("a write to memory")).expect("UTF-8 cells")
}

/// The trials as a JSON array of objects; `note` returns the note of a trial by its number.
pub fn to_json(trials: &[Trial], note: impl Fn(u32) -> String) -> String {
    let object = |trial: &Trial| {
        let parameters: Map<String, Value> = parameters_of(trial).into_iter().map(|(n, v)| (n, json!(v))).collect();
        json!({
            "number": trial.number,
            "state": <&str>::from(trial.state),
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

/// Reads a CSV table.
pub fn from_csv(text: &str) -> Result<Vec<TableTrial>, ExchangeError> {
    let format = |error: csv::Error| ExchangeError::Format { format: "CSV", message: error.to_string() };
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().map_err(format)?.clone();
    if !header.iter().any(|column| column.starts_with(PARAMETER)) {
        return Err(ExchangeError::Missing("column `params_<name>`"));
    }
    let mut trials = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(format)?;
        let (mut members, mut parameters, mut attributes) = (Map::new(), Map::new(), Map::new());
        for (column, cell) in header.iter().zip(&record).filter(|(_, cell)| !cell.is_empty()) {
            let (map, name) = match (column.strip_prefix(PARAMETER), column.strip_prefix(ATTRIBUTE)) {
                (Some(name), _) => (&mut parameters, name),
                (_, Some(name)) => (&mut attributes, name),
                _ => (&mut members, column),
            };
            map.insert(name.to_owned(), plain(cell));
        }
        members.insert("params".to_owned(), Value::Object(parameters));
        members.insert("user_attrs".to_owned(), Value::Object(attributes));
        trials.push(trial(row + 1, &members)?);
    }
    Ok(trials)
}

/// Reads a JSON array of objects.
pub fn from_json(text: &str) -> Result<Vec<TableTrial>, ExchangeError> {
    let format = |message: String| ExchangeError::Format { format: "JSON", message };
    let value: Value = serde_json::from_str(text).map_err(|error| format(error.to_string()))?;
    let Value::Array(list) = value else { return Err(format("an array of trials is expected".to_owned())) };
    let object = |(row, item): (usize, &Value)| match item {
        Value::Object(members) => trial(row + 1, members),
        other => Err(format(format!("trial {} is {other}, not an object", row + 1))),
    };
    list.iter().enumerate().map(object).collect()
}

/// The value of a cell; Python writes `True`, JSON `true`.
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
    let value = members.get("value").or_else(|| members.get("values_0")).filter(|value| !value.is_null());
    let value = value.map(|value| number("value", value)).transpose()?;
    let state = match members.get("state") {
        // Optional: follows from the value.
        None if value.is_some() => TrialState::Complete,
        None => TrialState::Waiting,
        Some(name) => {
            let known = name.as_str().and_then(|name| name.parse().ok());
            known.ok_or_else(|| cell("state", name, "must be COMPLETE, PRUNED, FAIL, RUNNING or WAITING"))?
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
    let time = |column: &str| {
        let value = members.get(column).filter(|value| !value.is_null());
        let expected = "must be a time such as 2026-11-21T09:30:00Z";
        value.map(|value| value.as_str().and_then(moment).ok_or_else(|| cell(column, value, expected))).transpose()
    };
    Ok(TableTrial {
        state,
        value,
        parameters: parameters.collect::<Result<_, _>>()?,
        attributes: members.get("user_attrs").and_then(Value::as_object).cloned().unwrap_or_default(),
        started: time("datetime_start")?,
        completed: time("datetime_complete")?,
    })
}

/// A time with its offset, or without one as in Optuna's tables, which have local time.
fn moment(text: &str) -> Option<Timestamp> {
    let local = || -> Option<Timestamp> {
        let local: jiff::civil::DateTime = text.replacen(' ', "T", 1).parse().ok()?;
        Some(local.to_zoned(jiff::tz::TimeZone::system()).ok()?.timestamp())
    };
    text.parse().ok().or_else(local)
}
