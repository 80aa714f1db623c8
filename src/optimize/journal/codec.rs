//! One line of the journal: an operation and the identity of its writer, to and from JSON text.

use super::json::{LineFields, TimeForm, number, numbers, parameter_names, parse_json, text, time};
use super::operation::{AttributeKind, Operation};
use crate::optimize::space::Range;
use crate::optimize::trial::{Distribution, Trial, TrialState, number_of};
use serde_json::{Map, Value};
use std::cell::Cell;
use std::collections::BTreeMap;

/// A line of a journal.
#[derive(Debug, Clone, PartialEq)]
pub struct JournalLine {
    /// Identity of its writer.
    pub worker: String,
    /// Operation.
    pub operation: Operation,
    /// Form of its times; UTC without times.
    pub times: TimeForm,
}

impl Operation {
    /// The operation as a line of JSON, with its line end.
    pub fn to_line(&self, worker: &str, times: TimeForm) -> String {
        let (code, fields) = self.fields(times);
        format!("{{\"op_code\":{code},\"worker_id\":{}{fields}}}\n", text(worker))
    }

    fn fields(&self, times: TimeForm) -> (u8, String) {
        let time = |at| time(at, times);
        let attribute = |kind: &AttributeKind, key: &str, value: &Value| {
            format!(",\"{}\":{{{}:{value}}}", kind.member(), text(key))
        };
        match self {
            Operation::CreateStudy { name, directions } => {
                (0, format!(",\"study_name\":{},\"directions\":{}", text(name), Value::from(directions.clone())))
            }
            Operation::DeleteStudy { study } => (1, format!(",\"study_id\":{study}")),
            Operation::StudyAttribute { study, kind, key, value } => {
                (2 + *kind as u8, format!(",\"study_id\":{study}{}", attribute(kind, key, value)))
            }
            Operation::CreateTrial { study, started, template } => {
                let template = template.as_ref().map_or_else(String::new, |t| template_fields(t, times));
                (4, format!(",\"study_id\":{study},\"datetime_start\":{}{template}", time(*started)))
            }
            Operation::SetParameter { trial, name, value, distribution } => {
                let (name, value, distribution) = (text(name), number(*value), distribution_text(distribution));
                let named = format!(",\"trial_id\":{trial},\"param_name\":{name},\"param_value_internal\":{value}");
                (5, format!("{named},\"distribution\":{}", text(&distribution)))
            }
            Operation::SetState { trial, state, values, at } => {
                let when = match (state, at) {
                    (TrialState::Waiting, _) | (_, None) => String::new(),
                    (TrialState::Running, at) => format!(",\"datetime_start\":{}", time(*at)),
                    (_, at) => format!(",\"datetime_complete\":{}", time(*at)),
                };
                let (state, values) = (*state as u8, numbers(values.as_deref()));
                (6, format!(",\"trial_id\":{trial},\"state\":{state},\"values\":{values}{when}"))
            }
            Operation::SetIntermediate { trial, step, value } => {
                (7, format!(",\"trial_id\":{trial},\"step\":{step},\"intermediate_value\":{}", number(*value)))
            }
            Operation::TrialAttribute { trial, kind, key, value } => {
                (8 + *kind as u8, format!(",\"trial_id\":{trial}{}", attribute(kind, key, value)))
            }
            Operation::Nothing => (10, String::new()),
        }
    }

    /// Parses a line. The error can follow "line 12: ".
    pub fn parse(line: &str) -> Result<JournalLine, String> {
        let value = parse_json(line)?;
        let members = value.as_object().ok_or("not a JSON object")?;
        let fields = LineFields { members, times: Cell::default() };
        let worker = fields.text("worker_id")?.to_owned();
        let trial = || fields.index("trial_id");
        let study = || fields.index("study_id").map(|s| s as usize);
        let operation = match fields.index("op_code")? {
            0 => {
                let list = fields.get("directions")?.as_array().ok_or("`directions` is not a list")?;
                let directions = list.iter().map(|d| d.as_u64().ok_or("a direction is not a number"));
                let directions = directions.collect::<Result<_, _>>()?;
                Operation::CreateStudy { name: fields.text("study_name")?.to_owned(), directions }
            }
            1 => Operation::DeleteStudy { study: study()? },
            code @ (2 | 3 | 8 | 9) => {
                let kind = if code % 6 == 2 { AttributeKind::User } else { AttributeKind::System };
                let (key, value) = fields.attribute(kind.member())?;
                match code {
                    2 | 3 => Operation::StudyAttribute { study: study()?, kind, key, value },
                    _ => Operation::TrialAttribute { trial: trial()?, kind, key, value },
                }
            }
            4 => {
                let started = fields.time("datetime_start")?;
                let template =
                    fields.members.contains_key("state").then(|| read_template(&fields, line)).transpose()?;
                Operation::CreateTrial { study: study()?, started, template: template.map(Box::new) }
            }
            5 => Operation::SetParameter {
                trial: trial()?,
                name: fields.text("param_name")?.to_owned(),
                value: fields.number("param_value_internal")?,
                distribution: parse_distribution(fields.text("distribution")?)?,
            },
            6 => {
                let state = fields.state()?;
                let at = if state == TrialState::Running { "datetime_start" } else { "datetime_complete" };
                let at = fields.optional(at, LineFields::time)?;
                Operation::SetState { trial: trial()?, state, values: fields.numbers("values")?, at }
            }
            7 => {
                let step = fields.get("step")?.as_i64().ok_or("`step` is not an integer")?;
                Operation::SetIntermediate { trial: trial()?, step, value: fields.number("intermediate_value")? }
            }
            10 => Operation::Nothing,
            other => return Err(format!("op_code {other} is not one of 0 to 10")),
        };
        Ok(JournalLine { worker, operation, times: fields.times.get() })
    }
}

/// The members of a new trial's contents.
fn template_fields(trial: &Trial, times: TimeForm) -> String {
    let Trial { state, user_attributes, system_attributes, .. } = trial;
    let value = trial.value.map_or_else(|| "null".to_owned(), number);
    let completed =
        trial.completed.map_or_else(String::new, |at| format!(",\"datetime_complete\":{}", time(Some(at), times)));
    let object = |members: Vec<String>| format!("{{{}}}", members.join(","));
    let pair = |(name, value): (&String, String)| format!("{}:{value}", text(name));
    let names = || trial.parameters.iter().map(|(name, _)| name);
    let distributions = trial.distributions.iter().map(|d| text(&distribution_text(d)));
    let distributions = object(names().zip(distributions).map(pair).collect());
    let parameters = object(names().zip(trial.parameters.iter().map(|(_, v)| number(*v))).map(pair).collect());
    let attributes =
        |map: &BTreeMap<String, Value>| object(map.iter().map(|(k, v)| pair((k, v.to_string()))).collect());
    let (user, system) = (attributes(user_attributes), attributes(system_attributes));
    let intermediate = object(trial.intermediate.iter().map(|(s, v)| format!("\"{s}\":{}", number(*v))).collect());
    [
        format!(",\"state\":{},\"value\":{value},\"values\":null{completed}", *state as u8),
        format!(",\"distributions\":{distributions},\"params\":{parameters},\"user_attrs\":{user}"),
        format!(",\"system_attrs\":{system},\"intermediate_values\":{intermediate}"),
    ]
    .concat()
}

/// Reads the contents of a new trial from the members of `line`; the parameters in its order.
fn read_template(fields: &LineFields<'_>, line: &str) -> Result<Trial, String> {
    let object = |key: &str| match fields.members.get(key) {
        None | Some(Value::Null) => Ok(Map::new()),
        Some(Value::Object(map)) => Ok(map.clone()),
        Some(_) => Err(format!("`{key}` is not an object")),
    };
    let value = match fields.members.get("value") {
        Some(value) if !value.is_null() => Some(number_of(value).ok_or("`value` is not a number")?),
        _ => fields.optional("values", LineFields::numbers)?.and_then(|values| values.first().copied()),
    };
    let mut trial = Trial { state: fields.state()?, value, ..Trial::default() };
    let distributions = object("distributions")?;
    let parameters = object("params")?;
    let order = parameter_names(line);
    let place = |name: &String| order.iter().position(|ordered| ordered == name);
    let mut parameters: Vec<(&String, &Value)> = parameters.iter().collect();
    parameters.sort_by_key(|(name, _)| place(name));
    for (name, value) in parameters {
        let value = number_of(value).ok_or_else(|| format!("parameter `{name}` is not a number"))?;
        let distribution = distributions.get(name).and_then(Value::as_str);
        let distribution = distribution.ok_or_else(|| format!("parameter `{name}` has no distribution"))?;
        trial.set(name, value, parse_distribution(distribution)?);
    }
    for (step, value) in object("intermediate_values")? {
        let step = step.parse().map_err(|_| format!("step `{step}` is not an integer"))?;
        trial.intermediate.insert(step, number_of(&value).ok_or("an intermediate value is not a number")?);
    }
    trial.completed = fields.optional("datetime_complete", LineFields::time)?;
    trial.user_attributes = object("user_attrs")?.into_iter().collect();
    trial.system_attributes = object("system_attrs")?.into_iter().collect();
    Ok(trial)
}

fn distribution_text(distribution: &Distribution) -> String {
    match distribution {
        Distribution::Float(Range { low, high, log }) => format!(
            "{{\"name\": \"FloatDistribution\", \"attributes\": {{\"step\": null, \"low\": {}, \"high\": {}, \"log\": {log}}}}}",
            number(*low),
            number(*high)
        ),
        Distribution::Foreign { text, .. } => text.clone(),
    }
}

fn parse_distribution(text: &str) -> Result<Distribution, String> {
    let value = parse_json(text)?;
    let kind = value["name"].as_str().ok_or("a distribution has no `name`")?;
    let attributes = &value["attributes"];
    if kind == "FloatDistribution" && attributes["step"].is_null() {
        let bound = |key: &str| number_of(&attributes[key]).ok_or_else(|| format!("a distribution has no `{key}`"));
        let log = attributes["log"].as_bool().unwrap_or(false);
        let (low, high) = (bound("low")?, bound("high")?);
        // Optuna refuses such a distribution, too. Infinite bounds are another program's; nothing is sampled from them.
        if low.is_nan() || high.is_nan() || low > high || log && low <= 0.0 {
            return Err(format!("the bounds {low} and {high} of a distribution are no range"));
        }
        if low.is_finite() && high.is_finite() {
            return Ok(Distribution::Float(Range { low, high, log }));
        }
    }
    Ok(Distribution::Foreign { kind: kind.to_owned(), text: text.to_owned() })
}
