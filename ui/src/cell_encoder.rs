//! Changed cells of the screen as bytes for the terminal, as few as possible: a chart changes scattered cells, of which the moves
//! of the cursor and the colours cost more than the characters.

use std::io::Write;

use ratatui::buffer::Cell;
use ratatui::style::{Color, Modifier};

/// A cell and its place: column, row.
pub type PlacedCell<'a> = (u16, u16, &'a Cell);

/// Modifiers and their parameters of SGR (ECMA-48, 8.3.117).
const MODIFIERS: [(Modifier, u8); 9] = [
    (Modifier::BOLD, 1),
    (Modifier::DIM, 2),
    (Modifier::ITALIC, 3),
    (Modifier::UNDERLINED, 4),
    (Modifier::SLOW_BLINK, 5),
    (Modifier::RAPID_BLINK, 6),
    (Modifier::REVERSED, 7),
    (Modifier::HIDDEN, 8),
    (Modifier::CROSSED_OUT, 9),
];

/// Returns the bytes that draw the cells, which are in the order of rows, and leave the terminal's default style: row by row, or
/// style by style, whichever is shorter.
pub fn encode(cells: &[PlacedCell]) -> Vec<u8> {
    let by_row = encode_in_order(cells);
    let mut sorted = cells.to_vec();
    let mut styles = Vec::new();
    sorted.sort_by_cached_key(|(_, _, cell)| {
        let style = style_of(cell);
        styles.iter().position(|known| *known == style).unwrap_or_else(|| {
            styles.push(style);
            styles.len() - 1
        })
    });
    let by_style = encode_in_order(&sorted);
    if by_style.len() < by_row.len() { by_style } else { by_row }
}

type CellStyle = (Color, Color, Modifier);

const PLAIN: CellStyle = (Color::Reset, Color::Reset, Modifier::empty());

fn style_of(cell: &Cell) -> CellStyle {
    (cell.fg, cell.bg, cell.modifier)
}

fn encode_in_order(cells: &[PlacedCell]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(8 * cells.len());
    let mut style = PLAIN;
    // The place of the cursor; none where the terminal may count the columns of a character in another way.
    let mut cursor = None;
    for (x, y, cell) in cells {
        move_cursor(&mut bytes, cursor, (*x, *y));
        change_style(&mut bytes, style, style_of(cell));
        style = style_of(cell);
        bytes.extend_from_slice(cell.symbol().as_bytes());
        cursor = takes_one_column(cell.symbol()).then_some((*x + 1, *y));
    }
    if style != PLAIN {
        bytes.extend_from_slice(b"\x1b[m");
    }
    bytes
}

/// Whether every terminal draws the character in one column: ASCII, and box drawing to braille (U+2500 to U+28FF), of which the
/// screen is made. After the last column the cursor is moved in any case: there it may stay or wrap.
fn takes_one_column(symbol: &str) -> bool {
    let mut characters = symbol.chars();
    let one = characters.next().is_some_and(|c| matches!(c, ' '..='~' | '\u{2500}'..='\u{28ff}'));
    one && characters.next().is_none()
}

fn move_cursor(bytes: &mut Vec<u8>, from: Option<(u16, u16)>, (x, y): (u16, u16)) {
    let written = match from {
        Some((column, row)) if row == y && column == x => Ok(()),
        Some((column, row)) if row == y && column < x => match x - column {
            1 => write!(bytes, "\x1b[C"),
            columns => write!(bytes, "\x1b[{columns}C"),
        },
        Some((_, row)) if row == y => write!(bytes, "\x1b[{}G", x + 1),
        _ if x == 0 => write!(bytes, "\x1b[{}H", y + 1),
        _ => write!(bytes, "\x1b[{};{}H", y + 1, x + 1),
    };
    written.expect("a vector takes every byte");
}

/// Changes what differs. A modifier ends with all of them: terminals disagree about the ends of single ones.
fn change_style(bytes: &mut Vec<u8>, before: CellStyle, after: CellStyle) {
    if before == after {
        return;
    }
    let (fg, bg, modifier) = after;
    let ends = !(before.2 - modifier).is_empty();
    let before = if ends { PLAIN } else { before };
    let mut parameters = if ends { vec!["0".to_owned()] } else { Vec::new() };
    for (one, number) in MODIFIERS {
        if (modifier - before.2).contains(one) {
            parameters.push(number.to_string());
        }
    }
    if fg != before.0 {
        parameters.push(colour(fg, 30));
    }
    if bg != before.1 {
        parameters.push(colour(bg, 40));
    }
    write!(bytes, "\x1b[{}m", parameters.join(";")).expect("a vector takes every byte");
}

/// The parameter of a colour: `first` is 30 for the foreground, 40 for the background.
fn colour(colour: Color, first: u8) -> String {
    let dark = |number: u8| (first + number).to_string();
    let bright = |number: u8| (first + 60 + number).to_string();
    match colour {
        Color::Reset => dark(9),
        Color::Black => dark(0),
        Color::Red => dark(1),
        Color::Green => dark(2),
        Color::Yellow => dark(3),
        Color::Blue => dark(4),
        Color::Magenta => dark(5),
        Color::Cyan => dark(6),
        Color::Gray => dark(7),
        Color::DarkGray => bright(0),
        Color::LightRed => bright(1),
        Color::LightGreen => bright(2),
        Color::LightYellow => bright(3),
        Color::LightBlue => bright(4),
        Color::LightMagenta => bright(5),
        Color::LightCyan => bright(6),
        Color::White => bright(7),
        Color::Rgb(r, g, b) => format!("{};2;{r};{g};{b}", first + 8),
        Color::Indexed(index) => format!("{};5;{index}", first + 8),
    }
}
