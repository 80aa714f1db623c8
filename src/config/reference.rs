//! Reference of the configuration: every key of the default files with its default, its ranges and its comment.

use toml::{Table, Value};

use super::defaults::{FILES, OPTIONAL, template};
use super::merge::lookup;
use super::ranges;
use crate::sim::ranges::NumberRange;

/// A file of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct FileReference {
    /// Its name, for example `control.toml`.
    pub name: &'static str,
    /// Its text, with which a configuration can begin.
    pub text: &'static str,
    /// Its first comment.
    pub comment: String,
    /// Its tables in their order; the first one, with an empty name, has the keys outside of tables.
    pub sections: Vec<SectionReference>,
    /// Keys that it leaves out, each with an example of its kind.
    pub optional: Table,
}

/// A table of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SectionReference {
    /// Its name with those of the tables around it, for example `tasks.forward`.
    pub table: String,
    /// Its comments: all that are not of one key.
    pub comment: String,
    /// Its keys in their order, also those without a default.
    pub keys: Vec<KeyReference>,
}

/// A key of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyReference {
    /// Its name.
    pub name: String,
    /// Its default; none for a key that the file has as a comment, `# trials = 10`.
    pub default: Option<Value>,
    /// Range of its numbers on every backend; none if it holds none.
    pub range: Option<&'static NumberRange>,
    /// Narrower range on hardware; none where the same range holds.
    pub hardware_range: Option<&'static NumberRange>,
    /// Its comment: unit, meaning, reason or source.
    pub comment: String,
}

/// Returns all files of the configuration.
pub fn reference() -> Vec<FileReference> {
    FILES.iter().map(|(name, text)| file_reference(name, text)).collect()
}

/// Returns the range of a number of `file` on every backend, by its key with its tables.
pub fn range_of(file: &str, key: &str) -> Option<&'static NumberRange> {
    ranges::of_key(file, key).0
}

/// Reads a default file line by line: tables and keys with the comments beside, below and above them.
fn file_reference(name: &'static str, text: &'static str) -> FileReference {
    let values = template(text);
    let mut file = FileReference {
        name,
        text,
        comment: String::new(),
        sections: vec![SectionReference::default()],
        optional: OPTIONAL
            .iter()
            .find(|(file, _)| *file == name)
            .map(|(_, example)| template(example))
            .unwrap_or_default(),
    };
    // Comment lines whose table or key is not known yet.
    let mut above = String::new();
    // Whether a line with an indented comment continues the comment of a key, or of a table.
    let mut of_key = false;
    for line in text.lines() {
        let commented = line.strip_prefix("# ").filter(|code| is_key(code));
        let (code, comment) = split_comment(commented.unwrap_or(line));
        let last = file.sections.len() - 1;
        let section = &mut file.sections[last];
        if code.is_empty() {
            if comment.is_empty() {
                let place = if file.comment.is_empty() && last == 0 { &mut file.comment } else { &mut section.comment };
                append(place, &std::mem::take(&mut above));
            } else if line.starts_with('#') {
                append(&mut above, comment);
            } else {
                match section.keys.last_mut() {
                    Some(key) if of_key => append(&mut key.comment, comment),
                    _ => append(&mut section.comment, comment),
                }
            }
        } else if let Some(table) = code.strip_prefix('[').and_then(|code| code.strip_suffix(']')) {
            let mut opened = SectionReference { table: table.to_owned(), ..SectionReference::default() };
            append(&mut opened.comment, &std::mem::take(&mut above));
            append(&mut opened.comment, comment);
            file.sections.push(opened);
            of_key = false;
        } else if let Some((key, _)) = code.split_once('=') {
            let key = key.trim().trim_matches('"').to_owned();
            let path = if section.table.is_empty() { key.clone() } else { format!("{}.{key}", section.table) };
            let default = lookup(&values, &path).cloned();
            // A commented key may repeat another one as an example.
            if default.is_some() == commented.is_some() {
                continue;
            }
            let (range, hardware_range) = ranges::of_key(name, &path);
            let mut found = KeyReference { name: key, default, range, hardware_range, comment: String::new() };
            append(&mut found.comment, &std::mem::take(&mut above));
            append(&mut found.comment, comment);
            section.keys.push(found);
            of_key = true;
        }
    }
    let last = file.sections.len() - 1;
    append(&mut file.sections[last].comment, &above);
    file
}

/// Whether the text of a comment is a key with a value, `trials = 10 # of a study`, or a table.
fn is_key(comment: &str) -> bool {
    split_comment(comment).0.parse::<Table>().is_ok_and(|table| !table.is_empty())
}

/// Returns the code of a line and its comment, without `#`.
fn split_comment(line: &str) -> (&str, &str) {
    let mut quoted = false;
    let begin = line.char_indices().find(|&(_, character)| {
        quoted ^= character == '"';
        character == '#' && !quoted
    });
    match begin {
        Some((at, _)) => (line[..at].trim(), line[at + 1..].trim()),
        None => (line.trim(), ""),
    }
}

fn append(text: &mut String, more: &str) {
    if !text.is_empty() && !more.is_empty() {
        text.push(' ');
    }
    text.push_str(more);
}
