//! A study's configuration beside the defaults.

use toml::{Table, Value};

/// A key whose value differs from the default.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangedKey {
    /// File and key, `control.toml: tasks.forward.kp`.
    pub key: String,
    /// Default; empty for a key that the defaults leave out.
    pub default: String,
    /// Value of the study; empty for a key that it leaves out.
    pub value: String,
}

/// Returns the keys in which `own` differs from `defaults`, both given as name and text of each file, in the order of
/// files and keys. A text that is no TOML has no keys.
pub fn differences(defaults: &[(String, String)], own: &[(String, String)]) -> Vec<ChangedKey> {
    let mut changed = Vec::new();
    for (name, text) in own {
        let theirs = defaults.iter().find(|(default, _)| default == name).map_or("", |(_, text)| text);
        let (before, after) = (keys(theirs), keys(text));
        let names = before.iter().chain(&after).map(|(key, _)| key);
        let mut names: Vec<&String> = names.collect();
        names.sort();
        names.dedup();
        for key in names {
            let of = |pairs: &[(String, String)]| pairs.iter().find(|(known, _)| known == key).map(|(_, v)| v.clone());
            let (default, value) = (of(&before), of(&after));
            if default != value {
                let [default, value] = [default, value].map(Option::unwrap_or_default);
                changed.push(ChangedKey { key: format!("{name}: {key}"), default, value });
            }
        }
    }
    changed
}

/// Returns every key with its value as text.
fn keys(text: &str) -> Vec<(String, String)> {
    let mut pairs = Vec::new();
    collect("", &text.parse::<Table>().unwrap_or_default(), &mut pairs);
    pairs
}

fn collect(prefix: &str, table: &Table, pairs: &mut Vec<(String, String)>) {
    for (name, value) in table {
        let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            Value::Table(inner) => collect(&key, inner, pairs),
            value => pairs.push((key, value.to_string())),
        }
    }
}
