//! The trials of a study as a table with the columns of Optuna's `Study.trials_dataframe`: `number`, `value` or
//! `value_<metric>`, `datetime_start`, `datetime_complete`, `duration`, `params_<name>`, `user_attrs_<name>`,
//! `system_attrs_<name>`, `state`; in addition `note`. Times are UTC. A duration is a text of pandas, `0 days 00:00:03.120000`.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde_json::Value;

use super::columns::{Cells, TypedColumn};
use crate::optimize::exchange::{ATTRIBUTE, PARAMETER, SYSTEM_ATTRIBUTE};
use crate::optimize::trial::Trial;
use crate::trial::{JudgedBy, is_changed_verdict};

/// Returns the columns of the trials. `metric` is the name of the objective, empty where the study has none; `note` returns
/// the note of a trial by its number.
pub fn of(trials: &[Trial], metric: &str, note: impl Fn(u32) -> String) -> Vec<TypedColumn> {
    let number = |trial: &Trial| i64::from(trial.number);
    let value = if metric.is_empty() { "value".to_owned() } else { format!("value_{metric}") };
    let mut columns = vec![
        TypedColumn::new("number", Cells::Whole(trials.iter().map(number).collect())),
        numbers(value, trials.iter().map(|trial| trial.value)),
        times("datetime_start", trials.iter().map(|trial| trial.started)),
        times("datetime_complete", trials.iter().map(|trial| trial.completed)),
        durations(trials),
    ];
    let parameters = |trial: &Trial| trial.external_parameters().into_iter().collect();
    columns.extend(nested(PARAMETER, trials, parameters));
    columns.extend(nested(ATTRIBUTE, trials, attributes));
    columns.extend(nested(SYSTEM_ATTRIBUTE, trials, |trial| trial.system_attributes.clone()));
    let states = trials.iter().map(|trial| <&str>::from(trial.state)).collect();
    columns.push(TypedColumn::new("state", Cells::Name(states)));
    columns.push(TypedColumn::new("note", Cells::Text(trials.iter().map(|trial| note(trial.number)).collect())));
    columns
}

/// Returns the user attributes of a trial. A changed verdict is the operator's: the change holds state, value, verdict and cause alone.
fn attributes(trial: &Trial) -> BTreeMap<String, Value> {
    let mut attributes = trial.user_attributes.clone();
    if attributes.get("cause").and_then(Value::as_str).is_some_and(is_changed_verdict) {
        attributes.insert("judged_by".to_owned(), JudgedBy::Operator.name().into());
    }
    attributes
}

fn numbers(name: String, cells: impl Iterator<Item = Option<f64>>) -> TypedColumn {
    let (there, cells) = split(cells);
    TypedColumn { name, cells: Cells::Number(cells), there: Some(there) }
}

fn times(name: &str, cells: impl Iterator<Item = Option<Timestamp>>) -> TypedColumn {
    let (there, cells) = split(cells.map(|at| at.map(Timestamp::as_microsecond)));
    TypedColumn { name: name.to_owned(), cells: Cells::Time(cells), there: Some(there) }
}

fn durations(trials: &[Trial]) -> TypedColumn {
    let text = |trial: &Trial| {
        let us = trial.completed?.as_microsecond() - trial.started?.as_microsecond();
        let (days, us) = (us.div_euclid(86_400_000_000), us.rem_euclid(86_400_000_000));
        let (seconds, us) = (us / 1_000_000, us % 1_000_000);
        let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
        Some(format!("{days} days {hours:02}:{minutes:02}:{seconds:02}.{us:06}"))
    };
    let (there, cells) = split(trials.iter().map(text));
    TypedColumn { name: "duration".to_owned(), cells: Cells::Text(cells), there: Some(there) }
}

/// Returns a column for each name that a trial has, in the order of the names.
fn nested(prefix: &str, trials: &[Trial], members: impl Fn(&Trial) -> BTreeMap<String, Value>) -> Vec<TypedColumn> {
    let members: Vec<BTreeMap<String, Value>> = trials.iter().map(members).collect();
    let mut names: Vec<&String> = members.iter().flat_map(BTreeMap::keys).collect();
    names.sort();
    names.dedup();
    let column = |name: &&String| {
        let cell = |members: &BTreeMap<String, Value>| members.get(*name).filter(|value| !value.is_null()).cloned();
        let (there, values) = split(members.iter().map(cell));
        TypedColumn { name: format!("{prefix}{name}"), cells: of_one_type(values), there: Some(there) }
    };
    names.iter().map(column).collect()
}

/// Returns the cells in the type that they have in common.
fn of_one_type(values: Vec<Value>) -> Cells {
    if let Some(flags) = values.iter().map(Value::as_bool).collect() {
        return Cells::Flag(flags);
    }
    if let Some(whole) = values.iter().map(Value::as_i64).collect() {
        return Cells::Whole(whole);
    }
    let float = |value: &Value| value.as_f64().filter(|_| !value.is_u64() || value.as_i64().is_some());
    if let Some(numbers) = values.iter().map(float).collect() {
        return Cells::Number(numbers);
    }
    let texts: Option<Vec<String>> = values.iter().map(|value| value.as_str().map(str::to_owned)).collect();
    texts.map_or_else(|| Cells::Mixed(values), Cells::Text)
}

fn split<T>(cells: impl Iterator<Item = Option<T>>) -> (Vec<i16>, Vec<T>) {
    let mut filled = Vec::new();
    let mut cell = |cell: Option<T>| {
        let there = i16::from(cell.is_some());
        filled.extend(cell);
        there
    };
    let there = cells.map(&mut cell).collect();
    (there, filled)
}
