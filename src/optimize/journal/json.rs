//! JSON in the form of Python's `json` module, and the members of a journal line.

use crate::optimize::trial::{TrialState, number_of};
use jiff::Timestamp;
use jiff::tz::TimeZone;
use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};
use std::cell::Cell;
use std::fmt::Write as _;
use std::marker::PhantomData;

/// Form of the times in a journal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TimeForm {
    /// UTC with its offset, as Optuna 5 writes.
    #[default]
    Utc,
    /// Local time without an offset, as Optuna 4 writes. Optuna 5 reads both forms. Optuna 4 reads both, too, but does not
    /// subtract a time of one form from one of the other: its `plot_timeline` fails on a journal of both.
    Local,
}

/// The members of a line; errors name the member.
pub struct LineFields<'a> {
    pub members: &'a Map<String, Value>,
    /// Form of the times read so far.
    pub times: Cell<TimeForm>,
}

impl LineFields<'_> {
    pub fn get(&self, key: &str) -> Result<&Value, String> {
        self.members.get(key).ok_or_else(|| format!("`{key}` is missing"))
    }

    pub fn text(&self, key: &str) -> Result<&str, String> {
        self.get(key)?.as_str().ok_or_else(|| format!("`{key}` is not text"))
    }

    pub fn index(&self, key: &str) -> Result<u64, String> {
        self.get(key)?.as_u64().ok_or_else(|| format!("`{key}` is not a whole number"))
    }

    pub fn number(&self, key: &str) -> Result<f64, String> {
        number_of(self.get(key)?).ok_or_else(|| format!("`{key}` is not a number"))
    }

    pub fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>, String> {
        match self.get(key)? {
            Value::Null => Ok(None),
            Value::Array(list) => {
                let numbers = list.iter().map(|v| number_of(v).ok_or_else(|| format!("`{key}` holds no number")));
                numbers.collect::<Result<_, _>>().map(Some)
            }
            _ => Err(format!("`{key}` is neither a list nor null")),
        }
    }

    pub fn time(&self, key: &str) -> Result<Option<Timestamp>, String> {
        match self.get(key)? {
            Value::Null => Ok(None),
            Value::String(text) => {
                let (at, form) = moment(text).map_err(|e| format!("`{key}`: {e}"))?;
                if form == TimeForm::Local {
                    self.times.set(form);
                }
                Ok(Some(at))
            }
            _ => Err(format!("`{key}` is neither a time nor null")),
        }
    }

    /// A member that may be missing.
    pub fn optional<T>(
        &self,
        key: &str,
        read: impl Fn(&Self, &str) -> Result<Option<T>, String>,
    ) -> Result<Option<T>, String> {
        if self.members.contains_key(key) { read(self, key) } else { Ok(None) }
    }

    pub fn state(&self) -> Result<TrialState, String> {
        let code = self.index("state")?;
        let state = u8::try_from(code).ok().and_then(TrialState::from_repr);
        state.ok_or_else(|| format!("state {code} is not one of 0 to 4"))
    }

    pub fn attribute(&self, key: &str) -> Result<(String, Value), String> {
        let map = self.get(key)?.as_object().ok_or_else(|| format!("`{key}` is not an object"))?;
        let mut members = map.iter();
        match (members.next(), members.next()) {
            (Some((name, value)), None) => Ok((name.clone(), value.clone())),
            _ => Err(format!("`{key}` must have exactly one member, not {}", map.len())),
        }
    }
}

pub fn text(value: &str) -> String {
    Value::from(value).to_string()
}

/// A number as Python writes it, with tokens for infinities and NaN.
pub fn number(value: f64) -> String {
    match value {
        v if v.is_nan() => "NaN".to_owned(),
        f64::INFINITY => "Infinity".to_owned(),
        f64::NEG_INFINITY => "-Infinity".to_owned(),
        v => Value::from(v).to_string(),
    }
}

pub fn numbers(values: Option<&[f64]>) -> String {
    match values {
        None => "null".to_owned(),
        Some(values) => format!("[{}]", values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(",")),
    }
}

pub fn time(at: Option<Timestamp>, form: TimeForm) -> String {
    let text = |at: Timestamp| match form {
        TimeForm::Utc => at.strftime("%Y-%m-%dT%H:%M:%S.%6f+00:00").to_string(),
        TimeForm::Local => at.to_zoned(TimeZone::system()).strftime("%Y-%m-%dT%H:%M:%S.%6f").to_string(),
    };
    at.map_or_else(|| "null".to_owned(), |at| format!("\"{}\"", text(at)))
}

/// Reads a time with its offset, or without one as Optuna 4 writes it, which means local time; of a time that the change to
/// winter time repeats the earlier, as Python does.
pub fn moment(text: &str) -> Result<(Timestamp, TimeForm), jiff::Error> {
    let with_offset = text.parse().map(|at| (at, TimeForm::Utc));
    with_offset.or_else(|_| {
        let local: jiff::civil::DateTime = text.parse()?;
        Ok((local.to_zoned(TimeZone::system())?.timestamp(), TimeForm::Local))
    })
}

/// Parses JSON of Python's `json`: the bare tokens Infinity, -Infinity and NaN become text, unpaired surrogates become
/// U+FFFD.
pub fn parse_json(text: &str) -> Result<Value, String> {
    serde_json::from_str(text)
        .or_else(|strict| serde_json::from_str(&strictly(text)).map_err(|_| strict))
        .map_err(|e| format!("not JSON: {e}"))
}

/// Names of the parameters of a new trial's contents in the order of the line, which a parsed [`Value`] does not keep; none where the
/// line repeats a member.
pub fn parameter_names(line: &str) -> Vec<String> {
    let contents: Result<NewTrial, _> = serde_json::from_str(line).or_else(|_| serde_json::from_str(&strictly(line)));
    let parameters =
        contents.ok().and_then(|contents| contents.params).map_or_else(Vec::new, |parameters| parameters.0);
    parameters.into_iter().map(|(name, _)| name).collect()
}

#[derive(Deserialize)]
struct NewTrial {
    params: Option<InOrder<IgnoredAny>>,
}

/// Members of a JSON object in the order of its text; a [`Value`] sorts them. A repeated one comes again.
pub struct InOrder<V>(pub Vec<(String, V)>);

impl<'de, V: Deserialize<'de>> Deserialize<'de> for InOrder<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<InOrder<V>, D::Error> {
        struct Members<V>(PhantomData<V>);
        impl<'de, V: Deserialize<'de>> Visitor<'de> for Members<V> {
            type Value = InOrder<V>;

            fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("an object")
            }

            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<InOrder<V>, M::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(InOrder(members))
            }
        }
        deserializer.deserialize_map(Members(PhantomData))
    }
}

/// Whether a line is no JSON, as one that was cut off. Lines that only this program's parser refuses are JSON: those nested deeper than
/// 128 levels, and those with a number beyond the range of a double.
pub fn is_torn(line: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(line) else { return true };
    let parsed = serde_json::from_str::<Value>(text).or_else(|_| serde_json::from_str(&strictly(text)));
    // The parser gives these two reasons as text alone.
    let limits = ["recursion limit exceeded", "number out of range"];
    parsed.is_err_and(|fault| !limits.iter().any(|limit| fault.to_string().starts_with(limit)))
}

fn strictly(text: &str) -> String {
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
    out
}

/// Length of the escape at the start of `rest`, and its replacement.
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
