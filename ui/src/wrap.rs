//! Lines that continue at a word, so that no sentence is cut.

use ratatui::style::Style;
use ratatui::text::{Line, Span, StyledGrapheme};

/// The text with spaces at which [`wrap`] does not break it; they are drawn as other spaces.
pub fn unbroken(text: &str) -> String {
    text.replace(' ', "\u{a0}")
}

/// The columns that a text takes on the screen: two for each wide character, as of Chinese.
pub fn columns(text: &str) -> usize {
    Span::raw(text).width()
}

/// The line in pieces of at most `width` columns, broken at spaces. A word that is longer than a line is broken behind a `/`, and
/// inside a part of a path only if that is longer than a line, too. Further
/// pieces begin with `indent` spaces. Styles stay with their characters.
pub fn wrap(line: &Line, width: usize, indent: usize) -> Vec<Line<'static>> {
    let cells: Vec<StyledGrapheme> = line.spans.iter().flat_map(|span| span.styled_graphemes(Style::new())).collect();
    let width = width.max(1);
    let indent = if indent + 8 > width { 0 } else { indent };
    let mut pieces = Vec::new();
    let mut rest = &cells[..];
    while !rest.is_empty() || pieces.is_empty() {
        let before = if pieces.is_empty() { 0 } else { indent };
        let room = width - before;
        // The cells that have room; at least one, so that a wide one in a single column ends the line.
        let fit = within(rest, room).max(1);
        let taken = match rest.get(fit) {
            None => rest.len(),
            Some(cell) if cell.symbol == " " => fit,
            // The break is after the last space; spaces at the begin of the line are no break.
            Some(_) => {
                let first = rest.iter().position(|cell| cell.symbol != " ").unwrap_or(0);
                let last = |text| rest[..fit].iter().rposition(|cell| cell.symbol == text).filter(|at| *at > first);
                last(" ").or_else(|| last("/").map(|at| at + 1)).unwrap_or(fit)
            }
        };
        let (piece, after) = rest.split_at(taken);
        pieces.push(restyled(piece, before));
        let spaces = after.iter().take_while(|cell| cell.symbol == " ").count();
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

/// The number of the first cells that `room` columns have room for.
fn within(cells: &[StyledGrapheme], room: usize) -> usize {
    let ends = cells.iter().scan(0, |end, cell| {
        *end += columns(cell.symbol);
        Some(*end)
    });
    ends.take_while(|end| *end <= room).count()
}

fn restyled(cells: &[StyledGrapheme], indent: usize) -> Line<'static> {
    let mut spans = if indent > 0 { vec![Span::raw(" ".repeat(indent))] } else { Vec::new() };
    for run in cells.chunk_by(|a, b| a.style == b.style) {
        let text = run.iter().map(|cell| if cell.symbol == "\u{a0}" { " " } else { cell.symbol });
        spans.push(Span::styled(text.collect::<String>(), run[0].style));
    }
    Line::from(spans)
}
