//! A file laid over its default: every key must be in the default and of the same kind.

use std::collections::HashMap;

use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::ConfigError;

/// Origin of the values of a file, for messages.
#[derive(Debug, Clone)]
pub struct FileOrigin {
    pub file: String,
    /// Line of every key that the file gave, by the key with its tables, joined by dots.
    pub lines: HashMap<String, usize>,
    /// Whether it is an embedded default.
    pub built_in: bool,
    /// Origin of the values that the file does not give.
    pub under: Option<Box<FileOrigin>>,
    /// Keys of the file under it, unless that is built in, whose value is another one here.
    pub replaced: Vec<String>,
}

impl FileOrigin {
    /// Returns file and line of a key: in this file, else in one under it that is not built in.
    pub fn place(&self, key: &str) -> Option<String> {
        let under = || self.under.as_deref().filter(|under| !under.built_in)?.place(key);
        self.lines.get(key).map(|line| format!("{}:{line}", self.file)).or_else(under)
    }

    /// Lays the file over another: `table` are the values in force, `table_below` those without this file.
    pub fn over(mut self, below: FileOrigin, table: &Table, table_below: &Table) -> FileOrigin {
        if !below.built_in {
            let is_value = |key: &&String| lookup(table_below, key).is_some_and(|value| !value.is_table());
            let is_other = |key: &&String| lookup(table, key) != lookup(table_below, key);
            self.replaced = below.lines.keys().filter(is_value).filter(is_other).cloned().collect();
            self.replaced.sort();
        }
        self.under = Some(Box::new(below));
        self
    }

    /// Returns the error of a value: file, line, key, value and reason.
    pub fn refuse(&self, key: &str, value: impl ToString, reason: impl ToString) -> ConfigError {
        let file = self.place(key).unwrap_or_else(|| self.file.clone());
        ConfigError::Value { file, key: key.to_owned(), value: value.to_string(), reason: reason.to_string() }
    }
}

/// Lays the text of `file` over `default`; returns the values in force and their origin. Keys of `optional`, which the default leaves out, are allowed too.
pub fn merge(file: &str, text: &str, default: &Table, optional: &Table) -> Result<(Table, FileOrigin), ConfigError> {
    let line_of = |offset: usize| text[..offset.min(text.len())].matches('\n').count() + 1;
    let parsed = DeTable::parse(text).map_err(|error| ConfigError::Syntax {
        file: file.to_owned(),
        line: line_of(error.span().map_or(0, |span| span.start)),
        message: error.message().to_owned(),
    })?;
    let mut table = default.clone();
    let mut lines = HashMap::new();
    let overlay = Overlay { file, line_of: &line_of };
    overlay.lay(parsed.get_ref(), &mut table, optional, "", &mut lines)?;
    Ok((table, FileOrigin { file: file.to_owned(), lines, built_in: false, under: None, replaced: Vec::new() }))
}

struct Overlay<'a> {
    file: &'a str,
    line_of: &'a dyn Fn(usize) -> usize,
}

impl Overlay<'_> {
    fn lay(
        &self,
        over: &DeTable<'_>,
        under: &mut Table,
        optional: &Table,
        tables: &str,
        lines: &mut HashMap<String, usize>,
    ) -> Result<(), ConfigError> {
        for (name, value) in over {
            let key = format!("{tables}{}", name.get_ref());
            let line = (self.line_of)(name.span().start);
            let example = optional.get(name.get_ref().as_ref());
            if let (false, Some(example)) = (under.contains_key(name.get_ref().as_ref()), example) {
                // A table begins empty; a value begins as the example, for its kind.
                let nothing = if example.is_table() { Value::Table(Table::new()) } else { example.clone() };
                under.insert(name.get_ref().to_string(), nothing);
            }
            let Some(known) = under.get_mut(name.get_ref().as_ref()) else {
                return Err(self.unknown(&key, line, tables, name.get_ref(), under));
            };
            lines.insert(key.clone(), line);
            match (value.get_ref(), known) {
                (DeValue::Table(over), Value::Table(under)) => {
                    let nothing = Table::new();
                    let optional = example.and_then(Value::as_table).unwrap_or(&nothing);
                    self.lay(over, under, optional, &format!("{key}."), lines)?;
                }
                (given, known) => {
                    let given = plain(given);
                    if !same_kind(&given, known) {
                        return Err(ConfigError::Kind {
                            file: self.file.to_owned(),
                            line,
                            key,
                            expected: expected(known),
                            found: format!("{} {given}", kind(&given)),
                        });
                    }
                    *known = given;
                }
            }
        }
        Ok(())
    }

    fn unknown(&self, key: &str, line: usize, tables: &str, name: &str, under: &Table) -> ConfigError {
        let nearest = under
            .keys()
            .map(|known| (strsim::damerau_levenshtein(known, name), known))
            .min()
            .filter(|(distance, known)| *distance <= known.len().max(name.len()) / 2)
            .map(|(_, known)| format!("{tables}{known}"));
        ConfigError::UnknownKey { file: self.file.to_owned(), line, key: key.to_owned(), nearest }
    }
}

/// Returns the value of a key with its tables.
pub fn lookup<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let mut parts = key.split('.');
    let first = table.get(parts.next()?)?;
    parts.try_fold(first, |value, part| value.get(part))
}

/// Returns the value without the positions in the text.
fn plain(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => Value::String(text.to_string()),
        // The parser has checked the digits and resolved radix and separators. One beyond 64 bits is a number nevertheless.
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(number) => Value::Integer(number),
            Err(_) => Value::Float(number.as_str().parse().unwrap_or(f64::INFINITY)),
        },
        DeValue::Float(number) => {
            number.as_str().parse().map_or_else(|_| Value::String(number.to_string()), Value::Float)
        }
        DeValue::Boolean(truth) => Value::Boolean(*truth),
        DeValue::Datetime(time) => Value::Datetime(*time),
        DeValue::Array(list) => Value::Array(list.iter().map(|item| plain(item.get_ref())).collect()),
        DeValue::Table(table) => Value::Table(
            table.iter().map(|(name, value)| (name.get_ref().to_string(), plain(value.get_ref()))).collect(),
        ),
    }
}

/// Whether a value may replace the default's: an integer may replace a float. A list of numbers has as many as the default.
fn same_kind(given: &Value, known: &Value) -> bool {
    match (given, known) {
        (Value::Integer(_), Value::Float(_)) => true,
        (Value::Array(given), Value::Array(known)) => match known.first() {
            Some(Value::Integer(_) | Value::Float(_)) if given.len() != known.len() => false,
            Some(example) => given.iter().all(|item| same_kind(item, example)),
            None => true,
        },
        (given, known) => given.same_type(known),
    }
}

/// Returns the kind that a value must have, with the number and the kind of the entries of a list.
fn expected(known: &Value) -> String {
    let of = |first: &Value| match first {
        Value::Integer(_) => Some("whole numbers"),
        Value::Float(_) => Some("numbers"),
        Value::String(_) => Some("texts in quotes"),
        _ => None,
    };
    match known {
        Value::Array(list) => match (list.len(), list.first().and_then(of)) {
            (2, Some("numbers")) => "a list of two numbers".to_owned(),
            (count, Some("numbers")) => format!("a list of {count} numbers"),
            (_, Some(entries)) => format!("a list of {entries}"),
            (_, None) => kind(known).to_owned(),
        },
        known => kind(known).to_owned(),
    }
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "a text in quotes",
        Value::Integer(_) => "a whole number",
        Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "a list",
        Value::Table(_) => "a table",
    }
}
