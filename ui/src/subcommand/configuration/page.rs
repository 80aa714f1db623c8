//! Reference of the configuration as Markdown.

use std::fmt::Write as _;

use quadfrog::config::{FileReference, KeyReference, NumberRange, SectionReference, reference};

/// Returns the page of all files.
pub fn reference_page() -> String {
    let mut page = String::from(
        "# Configuration reference\n\n\
         Every key of every file, made by `quadfrog config reference` from the built-in files and the ranges that the program\n\
         checks. A key that is left out has its default. On hardware the narrower range holds; where there is none, the same.\n",
    );
    for file in reference() {
        write_file(&mut page, &file);
    }
    page
}

fn write_file(page: &mut String, file: &FileReference) {
    let _ = write!(page, "\n## {}\n\n{}\n", file.name, escaped(&file.comment));
    for section in &file.sections {
        write_section(page, section);
    }
    if !file.optional.is_empty() {
        let _ = write!(
            page,
            "\n### Keys without a default\n\nWith an example of their kind:\n\n```toml\n{}```\n",
            file.optional
        );
    }
}

fn write_section(page: &mut String, section: &SectionReference) {
    if section.keys.is_empty() && section.comment.is_empty() {
        return;
    }
    if !section.table.is_empty() {
        let _ = write!(page, "\n### [{}]\n", section.table);
    }
    if !section.comment.is_empty() {
        let _ = write!(page, "\n{}\n", escaped(&section.comment));
    }
    if section.keys.is_empty() {
        return;
    }
    page.push_str("\n| key | default | range | on hardware | meaning |\n|---|---|---|---|---|\n");
    for KeyReference { name, default, range, hardware_range, comment } in &section.keys {
        let of_bool = default.as_ref().is_some_and(|default| default.is_bool());
        let range = if of_bool { "true or false".to_owned() } else { in_words(*range) };
        let hardware = in_words(*hardware_range);
        let default = match default {
            Some(default) => format!("`{}`", default.to_string().replace('|', "\\|")),
            None => "left out".to_owned(),
        };
        let _ = writeln!(page, "| `{name}` | {default} | {range} | {hardware} | {} |", escaped(comment));
    }
}

fn in_words(range: Option<&NumberRange>) -> String {
    range.map(|range| escaped(range.text.trim_start_matches("must be "))).unwrap_or_default()
}

/// Returns a comment as text of a table of Markdown.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    let mut before = ' ';
    let mut following = text.chars().skip(1).chain([' ']);
    for character in text.chars() {
        let after = following.next().unwrap_or(' ');
        // An underscore within a word has no meaning in Markdown.
        let in_word = character == '_' && before.is_alphanumeric() && after.is_alphanumeric();
        if matches!(character, '|' | '*' | '_' | '<' | '>' | '[' | ']' | '`' | '\\') && !in_word {
            escaped.push('\\');
        }
        escaped.push(character);
        before = character;
    }
    escaped
}
