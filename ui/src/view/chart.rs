//! A chart of one signal over time, in sweep or scroll mode, of braille dots or what the terminal has instead.
//!
//! ```text
//! roll +0.021 rad             ±0.50
//! ⠀⠀⠀⠀⠀⠀⢀⠔⠑⠤⡀⠀⠀⠀⠀⠀⠀⠀⠀⠀⠀⠀⠀⠀
//! ⣀⣀⣀⠤⠔⠊⠁⠀⠀⠀⠈⠒⠤⢄⣀⣀⣀⣀│⠀⠀⠤⠤⠔⠒
//! ```

use quadfrog::telemetry::Phase;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::cut;
use crate::comparison::time_after;
use crate::history::{History, Sample, at_trial_time};
use crate::series::Signal;
use crate::settings::ChartMode;
use crate::theme::{Glyphs, Role, Theme};

/// How time is laid out, the same for all charts of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeAxis {
    /// Sweep or scroll.
    pub mode: ChartMode,
    /// Time shown, ns.
    pub window_ns: u64,
    /// Time of the newest sample, ns.
    pub newest_ns: u64,
}

/// Share of the window that stays empty before the sweep's cursor, so that new and old do not touch.
const GAP: f64 = 0.06;

impl TimeAxis {
    /// Where a time is drawn, 0 at the left to 1 at the right; none outside of the window.
    pub fn position(&self, time_ns: u64) -> Option<f64> {
        let age = self.newest_ns.checked_sub(time_ns)? as f64 / self.window_ns as f64;
        match self.mode {
            ChartMode::Sweep if age < 1.0 - GAP => Some((time_ns % self.window_ns) as f64 / self.window_ns as f64),
            ChartMode::Scroll if age < 1.0 => Some(1.0 - age),
            _ => None,
        }
    }

    /// The column of a time in an area of `width` columns.
    pub fn column(&self, time_ns: u64, width: usize) -> Option<usize> {
        Some(((self.position(time_ns)? * width as f64) as usize).min(width.checked_sub(1)?))
    }
}

/// Dots in a character: across and down.
fn resolution(glyphs: Glyphs) -> (usize, usize) {
    match glyphs {
        Glyphs::Braille => (2, 4),
        Glyphs::Dots | Glyphs::Ascii => (1, 3),
    }
}

/// The character with these dots set (`dots[x][y]`, from the top).
fn character(glyphs: Glyphs, dots: &[[bool; 4]; 2]) -> char {
    // Unicode 16, Braille Patterns: bits of the dots 1-8, by column and row.
    const BRAILLE: [[u32; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];
    if glyphs == Glyphs::Braille {
        let mut bits = 0;
        for x in 0..2 {
            for y in 0..4 {
                bits |= if dots[x][y] { BRAILLE[x][y] } else { 0 };
            }
        }
        return char::from_u32(0x2800 + bits).unwrap_or(' ');
    }
    let (middle, several) = if glyphs == Glyphs::Dots { ('·', ':') } else { ('-', '|') };
    match dots[0] {
        [true, false, false, _] => '\'',
        [false, true, false, _] => middle,
        [false, false, true, _] => '.',
        _ => several,
    }
}

/// A grid of dots over an area.
pub struct Dots {
    glyphs: Glyphs,
    /// Dots across and down.
    pub size: (usize, usize),
    set: Vec<bool>,
}

impl Dots {
    /// An empty grid.
    pub fn new(area: Rect, glyphs: Glyphs) -> Dots {
        let (across, down) = resolution(glyphs);
        let size = (usize::from(area.width) * across, usize::from(area.height) * down);
        Dots { glyphs, size, set: vec![false; size.0 * size.1] }
    }

    /// Sets a dot; outside of the grid nothing happens.
    pub fn set(&mut self, x: i64, y: i64) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x < self.size.0 && y < self.size.1 {
            self.set[y * self.size.0 + x] = true;
        }
    }

    /// A straight line of dots (in steps along the longer side).
    pub fn line(&mut self, (x0, y0): (f64, f64), (x1, y1): (f64, f64)) {
        let steps = (x1 - x0).abs().max((y1 - y0).abs()).ceil().clamp(1.0, 4096.0) as usize;
        for i in 0..=steps {
            let s = i as f64 / steps as f64;
            self.set((x0 + s * (x1 - x0)).round() as i64, (y0 + s * (y1 - y0)).round() as i64);
        }
    }

    /// Draws the characters that have dots; the others keep what lies below.
    pub fn draw(&self, buffer: &mut Buffer, area: Rect, style: Style) {
        let (across, down) = resolution(self.glyphs);
        for row in 0..usize::from(area.height) {
            for column in 0..usize::from(area.width) {
                let mut dots = [[false; 4]; 2];
                let mut any = false;
                for (x, dots) in dots.iter_mut().enumerate().take(across) {
                    for (y, dot) in dots.iter_mut().enumerate().take(down) {
                        *dot = self.set[(row * down + y) * self.size.0 + column * across + x];
                        any |= *dot;
                    }
                }
                if any && let Some(cell) = buffer.cell_mut((area.x + column as u16, area.y + row as u16)) {
                    cell.set_char(character(self.glyphs, &dots)).set_style(style);
                }
            }
        }
    }
}

/// A trial laid under the charts.
#[derive(Clone, Copy)]
pub struct Ghost<'a> {
    /// Its samples.
    pub trace: &'a [Sample],
    /// Where its impulse begins on the charts' axis, ns.
    pub start_ns: u64,
    /// How its line is drawn.
    pub role: Role,
    /// Whether its value stands beside the other in the heading.
    pub named: bool,
}

/// A chart with its heading line; below two rows nothing is drawn.
pub struct Chart<'a> {
    /// What it shows.
    pub signal: Signal,
    /// How time is laid out.
    pub axis: TimeAxis,
    /// Where the samples come from.
    pub history: &'a History,
    /// The phase of each column, as [`phases`] finds them.
    pub phases: &'a [Option<Phase>],
    /// A trial to lay under the samples.
    pub ghost: Option<Ghost<'a>>,
    /// The time that the heading's value is read at; the newest without it.
    pub cursor_ns: Option<u64>,
    /// Whether the sweep's cursor is drawn as a line.
    pub cursor_line: bool,
    /// Colours and characters.
    pub theme: Theme,
}

impl Chart<'_> {
    /// Draws it.
    pub fn draw(&self, buffer: &mut Buffer, area: Rect) {
        if area.height < 2 || area.width < 8 {
            return;
        }
        let plot = Rect { y: area.y + 1, height: area.height - 1, ..area };
        let (low, high) = self.range();
        self.draw_heading(buffer, Rect { height: 1, ..area }, (low, high));
        self.draw_zero(buffer, plot, (low, high));
        if let Some(ghost) = self.ghost {
            self.draw_ghost(buffer, plot, ghost, (low, high));
        }
        let mut dots = Dots::new(plot, self.theme.glyphs);
        let samples =
            self.history.window(self.axis.window_ns).map(|sample| (sample.time_ns, (self.signal.value)(sample)));
        self.trace(&mut dots, samples, (low, high));
        dots.draw(buffer, plot, self.theme.style(self.signal.role));
        self.shade(buffer, plot);
        self.draw_cursor(buffer, plot);
    }

    /// The first of the signal's ranges that holds what is drawn.
    fn range(&self) -> (f32, f32) {
        let ghost = self.ghost.iter().flat_map(|ghost| ghost.trace);
        let values = self.history.window(self.axis.window_ns).chain(ghost).map(|sample| (self.signal.value)(sample));
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let ranges = self.signal.ranges;
        let widest = ranges.last().copied().unwrap_or((-1.0, 1.0));
        ranges.iter().find(|range| low >= range.0 && high <= range.1).copied().unwrap_or(widest)
    }

    /// A dotted line at zero where zero is the middle; it stays below the curve.
    fn draw_zero(&self, buffer: &mut Buffer, plot: Rect, (low, high): (f32, f32)) {
        if low != -high || self.theme.glyphs == Glyphs::Ascii {
            return;
        }
        for x in (plot.x..plot.right()).step_by(4) {
            buffer.set_string(x, plot.y + plot.height / 2, "·", self.theme.style(Role::Quiet));
        }
    }

    /// Name, contact lamp, value and, where there is room, the range.
    fn draw_heading(&self, buffer: &mut Buffer, area: Rect, (low, high): (f32, f32)) {
        let theme = &self.theme;
        let sample = match self.cursor_ns {
            Some(time_ns) => self.history.at(time_ns),
            None => self.history.samples().next_back(),
        };
        let lamp = match (self.signal.foot, sample) {
            (Some(leg), Some(sample)) => theme.lamp(sample.contact[leg as usize]),
            (Some(_), None) => " ",
            (None, _) => "",
        };
        let value = sample.map_or("-".to_owned(), |sample| self.number(sample));
        let ghost = self.ghost.filter(|ghost| ghost.named).zip(self.cursor_ns).map(|(ghost, time_ns)| {
            let time_s = (time_ns as f64 - ghost.start_ns as f64) / 1e9;
            let sample = at_trial_time(ghost.trace, time_s as f32);
            (sample.map_or("-".to_owned(), |sample| self.number(sample)), ghost.role)
        });
        let unit = self.signal.unit;
        let mut pieces = vec![(format!("{}{lamp} ", self.signal.name), self.signal.role)];
        match ghost {
            Some((other, role)) => {
                pieces.push((format!("A {value} "), Role::Text));
                pieces.push((format!("B {other} {unit}"), role));
            }
            None => pieces.push((format!("{value} {unit}"), Role::Text)),
        }
        let width = usize::from(area.width);
        let mut used = 0;
        for (text, role) in pieces {
            let text = cut(&text, width - used);
            buffer.set_string(area.x + used as u16, area.y, &text, theme.style(role));
            used += text.chars().count();
        }
        let range = if low == -high { format!("{}{high}", theme.plus_minus()) } else { format!("{low} to {high}") };
        let range_width = range.chars().count();
        if used + range_width + 2 <= width {
            buffer.set_string(area.right() - range_width as u16, area.y, range, theme.style(Role::Quiet));
        }
    }

    /// The signal's value with as many digits as are worth reading.
    fn number(&self, sample: &Sample) -> String {
        let value = (self.signal.value)(sample);
        // -0.000 would flicker with +0.000.
        let value = if value.abs() < 0.0005 { 0.0 } else { value };
        if value.abs() >= 100.0 { format!("{value:+.0}") } else { format!("{value:+.3}") }
    }

    /// Sets the dots of a line through the points, as far as the axis shows them.
    fn trace(&self, dots: &mut Dots, points: impl Iterator<Item = (u64, f32)>, (low, high): (f32, f32)) {
        let (across, down) = dots.size;
        if across == 0 || down == 0 {
            return;
        }
        let mut before: Option<(usize, i64)> = None;
        for (time_ns, value) in points {
            let at = self.axis.column(time_ns, across).filter(|_| value.is_finite());
            before = at.map(|x| {
                let y = ((high - value) / (high - low) * down as f32) as i64;
                let y = y.clamp(0, down as i64 - 1);
                // Joined to the sample before, unless that one is at the other end of the chart.
                let from = before.filter(|(x0, _)| x.wrapping_sub(*x0) <= 1).map_or(y, |(_, y0)| y0);
                for y in from.min(y)..=from.max(y) {
                    dots.set(x as i64, y);
                }
                (x, y)
            });
        }
    }

    /// The ghost's samples at the time that they would have if its impulse had begun where the axis says.
    fn draw_ghost(&self, buffer: &mut Buffer, plot: Rect, ghost: Ghost, range: (f32, f32)) {
        let mut dots = Dots::new(plot, self.theme.glyphs);
        let points = ghost
            .trace
            .iter()
            .map(|sample| (time_after(ghost.start_ns, sample.trial_time_s), (self.signal.value)(sample)));
        self.trace(&mut dots, points, range);
        dots.draw(buffer, plot, self.theme.style(ghost.role));
    }

    /// Colours the columns of a jump's phases; [`draw_phases`] says the same in letters.
    fn shade(&self, buffer: &mut Buffer, plot: Rect) {
        for (column, phase) in self.phases.iter().enumerate().take(usize::from(plot.width)) {
            let role = match phase {
                Some(Phase::Impulse) => Role::ShadeImpulse,
                Some(Phase::Flight) => Role::ShadeFlight,
                Some(Phase::Landing) => Role::ShadeLanding,
                Some(Phase::Stance) | None => continue,
            };
            buffer.set_style(Rect { x: plot.x + column as u16, width: 1, ..plot }, self.theme.style(role));
        }
    }

    fn draw_cursor(&self, buffer: &mut Buffer, plot: Rect) {
        let width = usize::from(plot.width);
        let (column, role) = match self.cursor_ns {
            Some(time_ns) => (self.axis.column(time_ns, width), Role::Key),
            None if self.axis.mode == ChartMode::Sweep && self.cursor_line => {
                (self.axis.column(self.axis.newest_ns, width).map(|column| (column + 1) % width), Role::Quiet)
            }
            None => return,
        };
        let Some(column) = column else { return };
        for y in plot.y..plot.bottom() {
            buffer.set_string(plot.x + column as u16, y, self.theme.bar(), self.theme.style(role));
        }
    }
}

/// The phase that is drawn in each column; the one of a jump wins over stance.
pub fn phases(axis: &TimeAxis, history: &History, width: u16) -> Vec<Option<Phase>> {
    let mut phases = vec![None; usize::from(width)];
    for sample in history.window(axis.window_ns) {
        if let Some(column) = axis.column(sample.time_ns, usize::from(width)) {
            let phase = if sample.trial.is_some() { sample.phase } else { Phase::Stance };
            if phase != Phase::Stance || phases[column].is_none() {
                phases[column] = Some(phase);
            }
        }
    }
    phases
}

/// A line of letters under charts: `i` impulse, `f` flight, `l` landing.
pub fn draw_phases(buffer: &mut Buffer, area: Rect, phases: &[Option<Phase>], theme: &Theme) {
    for (column, phase) in phases.iter().enumerate().take(usize::from(area.width)) {
        let letter = match phase {
            Some(Phase::Impulse) => "i",
            Some(Phase::Flight) => "f",
            Some(Phase::Landing) => "l",
            Some(Phase::Stance) | None => continue,
        };
        buffer.set_string(area.x + column as u16, area.y, letter, theme.style(Role::Quiet));
    }
}
