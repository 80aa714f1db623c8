//! Import of trials from CSV and JSON tables. The columns are those of Optuna's `Study.trials_dataframe`: `value` or
//! `value_<metric>`, `datetime_start`, `datetime_complete`, `params_<name>`, `user_attrs_<name>`, `state`; every other column
//! is ignored. In JSON parameters and user attributes may also be the objects `params` and `user_attrs`.

use std::iter::Peekable;
use std::str::Chars;

use jiff::Timestamp;
use serde_json::{Map, Value};

use super::journal::moment;
use super::trial::TrialState;

/// Beginning of the column of a parameter.
pub const PARAMETER: &str = "params_";
/// Beginning of the column of a user attribute.
pub const ATTRIBUTE: &str = "user_attrs_";
/// Beginning of the column of a system attribute.
pub const SYSTEM_ATTRIBUTE: &str = "system_attrs_";
/// Column of the notes.
const NOTE: &str = "note";

/// Error in a table of trials.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum ExchangeError {
    /// Text that the parser of the format, `CSV` or `JSON`, rejects.
    #[error("not {format}: {message}")]
    Format { format: &'static str, message: String },
    #[error(
        "there is no {0}; give one parameter per column `params_<name>` (JSON: an object `params`), `value` and `state`, as \
         `quadfrog study export` does"
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
    /// Empty without one.
    pub note: String,
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
        let cells = header.iter().zip(&record).filter(|(_, cell)| !cell.is_empty());
        // A note is text, also where it looks like a number.
        let value = |column, cell: &str| if column == NOTE { Value::String(cell.to_owned()) } else { plain(cell) };
        let members = cells.map(|(column, cell)| (column.to_owned(), value(column, cell))).collect();
        trials.push(trial(row + 1, &nested(members))?);
    }
    Ok(trials)
}

/// Moves the cells of parameters and user attributes into the objects `params` and `user_attrs`, and the value of a named
/// objective to `value`.
fn nested(members: Map<String, Value>) -> Map<String, Value> {
    let (mut rest, mut parameters, mut attributes) = (Map::new(), Map::new(), Map::new());
    for (column, cell) in members {
        // A missing cell.
        let cell_of = |map: &mut Map<String, Value>, name: &str| {
            if !cell.is_null() {
                map.insert(name.to_owned(), cell.clone());
            }
        };
        if let Some(name) = column.strip_prefix(PARAMETER) {
            cell_of(&mut parameters, name);
        } else if let Some(name) = column.strip_prefix(ATTRIBUTE) {
            cell_of(&mut attributes, name);
        } else if column.starts_with("value_") || column == "values_0" {
            cell_of(&mut rest, "value");
        } else {
            rest.insert(column, cell);
        }
    }
    for (name, cells) in [("params", parameters), ("user_attrs", attributes)] {
        if let Value::Object(own) = rest.entry(name).or_insert_with(|| Value::Object(Map::new())) {
            own.extend(cells);
        }
    }
    rest
}

/// Reads a JSON array of objects.
pub fn from_json(text: &str) -> Result<Vec<TableTrial>, ExchangeError> {
    let format = |message: String| ExchangeError::Format { format: "JSON", message };
    let value: Value = serde_json::from_str(text).map_err(|error| format(error.to_string()))?;
    let Value::Array(list) = value else { return Err(format("an array of trials is expected".to_owned())) };
    let object = |(row, item): (usize, &Value)| match item {
        // A table without parameters is none of a study.
        Value::Object(members) if !members.keys().any(|name| name == "params" || name.starts_with(PARAMETER)) => {
            Err(ExchangeError::Missing("object `params`"))
        }
        Value::Object(members) => trial(row + 1, &nested(members.clone())),
        other => Err(format(format!("trial {} is {other}, not an object", row + 1))),
    };
    list.iter().enumerate().map(object).collect()
}

/// The value of a cell: JSON, or as Python prints it (`True`, `{'kp': 400.0}`), or else text.
fn plain(cell: &str) -> Value {
    let json = serde_json::from_str(cell).ok();
    json.or_else(|| python_literal(cell)).unwrap_or_else(|| Value::String(cell.to_owned()))
}

/// Reads a bool, a list or a dictionary as Python's `repr` prints it (The Python Language Reference, "Literals").
fn python_literal(cell: &str) -> Option<Value> {
    if !cell.starts_with(['{', '[', 'T', 'F']) {
        return None;
    }
    let (mut json, mut chars) = (String::new(), cell.chars().peekable());
    while let Some(&first) = chars.peek() {
        let mut run = |belongs: fn(char) -> bool| {
            let mut run = String::new();
            while let Some(next) = chars.next_if(|next| belongs(*next)) {
                run.push(next);
            }
            run
        };
        match first {
            '\'' | '"' => json.push_str(&Value::String(python_string(&mut chars)?).to_string()),
            // A number, with its exponent.
            '-' | '0'..='9' => json.push_str(&run(|next| next.is_ascii_digit() || "+-.e".contains(next))),
            _ if first.is_alphabetic() => json.push_str(match run(char::is_alphabetic).as_str() {
                "True" => "true",
                "False" => "false",
                "None" => "null",
                _ => return None,
            }),
            _ => json.extend(chars.next()),
        }
    }
    serde_json::from_str(&json).ok()
}

/// Reads a quoted text with its escapes.
fn python_string(chars: &mut Peekable<Chars>) -> Option<String> {
    let quote = chars.next()?;
    let mut text = String::new();
    loop {
        match chars.next()? {
            next if next == quote => return Some(text),
            '\\' => text.push(match chars.next()? {
                'n' => '\n',
                'r' => '\r',
                't' => '\t',
                'x' => code_point(chars, 2)?,
                'u' => code_point(chars, 4)?,
                'U' => code_point(chars, 8)?,
                same @ ('\\' | '\'' | '"') => same,
                _ => return None,
            }),
            next => text.push(next),
        }
    }
}

/// Reads a character by its code point in hexadecimal digits.
fn code_point(chars: &mut Peekable<Chars>, digits: usize) -> Option<char> {
    let digits: String = chars.by_ref().take(digits).collect();
    char::from_u32(u32::from_str_radix(&digits, 16).ok()?)
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
    let value = members.get("value").filter(|value| !value.is_null());
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
        value
            .map(|value| {
                value.as_str().and_then(|text| Some(moment(text).ok()?.0)).ok_or_else(|| cell(column, value, expected))
            })
            .transpose()
    };
    Ok(TableTrial {
        state,
        value,
        parameters: parameters.collect::<Result<_, _>>()?,
        attributes: members.get("user_attrs").and_then(Value::as_object).cloned().unwrap_or_default(),
        started: time("datetime_start")?,
        completed: time("datetime_complete")?,
        note: members.get(NOTE).and_then(Value::as_str).unwrap_or_default().to_owned(),
    })
}
