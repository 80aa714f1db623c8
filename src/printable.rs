//! Characters of texts that come from outside: names, notes, journals of other programs.

use std::path::Path;

/// Returns a text without control characters: each is shown as its code, `\u001b`, a tab or a line break as a space.
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' | '\r' => shown.push(' '),
            c if is_unprintable(c) => shown += &format!("\\u{:04x}", u32::from(c)),
            c => shown.push(c),
        }
    }
    shown
}

/// Whether a character acts on a terminal or on the direction of a text, or is none in XML.
pub fn is_unprintable(c: char) -> bool {
    let directs = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || directs || matches!(c, '\u{fffe}' | '\u{ffff}')
}

/// Returns a path as one word of a shell, in single quotes if it has other characters than letters, digits and `/._-+,:=@%`
/// (POSIX.1-2024, XCU 2.2.2).
pub fn shell_word(path: &Path) -> String {
    let path = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:=@%".contains(c);
    if !path.is_empty() && path.chars().all(is_plain) {
        return path;
    }
    format!("'{}'", path.replace('\'', r"'\''"))
}
