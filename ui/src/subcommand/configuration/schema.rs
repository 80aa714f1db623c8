//! JSON schema of a file of the configuration, for editors: keys, kinds, ranges, choices, defaults and comments.

use quadfrog::config::{Config, ConfigLayer, FileReference, KeyReference, NumberRange};
use quadfrog::trial::Backend;
use serde_json::{Map, Value as Json, json};
use toml::{Table, Value};

use super::super::console::settings;

/// Returns the schema of a file, by the draft 2020-12.
pub fn schema(file: &FileReference) -> Json {
    let mut root = object(&file.comment);
    for section in &file.sections {
        let mut place = &mut root;
        for name in section.table.split('.').filter(|name| !name.is_empty()) {
            place = member(place, name, || object(""));
        }
        if !section.table.is_empty() {
            describe(place, &section.comment);
        }
        for key in &section.keys {
            let path =
                if section.table.is_empty() { key.name.clone() } else { format!("{}.{}", section.table, key.name) };
            if let Some(schema) = of_key(file, &path, key) {
                *member(place, &key.name, || Json::Null) = schema;
            }
        }
    }
    add_optional(file, &mut root, "", &file.optional);
    root["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    root["title"] = json!(file.name);
    root
}

/// Returns the schema of a table without any key.
fn object(comment: &str) -> Json {
    let mut schema = json!({"type": "object", "additionalProperties": false, "properties": {}});
    describe(&mut schema, comment);
    schema
}

fn describe(schema: &mut Json, comment: &str) {
    if !comment.is_empty() {
        schema["description"] = json!(comment);
    }
}

/// Returns the schema of a key of a table, made if it has none yet.
fn member<'a>(table: &'a mut Json, name: &str, new: impl FnOnce() -> Json) -> &'a mut Json {
    let properties = table["properties"].as_object_mut().expect("`object` gives every table its properties");
    properties.entry(name).or_insert_with(new)
}

/// Returns the schema of a key; none for a comment that only looks like a key.
fn of_key(file: &FileReference, path: &str, key: &KeyReference) -> Option<Json> {
    let mut schema = of_value(file, path, &example(file, path)?, key.range);
    if let Some(default) = &key.default {
        schema["default"] = json!(default);
    }
    let hardware = key.hardware_range.map(|range| format!("On hardware it {}.", range.text)).unwrap_or_default();
    // A comment of one sentence has no full stop of its own.
    let between = match key.comment.as_str() {
        comment if comment.is_empty() || hardware.is_empty() => "",
        comment if comment.ends_with('.') => " ",
        _ => ". ",
    };
    describe(&mut schema, &format!("{}{between}{hardware}", key.comment));
    Some(schema)
}

/// Adds the other keys that the defaults leave out, with the kinds of their examples.
fn add_optional(file: &FileReference, place: &mut Json, tables: &str, optional: &Table) {
    for (name, example) in optional {
        let path = format!("{tables}{name}");
        match example {
            Value::Table(inner) => {
                let place = member(place, name, || object(""));
                // A table of values, as the stance of a task, has a schema of its own kind.
                if place["properties"].is_object() {
                    add_optional(file, place, &format!("{path}."), inner);
                }
            }
            value => {
                let range = quadfrog::config::range_of(file.name, &path);
                member(place, name, || of_value(file, &path, value, range));
            }
        }
    }
}

/// Returns the schema of a value's kind.
fn of_value(file: &FileReference, path: &str, example: &Value, range: Option<&NumberRange>) -> Json {
    let number = |kind: &str| match range {
        Some(range) => json!({"type": kind, "minimum": range.least, "maximum": range.most}),
        None => json!({"type": kind}),
    };
    match example {
        Value::Boolean(_) => json!({"type": "boolean"}),
        Value::Integer(_) => number("integer"),
        Value::Float(_) => number("number"),
        Value::Array(items) => match items.first() {
            Some(item) => json!({"type": "array", "items": of_value(file, path, item, range)}),
            None => json!({"type": "array"}),
        },
        Value::Table(inner) => {
            let properties: Map<_, _> =
                inner.iter().map(|(name, value)| (name.clone(), of_value(file, path, value, range))).collect();
            json!({"type": "object", "additionalProperties": false, "properties": properties})
        }
        Value::String(_) | Value::Datetime(_) => match choices(file, path) {
            choices if choices.is_empty() => json!({"type": "string"}),
            choices => json!({"type": "string", "enum": choices}),
        },
    }
}

/// Returns the texts that a key takes, as the refusal of another text names them; none if it takes more than a few.
fn choices(file: &FileReference, path: &str) -> Vec<String> {
    let Some(refusal) = refusal(file, path, "?") else { return Vec::new() };
    let before = ["expected one of ", "is not one of ", "must be ", "expected "];
    let Some(names) = before.iter().find_map(|before| Some(refusal.split_once(before)?.1)) else { return Vec::new() };
    let names = names.split(';').next().unwrap_or(names).replace(" or ", ", ");
    let names: Vec<_> = names.split(", ").map(|name| name.trim_matches(['`', '"', ' ']).to_owned()).collect();
    // Of the texts that a sentence may name only those are choices that the program accepts.
    if names.iter().all(|name| refusal_of_key(file, path, name).is_none()) { names } else { Vec::new() }
}

/// Returns the message with which the program refuses a text as the value of a key.
fn refusal(file: &FileReference, path: &str, text: &str) -> Option<String> {
    let value = match example(file, path)? {
        Value::Array(_) => format!("[{text:?}]"),
        _ => format!("{text:?}"),
    };
    let layer = format!("{path} = {value}\n");
    let config = Config::layered(&[ConfigLayer { file: file.name, origin: file.name, text: &layer }]);
    let checked = config.map_err(|error| error.to_string()).and_then(|config| {
        config.objective(Backend::Simulator).map_err(|error| error.to_string())?;
        settings(&config).map(drop).map_err(|error| error.to_string())
    });
    checked.err()
}

/// Returns the refusal of a text only if it is one of this key: another key may not fit it.
fn refusal_of_key(file: &FileReference, path: &str, text: &str) -> Option<String> {
    refusal(file, path, text).filter(|message| message.contains(&format!("`{path}`")))
}

/// Returns the default of a key, or the example of one that the defaults leave out.
fn example(file: &FileReference, path: &str) -> Option<Value> {
    let in_table = |table: &Table| {
        let mut parts = path.split('.');
        let first = table.get(parts.next()?)?;
        parts.try_fold(first, |value, part| value.get(part)).cloned()
    };
    file.text.parse::<Table>().ok().as_ref().and_then(in_table).or_else(|| in_table(&file.optional))
}
