//! One file over its default: every key must be known to the default and of its kind.

use std::collections::HashMap;

use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::ConfigError;

/// The merged table, and the line of every key that the file gave (keys with their tables, joined by dots).
pub struct Merged {
    /// Default and file in one.
    pub table: Table,
    /// Where the file says what it says.
    pub lines: HashMap<String, usize>,
}

/// Lays the text of `file` over `default`. Keys of `optional` may be given too, though the default leaves them out.
///
/// # Errors
/// When it is not TOML, or a key is unknown or of another kind than the default's.
pub fn merge(file: &str, text: &str, default: &Table, optional: &Table) -> Result<Merged, ConfigError> {
    let line_of = |offset: usize| text[..offset.min(text.len())].matches('\n').count() + 1;
    let parsed = DeTable::parse(text).map_err(|error| ConfigError::Syntax {
        file: file.to_owned(),
        line: line_of(error.span().map_or(0, |span| span.start)),
        message: error.message().to_owned(),
    })?;
    let mut merged = Merged { table: default.clone(), lines: HashMap::new() };
    let place = Place { file, line_of: &line_of };
    place.lay(parsed.get_ref(), &mut merged.table, optional, "", &mut merged.lines)?;
    Ok(merged)
}

struct Place<'a> {
    file: &'a str,
    line_of: &'a dyn Fn(usize) -> usize,
}

impl Place<'_> {
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
                // Of a table only the keys that are given; of a value its kind.
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
                            expected: kind(known).to_owned(),
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

/// The value without its places.
fn plain(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => Value::String(text.to_string()),
        // The parser has seen that these are numbers; radix and digit separators were resolved by it.
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
            .map_or_else(|_| Value::String(number.to_string()), Value::Integer),
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

/// Whether a value may stand where the default has another: an integer may stand for a float.
fn same_kind(given: &Value, known: &Value) -> bool {
    match (given, known) {
        (Value::Integer(_), Value::Float(_)) => true,
        (Value::Array(given), Value::Array(known)) => match known.first() {
            Some(example) => given.iter().all(|item| same_kind(item, example)),
            None => true,
        },
        (given, known) => given.same_type(known),
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
