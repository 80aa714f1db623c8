//! Sixel: bands of six rows, each colour of a band as characters with run lengths.

use std::fmt::Write as _;

use super::raster::Raster;
use crate::theme::Background;

/// Rows of a band.
const BAND: usize = 6;
/// Shortest run that its length shortens: `!4x` has three characters.
const SHORTEST_RUN: usize = 4;

/// Writes the picture at the cursor, without the rows below the last whole band; transparent pixels leave what is there.
pub fn write(to: &mut String, raster: &Raster, background: Background) {
    let width = raster.size.0;
    let height = raster.size.1 / BAND * BAND;
    // Square pixels; 1: pixels without a colour stay.
    let _ = write!(to, "\x1bP0;1;0q\"1;1;{width};{height}");
    let palette = raster.palette();
    for (index, (rgb, opacity)) in palette.iter().enumerate().skip(1) {
        if raster.pixels.contains(&(index as u8)) {
            let [red, green, blue] = percent(*rgb, *opacity, background);
            let _ = write!(to, "#{index};2;{red};{green};{blue}");
        }
    }
    let mut bands = raster.pixels.chunks_exact(BAND * width.max(1)).peekable();
    while let Some(band) = bands.next() {
        let mut first = true;
        for colour in 1..palette.len() as u8 {
            if band.contains(&colour) {
                // Back to the begin of the band.
                to.push_str(if first { "" } else { "$" });
                let _ = write!(to, "#{colour}");
                write_runs(to, band, width, colour);
                first = false;
            }
        }
        if bands.peek().is_some() {
            to.push('-');
        }
    }
    to.push_str("\x1b\\");
}

/// Writes the pixels of one colour in a band, without the empty ones at its end.
fn write_runs(to: &mut String, band: &[u8], width: usize, colour: u8) {
    let bits = |x: usize| {
        let rows = band.iter().skip(x).step_by(width).enumerate();
        rows.fold(0_u8, |bits, (row, pixel)| bits | u8::from(*pixel == colour) << row)
    };
    let columns: Vec<u8> = (0..width).map(bits).collect();
    let used = columns.iter().rposition(|bits| *bits != 0).map_or(0, |last| last + 1);
    for run in columns[..used].chunk_by(|bits, next| bits == next) {
        let character = char::from(b'?' + run[0]);
        if run.len() < SHORTEST_RUN {
            run.iter().for_each(|_| to.push(character));
        } else {
            let _ = write!(to, "!{}{character}", run.len());
        }
    }
}

/// Red, green and blue in percent of a colour over black or white.
fn percent((red, green, blue): (u8, u8, u8), opacity: f64, background: Background) -> [u8; 3] {
    let below = if background == Background::Dark { 0.0 } else { 100.0 };
    [red, green, blue].map(|part| (below + opacity * (f64::from(part) / 2.55 - below)).round() as u8)
}
