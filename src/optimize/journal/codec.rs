//! One line of the journal: an operation and the identity of its writer, to and from JSON text.

use super::json::{LineFields, number, numbers, parse_json, text, time};
use super::operation::{Operation, TrialTemplate};
use crate::optimize::space::Range;
use crate::optimize::trial::{Distribution, TrialState, number_of};
use serde_json::{Map, Value};
use std::fmt::Write as _;

impl Operation {
    /// The operation as a line of JSON, with its line end.
    pub fn to_line(&self, worker: &str) -> String {
        let (code, fields) = self.fields();
        format!("{{\"op_code\":{code},\"worker_id\":{}{fields}}}\n", text(worker))
    }

    fn fields(&self) -> (u8, String) {
        let attribute = |of: &str, id: &dyn std::fmt::Display, kind: &str, key: &str, value: &Value| {
            format!(",\"{of}\":{id},\"{kind}\":{{{}:{value}}}", text(key))
        };
        match self {
            Operation::CreateStudy { name, directions } => {
                (0, format!(",\"study_name\":{},\"directions\":{}", text(name), Value::from(directions.clone())))
            }
            Operation::DeleteStudy { study } => (1, format!(",\"study_id\":{study}")),
            Operation::StudyUserAttribute { study, key, value } => {
                (2, attribute("study_id", study, "user_attr", key, value))
            }
            Operation::StudySystemAttribute { study, key, value } => {
                (3, attribute("study_id", study, "system_attr", key, value))
            }
            Operation::CreateTrial { study, started, template } => {
                let template = template.as_ref().map_or_else(String::new, |t| t.fields());
                (4, format!(",\"study_id\":{study},\"datetime_start\":{}{template}", time(*started)))
            }
            Operation::SetParameter { trial, name, value, distribution } => {
                let (name, value) = (text(name), number(*value));
                let distribution = text(&distribution_text(distribution));
                (
                    5,
                    format!(
                        ",\"trial_id\":{trial},\"param_name\":{name},\"param_value_internal\":{value},\"distribution\":{distribution}"
                    ),
                )
            }
            Operation::SetState { trial, state, values, at } => {
                let when = match (state, at) {
                    (TrialState::Waiting, _) | (_, None) => String::new(),
                    (TrialState::Running, at) => format!(",\"datetime_start\":{}", time(*at)),
                    (_, at) => format!(",\"datetime_complete\":{}", time(*at)),
                };
                (
                    6,
                    format!(
                        ",\"trial_id\":{trial},\"state\":{},\"values\":{}{when}",
                        *state as u8,
                        numbers(values.as_deref())
                    ),
                )
            }
            Operation::SetIntermediate { trial, step, value } => {
                (7, format!(",\"trial_id\":{trial},\"step\":{step},\"intermediate_value\":{}", number(*value)))
            }
            Operation::TrialUserAttribute { trial, key, value } => {
                (8, attribute("trial_id", trial, "user_attr", key, value))
            }
            Operation::TrialSystemAttribute { trial, key, value } => {
                (9, attribute("trial_id", trial, "system_attr", key, value))
            }
            Operation::Nothing => (10, String::new()),
        }
    }

    /// Parses a line into the identity of the writer and the operation.
    ///
    /// # Errors
    /// The fault of the line, as a text that can follow "line 12: ".
    pub fn parse(line: &str) -> Result<(String, Operation), String> {
        let value = parse_json(line)?;
        let fields = LineFields(value.as_object().ok_or("not a JSON object")?);
        let worker = fields.text("worker_id")?.to_owned();
        let trial = || fields.index("trial_id");
        let study = || fields.index("study_id").map(|s| s as usize);
        let operation = match fields.index("op_code")? {
            0 => {
                let directions = fields.get("directions")?.as_array().ok_or("`directions` is not a list")?;
                let directions = directions
                    .iter()
                    .map(|d| d.as_u64().ok_or("a direction is not a number"))
                    .collect::<Result<_, _>>()?;
                Operation::CreateStudy { name: fields.text("study_name")?.to_owned(), directions }
            }
            1 => Operation::DeleteStudy { study: study()? },
            2 => {
                let (key, value) = fields.attribute("user_attr")?;
                Operation::StudyUserAttribute { study: study()?, key, value }
            }
            3 => {
                let (key, value) = fields.attribute("system_attr")?;
                Operation::StudySystemAttribute { study: study()?, key, value }
            }
            4 => {
                let started = fields.time("datetime_start")?;
                let template = fields.0.contains_key("state").then(|| TrialTemplate::read(&fields)).transpose()?;
                let template = template.map(Box::new);
                Operation::CreateTrial { study: study()?, started, template }
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
            8 => {
                let (key, value) = fields.attribute("user_attr")?;
                Operation::TrialUserAttribute { trial: trial()?, key, value }
            }
            9 => {
                let (key, value) = fields.attribute("system_attr")?;
                Operation::TrialSystemAttribute { trial: trial()?, key, value }
            }
            10 => Operation::Nothing,
            other => return Err(format!("op_code {other} is not one of 0 to 10")),
        };
        Ok((worker, operation))
    }
}

impl TrialTemplate {
    fn fields(&self) -> String {
        let mut out = format!(",\"state\":{}", self.state as u8);
        let value = match self.values.as_deref() {
            Some([one]) => number(*one),
            _ => "null".to_owned(),
        };
        let _ = write!(out, ",\"value\":{value},\"values\":null");
        if let Some(at) = self.completed {
            let _ = write!(out, ",\"datetime_complete\":{}", time(Some(at)));
        }
        let object = |members: Vec<String>| format!("{{{}}}", members.join(","));
        let distributions =
            self.parameters.iter().map(|(n, _, d)| format!("{}:{}", text(n), text(&distribution_text(d)))).collect();
        let parameters = self.parameters.iter().map(|(n, v, _)| format!("{}:{}", text(n), number(*v))).collect();
        let attributes =
            |map: &Map<String, Value>| object(map.iter().map(|(k, v)| format!("{}:{}", text(k), v)).collect());
        let intermediate = self.intermediate.iter().map(|(s, v)| format!("\"{s}\":{}", number(*v))).collect();
        let _ = write!(
            out,
            ",\"distributions\":{},\"params\":{},\"user_attrs\":{},\"system_attrs\":{},\"intermediate_values\":{}",
            object(distributions),
            object(parameters),
            attributes(&self.user_attributes),
            attributes(&self.system_attributes),
            object(intermediate),
        );
        out
    }

    fn read(fields: &LineFields<'_>) -> Result<Self, String> {
        let object = |key: &str| match fields.0.get(key) {
            None | Some(Value::Null) => Ok(Map::new()),
            Some(Value::Object(map)) => Ok(map.clone()),
            Some(_) => Err(format!("`{key}` is not an object")),
        };
        let values = match fields.0.get("value") {
            Some(value) if !value.is_null() => Some(vec![number_of(value).ok_or("`value` is not a number")?]),
            _ => fields.optional("values", LineFields::numbers)?,
        };
        let distributions = object("distributions")?;
        let mut parameters = Vec::new();
        for (name, value) in object("params")? {
            let value = number_of(&value).ok_or_else(|| format!("parameter `{name}` is not a number"))?;
            let distribution = distributions.get(&name).and_then(Value::as_str);
            let distribution = distribution.ok_or_else(|| format!("parameter `{name}` has no distribution"))?;
            parameters.push((name, value, parse_distribution(distribution)?));
        }
        let mut intermediate = Vec::new();
        for (step, value) in object("intermediate_values")? {
            let step = step.parse().map_err(|_| format!("step `{step}` is not an integer"))?;
            intermediate.push((step, number_of(&value).ok_or("an intermediate value is not a number")?));
        }
        Ok(TrialTemplate {
            state: fields.state()?,
            values,
            completed: fields.optional("datetime_complete", LineFields::time)?,
            parameters,
            user_attributes: object("user_attrs")?,
            system_attributes: object("system_attrs")?,
            intermediate,
        })
    }
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
        return Ok(Distribution::Float(Range { low: bound("low")?, high: bound("high")?, log }));
    }
    Ok(Distribution::Foreign { kind: kind.to_owned(), text: text.to_owned() })
}
