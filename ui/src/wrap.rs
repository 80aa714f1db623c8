//! Lines that continue at a word, so that no sentence is cut.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

/// The text with spaces at which [`wrap`] does not break it; they are drawn as other spaces.
pub fn unbroken(text: &str) -> String {
    text.replace(' ', "\u{a0}")
}

/// The line in pieces of at most `width` characters, broken at spaces. A word that is longer than a line is broken behind a `/`, and
/// inside a part of a path only if that is longer than a line, too. Further
/// pieces begin with `indent` spaces. Styles stay with their characters.
pub fn wrap(line: &Line, width: usize, indent: usize) -> Vec<Line<'static>> {
    let cells: Vec<(char, Style)> =
        line.spans.iter().flat_map(|span| span.content.chars().map(|c| (c, span.style))).collect();
    let width = width.max(1);
    let indent = if indent + 8 > width { 0 } else { indent };
    let mut pieces = Vec::new();
    let mut rest = &cells[..];
    while !rest.is_empty() || pieces.is_empty() {
        let before = if pieces.is_empty() { 0 } else { indent };
        let room = width - before;
        let taken = match rest.get(room) {
            None => rest.len(),
            Some((' ', _)) => room,
            // The break is after the last space; spaces at the begin of the line are no break.
            Some(_) => {
                let first = rest.iter().position(|(c, _)| *c != ' ').unwrap_or(0);
                let space = rest[..room].iter().rposition(|(c, _)| *c == ' ').filter(|at| *at > first);
                let slash = || rest[..room].iter().rposition(|(c, _)| *c == '/').filter(|at| *at > first);
                space.or_else(|| slash().map(|at| at + 1)).unwrap_or(room)
            }
        };
        let (piece, after) = rest.split_at(taken);
        pieces.push(restyled(piece, before));
        let spaces = after.iter().take_while(|(c, _)| *c == ' ').count();
        rest = &after[spaces.min(after.len())..];
    }
    pieces
}

/// A sentence in lines of at most `width` columns for a terminal that breaks longer ones itself. It is broken at spaces alone, and
/// never in a command between backticks: what is longer than a line stays whole, so that it can be copied.
pub fn wrap_sentence(text: &str, width: usize) -> String {
    let mut wrapped = String::with_capacity(text.len() + 8);
    let (mut column, mut quoted) = (0, false);
    for (index, line) in text.split('\n').enumerate() {
        if index > 0 {
            wrapped.push('\n');
            column = 0;
        }
        let mut words = line.split(' ').peekable();
        while let Some(word) = words.next() {
            let mut whole = word.to_owned();
            quoted ^= word.matches('`').count() % 2 == 1;
            while let Some(next) = words.next_if(|_| quoted) {
                quoted ^= next.matches('`').count() % 2 == 1;
                whole.push(' ');
                whole.push_str(next);
            }
            quoted = false;
            let length = whole.chars().count();
            if column > 0 && column + 1 + length > width {
                wrapped.push('\n');
                column = 0;
            } else if column > 0 {
                wrapped.push(' ');
                column += 1;
            }
            wrapped.push_str(&whole);
            column += length;
        }
    }
    wrapped
}

/// All lines, each wrapped.
pub fn wrap_all(lines: &[Line], width: usize, indent: usize) -> Vec<Line<'static>> {
    lines.iter().flat_map(|line| wrap(line, width, indent)).collect()
}

fn restyled(cells: &[(char, Style)], indent: usize) -> Line<'static> {
    let mut spans = if indent > 0 { vec![Span::raw(" ".repeat(indent))] } else { Vec::new() };
    for run in cells.chunk_by(|a, b| a.1 == b.1) {
        let text = run.iter().map(|(c, _)| if *c == '\u{a0}' { ' ' } else { *c });
        spans.push(Span::styled(text.collect::<String>(), run[0].1));
    }
    Line::from(spans)
}
