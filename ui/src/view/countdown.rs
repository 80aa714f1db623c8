//! The seconds left of a countdown, in digits that can be read from beside the robot.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use super::draw::span;
use crate::legal::view_keys_keep_countdown;
use crate::model::Model;
use crate::theme::{Role, Theme};

/// Rows of a digit.
const ROWS: usize = 5;

/// The dots of the digits 0 to 9, three in a row, the left one in the highest of three bits.
const DIGITS: [[u8; ROWS]; 10] = [
    [0b111, 0b101, 0b101, 0b101, 0b111],
    [0b010, 0b110, 0b010, 0b010, 0b111],
    [0b111, 0b001, 0b111, 0b100, 0b111],
    [0b111, 0b001, 0b111, 0b001, 0b111],
    [0b101, 0b101, 0b111, 0b001, 0b001],
    [0b111, 0b100, 0b111, 0b001, 0b111],
    [0b111, 0b100, 0b111, 0b101, 0b111],
    [0b111, 0b001, 0b001, 0b010, 0b010],
    [0b111, 0b101, 0b111, 0b101, 0b111],
    [0b111, 0b101, 0b111, 0b001, 0b111],
];

/// Draws the seconds left in the middle of the area; nothing in a replay and without a countdown.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let Some(seconds) = model.countdown_s.filter(|_| model.replay.is_none()) else { return };
    let theme = &model.theme;
    let mut lines = vec![Line::default()];
    lines.extend((0..ROWS).map(|row| Line::from(span(theme, Role::Warning, digits(theme, seconds, row)))));
    lines.extend([Line::default(), Line::from(Span::raw(format!("Jump in {seconds} s: {}.", cancels(model))))]);
    let width = lines.iter().map(Line::width).max().unwrap_or(0) as u16 + 4;
    let (width, height) = (width.min(area.width), (lines.len() as u16 + 1).min(area.height));
    let at = Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    frame.render_widget(Clear, at);
    frame.render_widget(Paragraph::new(lines).centered(), at);
}

/// The keys that cancel a countdown, in words.
pub fn cancels(model: &Model) -> &'static str {
    match view_keys_keep_countdown(model) {
        true => "any key but those of views cancels it",
        false => "any key cancels it",
    }
}

/// One row of the digits of a number: two columns for each dot, two between digits.
fn digits(theme: &Theme, number: u32, row: usize) -> String {
    let (full, _) = theme.fill();
    let digit = |digit: u32| -> String {
        let dots = DIGITS[digit as usize % 10][row];
        (0..3).rev().map(|bit| if dots >> bit & 1 == 1 { full.repeat(2) } else { "  ".to_owned() }).collect()
    };
    let text = number.to_string();
    text.chars().filter_map(|c| c.to_digit(10)).map(digit).collect::<Vec<_>>().join("  ")
}
