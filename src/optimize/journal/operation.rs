//! One line of the journal: an operation and who wrote it, to and from JSON text.

use crate::optimize::space::Range;
use crate::optimize::trial::{Distribution, TrialState, number_of};
use jiff::Timestamp;
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::fmt::Write as _;

/// What a line of the journal does. Codes and fields are Optuna's; see its `JournalStorage`.
#[derive(Debug, Clone, PartialEq)]
pub enum Operation {
    /// 0: a new study.
    CreateStudy {
        /// Its name, unique among the living.
        name: String,
        /// Per objective: 0 not set, 1 minimize, 2 maximize.
        directions: Vec<u64>,
    },
    /// 1: a study ends to exist.
    DeleteStudy {
        /// Which.
        study: usize,
    },
    /// 2: an attribute of the user on a study.
    StudyUserAttribute {
        /// Which study.
        study: usize,
        /// Its name.
        key: String,
        /// Its value.
        value: Value,
    },
    /// 3: an attribute of the machinery on a study.
    StudySystemAttribute {
        /// Which study.
        study: usize,
        /// Its name.
        key: String,
        /// Its value.
        value: Value,
    },
    /// 4: a new trial, running unless the template says otherwise.
    CreateTrial {
        /// Of which study.
        study: usize,
        /// When it began, if it did.
        started: Option<Timestamp>,
        /// What an enqueued or imported trial brings along.
        template: Option<Box<Template>>,
    },
    /// 5: a parameter of a running trial.
    SetParameter {
        /// Which trial, counted over all studies.
        trial: u64,
        /// Its name.
        name: String,
        /// Its value as the distribution keeps it: a float's is itself.
        value: f64,
        /// Its distribution.
        distribution: Distribution,
    },
    /// 6: a trial begins to run, or ends.
    SetState {
        /// Which trial.
        trial: u64,
        /// Its new state.
        state: TrialState,
        /// The objective, of a complete one.
        values: Option<Vec<f64>>,
        /// When.
        at: Option<Timestamp>,
    },
    /// 7: an intermediate value.
    SetIntermediate {
        /// Which trial.
        trial: u64,
        /// At which step.
        step: i64,
        /// How much.
        value: f64,
    },
    /// 8: an attribute of the user on a trial.
    TrialUserAttribute {
        /// Which trial.
        trial: u64,
        /// Its name.
        key: String,
        /// Its value.
        value: Value,
    },
    /// 9: an attribute of the machinery on a trial.
    TrialSystemAttribute {
        /// Which trial.
        trial: u64,
        /// Its name.
        key: String,
        /// Its value.
        value: Value,
    },
    /// 10: written by other programs; without effect here as in Optuna 5.
    Nothing,
}

/// The contents with which a trial is created when it is enqueued or imported.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// Its state.
    pub state: TrialState,
    /// The objective, if it has one.
    pub values: Option<Vec<f64>>,
    /// When it was finished.
    pub completed: Option<Timestamp>,
    /// Parameters with their distributions.
    pub parameters: Vec<(String, f64, Distribution)>,
    /// Attributes of the user.
    pub user_attributes: Map<String, Value>,
    /// Attributes of the machinery.
    pub system_attributes: Map<String, Value>,
    /// Intermediate values by step.
    pub intermediate: Vec<(i64, f64)>,
}

impl Operation {
    /// The operation as a line of JSON, with its line end.
    pub fn to_line(&self, worker: &str) -> String {
        let (code, fields) = self.fields();
        format!("{{\"op_code\":{code},\"worker_id\":{}{fields}}}\n", text(worker))
    }

    fn fields(&self) -> (u8, String) {
        let attribute = |of: &str, id: &dyn std::fmt::Display, kind: &str, key: &str, value: &Value| {
            format!(",\"{of}\":{id},\"{kind}\":{{{}:{}}}", text(key), json(value))
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

    /// Reads a line: the writer's identity and the operation.
    ///
    /// # Errors
    /// What is wrong with the line, in words that can follow "line 12: ".
    pub fn parse(line: &str) -> Result<(String, Operation), String> {
        let value = parse_json(line)?;
        let fields = Fields(value.as_object().ok_or("not a JSON object")?);
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
                let template =
                    if fields.0.contains_key("state") { Some(Box::new(Template::read(&fields)?)) } else { None };
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
                let at = if fields.0.contains_key(at) { fields.time(at)? } else { None };
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
            other => return Err(format!("op_code {other} is not one of the journal's (0 to 10)")),
        };
        Ok((worker, operation))
    }
}

impl Template {
    /// A trial that waits to be run with the given parameters.
    pub fn waiting(fixed: Map<String, Value>, user_attributes: Map<String, Value>) -> Self {
        let system_attributes =
            Map::from_iter([(crate::optimize::trial::FIXED_PARAMS.to_owned(), Value::Object(fixed))]);
        Template {
            state: TrialState::Waiting,
            values: None,
            completed: None,
            parameters: Vec::new(),
            user_attributes,
            system_attributes,
            intermediate: Vec::new(),
        }
    }

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
            |map: &Map<String, Value>| object(map.iter().map(|(k, v)| format!("{}:{}", text(k), json(v))).collect());
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

    fn read(fields: &Fields<'_>) -> Result<Self, String> {
        let object = |key: &str| match fields.0.get(key) {
            None | Some(Value::Null) => Ok(Map::new()),
            Some(Value::Object(map)) => Ok(map.clone()),
            Some(_) => Err(format!("`{key}` is not an object")),
        };
        let values = match fields.0.get("value") {
            Some(value) if !value.is_null() => Some(vec![number_of(value).ok_or("`value` is not a number")?]),
            _ => {
                if fields.0.contains_key("values") {
                    fields.numbers("values")?
                } else {
                    None
                }
            }
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
        Ok(Template {
            state: fields.state()?,
            values,
            completed: if fields.0.contains_key("datetime_complete") {
                fields.time("datetime_complete")?
            } else {
                None
            },
            parameters,
            user_attributes: object("user_attrs")?,
            system_attributes: object("system_attrs")?,
            intermediate,
        })
    }
}

/// The members of a line, with errors that name the member.
struct Fields<'a>(&'a Map<String, Value>);

impl Fields<'_> {
    fn get(&self, key: &str) -> Result<&Value, String> {
        self.0.get(key).ok_or_else(|| format!("`{key}` is missing"))
    }

    fn text(&self, key: &str) -> Result<&str, String> {
        self.get(key)?.as_str().ok_or_else(|| format!("`{key}` is not text"))
    }

    fn index(&self, key: &str) -> Result<u64, String> {
        self.get(key)?.as_u64().ok_or_else(|| format!("`{key}` is not a whole number"))
    }

    fn number(&self, key: &str) -> Result<f64, String> {
        number_of(self.get(key)?).ok_or_else(|| format!("`{key}` is not a number"))
    }

    fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>, String> {
        match self.get(key)? {
            Value::Null => Ok(None),
            Value::Array(list) => {
                let numbers = list.iter().map(|v| number_of(v).ok_or_else(|| format!("`{key}` holds no number")));
                numbers.collect::<Result<_, _>>().map(Some)
            }
            _ => Err(format!("`{key}` is neither a list nor null")),
        }
    }

    fn time(&self, key: &str) -> Result<Option<Timestamp>, String> {
        match self.get(key)? {
            Value::Null => Ok(None),
            Value::String(text) => text.parse().map(Some).map_err(|e| format!("`{key}`: {e}")),
            _ => Err(format!("`{key}` is neither a time nor null")),
        }
    }

    fn state(&self) -> Result<TrialState, String> {
        match self.index("state")? {
            0 => Ok(TrialState::Running),
            1 => Ok(TrialState::Complete),
            2 => Ok(TrialState::Pruned),
            3 => Ok(TrialState::Fail),
            4 => Ok(TrialState::Waiting),
            other => Err(format!("state {other} is not one of 0 to 4")),
        }
    }

    fn attribute(&self, key: &str) -> Result<(String, Value), String> {
        let map = self.get(key)?.as_object().ok_or_else(|| format!("`{key}` is not an object"))?;
        let mut members = map.iter();
        match (members.next(), members.next()) {
            (Some((name, value)), None) => Ok((name.clone(), value.clone())),
            _ => Err(format!("`{key}` must have exactly one member, not {}", map.len())),
        }
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

fn text(value: &str) -> String {
    Value::from(value).to_string()
}

/// A number as Python's JSON writes it, which has tokens for what is not finite.
fn number(value: f64) -> String {
    match value {
        v if v.is_nan() => "NaN".to_owned(),
        f64::INFINITY => "Infinity".to_owned(),
        f64::NEG_INFINITY => "-Infinity".to_owned(),
        v => Value::from(v).to_string(),
    }
}

fn numbers(values: Option<&[f64]>) -> String {
    match values {
        None => "null".to_owned(),
        Some(values) => format!("[{}]", values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(",")),
    }
}

fn json(value: &Value) -> String {
    value.to_string()
}

fn time(at: Option<Timestamp>) -> String {
    at.map_or_else(|| "null".to_owned(), |at| format!("\"{}\"", at.strftime("%Y-%m-%dT%H:%M:%S.%6f+00:00")))
}

/// Reads JSON as Python's `json` writes it: the bare tokens Infinity, -Infinity and NaN become text, and halves of
/// surrogate pairs without the other half become U+FFFD.
fn parse_json(text: &str) -> Result<Value, String> {
    serde_json::from_str(text)
        .or_else(|strict| serde_json::from_str(&strictly(text)).map_err(|_| strict))
        .map_err(|e| format!("not JSON: {e}"))
}

fn strictly(text: &str) -> Cow<'_, str> {
    let mut out = String::with_capacity(text.len() + 16);
    let mut rest = text;
    let mut quoted = false;
    while let Some(c) = rest.chars().next() {
        let token = ["-Infinity", "Infinity", "NaN"].into_iter().find(|t| !quoted && rest.starts_with(t));
        let taken = match (token, c) {
            (Some(token), _) => {
                let _ = write!(out, "\"{token}\"");
                token.len()
            }
            (None, '\\') if quoted => {
                let (escape, replacement) = escape(rest);
                out.push_str(replacement);
                escape
            }
            (None, _) => {
                quoted ^= c == '"';
                out.push(c);
                c.len_utf8()
            }
        };
        rest = &rest[taken..];
    }
    Cow::Owned(out)
}

/// Length of the escape at the start of `rest` and what stands for it.
fn escape(rest: &str) -> (usize, &str) {
    let code = |at: usize| {
        let hex = rest.get(at..at + 6)?.strip_prefix("\\u")?;
        u16::from_str_radix(hex, 16).ok()
    };
    match code(0) {
        Some(0xD800..=0xDBFF) if matches!(code(6), Some(0xDC00..=0xDFFF)) => (12, &rest[..12]),
        Some(0xD800..=0xDFFF) => (6, "\\ufffd"),
        Some(_) => (6, &rest[..6]),
        None => {
            let length = 1 + rest[1..].chars().next().map_or(0, char::len_utf8);
            (length, &rest[..length])
        }
    }
}
