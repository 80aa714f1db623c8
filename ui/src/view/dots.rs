//! A grid of dots within characters: braille, or one dot in a character.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use crate::theme::Glyphs;

/// Dots in a character: across and down.
fn resolution(glyphs: Glyphs) -> (usize, usize) {
    match glyphs {
        Glyphs::Braille => (2, 4),
        Glyphs::Dots | Glyphs::Ascii => (1, 3),
    }
}

/// The columns of dots in a width.
pub fn dots_across(width: u16, glyphs: Glyphs) -> usize {
    usize::from(width) * resolution(glyphs).0
}

/// The bit of each dot of a character, by column and row (Unicode 16, Braille Patterns).
const BITS: [[u8; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];

/// The character with these dots set, the bits of [`BITS`].
fn character(glyphs: Glyphs, dots: u8) -> char {
    if glyphs == Glyphs::Braille {
        return char::from_u32(0x2800 + u32::from(dots)).unwrap_or(' ');
    }
    let (middle, several) = if glyphs == Glyphs::Dots { ('·', ':') } else { ('-', '|') };
    match dots {
        0x01 => '\'',
        0x02 => middle,
        0x04 => '.',
        _ => several,
    }
}

pub struct DotGrid {
    glyphs: Glyphs,
    /// Dots across and down.
    pub size: (usize, usize),
    /// The dots of each character, row by row.
    set: Vec<u8>,
    /// Characters across.
    width: usize,
}

impl DotGrid {
    pub fn new(area: Rect, glyphs: Glyphs) -> DotGrid {
        let size = (dots_across(area.width, glyphs), usize::from(area.height) * resolution(glyphs).1);
        let width = usize::from(area.width);
        DotGrid { glyphs, size, set: vec![0; width * usize::from(area.height)], width }
    }

    /// Sets a dot; outside of the grid nothing happens.
    pub fn set(&mut self, x: i64, y: i64) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x < self.size.0 && y < self.size.1 {
            // With constants: a division by a variable takes longer than all else here.
            let (column, row, bit) = match self.glyphs {
                Glyphs::Braille => (x / 2, y / 4, BITS[x % 2][y % 4]),
                Glyphs::Dots | Glyphs::Ascii => (x, y / 3, BITS[0][y % 3]),
            };
            self.set[row * self.width + column] |= bit;
        }
    }

    /// A straight line of dots (in steps along the longer side).
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64)) {
        self.dotted(from, to, 1);
    }

    /// A straight line of which every `step`-th dot is set.
    pub fn dotted(&mut self, (x0, y0): (f64, f64), (x1, y1): (f64, f64), step: usize) {
        let steps = (x1 - x0).abs().max((y1 - y0).abs()).ceil().clamp(1.0, 4096.0) as usize;
        for i in (0..=steps).step_by(step.max(1)) {
            let s = i as f64 / steps as f64;
            self.set((x0 + s * (x1 - x0)).round() as i64, (y0 + s * (y1 - y0)).round() as i64);
        }
    }

    /// Draws the characters that have dots; the others keep what lies below.
    pub fn draw(&self, buffer: &mut Buffer, area: Rect, style: Style) {
        for (row, dots) in self.set.chunks(self.width.max(1)).enumerate() {
            for (column, dots) in dots.iter().enumerate().filter(|(_, dots)| **dots != 0) {
                if let Some(cell) = buffer.cell_mut((area.x + column as u16, area.y + row as u16)) {
                    cell.set_char(character(self.glyphs, *dots)).set_style(style);
                }
            }
        }
    }
}
