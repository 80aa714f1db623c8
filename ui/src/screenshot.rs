//! Pictures of a screen: the cells of the terminal as SVG.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

use crate::model::Model;
use crate::theme::Background;
use crate::view;

/// Size of the text, width and height of a cell, px.
const TEXT: f64 = 14.0;
const CELL: (f64, f64) = (8.4, 17.0);
/// Height of the baseline over the lower edge of a cell, px.
const BASELINE: f64 = 4.0;
/// Margin on each side, px.
const MARGIN: f64 = 8.0;

/// Draws the screen of a model at its size and returns it as an SVG document.
pub fn svg(model: &Model) -> String {
    let mut film = Film::default();
    film.add(model);
    film.svg(1.0)
}

/// Screens one after the other, of the same size: a moving picture.
#[derive(Debug, Default)]
pub struct Film {
    frames: usize,
    /// Columns and rows of a screen.
    size: (u16, u16),
    background: Background,
    /// For each row of the screen its pictures: the first frame that shows it, and its elements.
    rows: Vec<Vec<(usize, String)>>,
}

impl Film {
    /// Adds the screen of a model. Rows that stay as they are take no room.
    pub fn add(&mut self, model: &Model) {
        (self.size, self.background) = (model.size, model.theme.background);
        let (columns, rows) = model.size;
        let mut terminal = Terminal::new(TestBackend::new(columns, rows)).unwrap_or_else(|never| match never {});
        terminal.draw(|frame| view::render(frame, model)).unwrap_or_else(|never| match never {});
        self.rows.resize_with(usize::from(rows), Vec::new);
        for (pictures, row) in self.rows.iter_mut().zip(0..) {
            let picture = row_picture(terminal.backend().buffer(), row, terminal_colours(self.background));
            if pictures.last().is_none_or(|(_, last)| *last != picture) {
                pictures.push((self.frames, picture));
            }
        }
        self.frames += 1;
    }

    /// Returns an SVG document that shows so many frames in a second, again and again; a single frame stands still.
    pub fn svg(&self, frames_per_s: f64) -> String {
        let [foreground, behind] = terminal_colours(self.background);
        let (width, height) = (CELL.0 * f64::from(self.size.0), CELL.1 * f64::from(self.size.1));
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w:.1} {h:.1}\" width=\"{w:.0}\" height=\"{h:.0}\" \
             font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"{TEXT}\" fill=\"{foreground}\">\n",
            w = width + 2.0 * MARGIN,
            h = height + 2.0 * MARGIN,
        );
        let mut spans = BTreeSet::new();
        let mut pictures = String::new();
        for row in &self.rows {
            for (index, (first, picture)) in row.iter().enumerate() {
                let end = row.get(index + 1).map_or(self.frames, |(next, _)| *next);
                if (*first, end) == (0, self.frames) {
                    pictures.push_str(picture);
                } else {
                    spans.insert((*first, end));
                    let _ = writeln!(pictures, "<g class=\"f{first}-{end}\">\n{picture}</g>");
                }
            }
        }
        if !spans.is_empty() {
            svg.push_str("<style>\n");
            let duration_s = self.frames as f64 / frames_per_s;
            let percent = |frame: usize| 100.0 * frame as f64 / self.frames as f64;
            for (first, end) in spans {
                let before = if first > 0 { "0% {visibility: hidden} " } else { "" };
                let after = if end < self.frames {
                    format!("{:.3}% {{visibility: hidden}}", percent(end))
                } else {
                    String::new()
                };
                let _ = writeln!(
                    svg,
                    ".f{first}-{end} {{animation: f{first}-{end} {duration_s:.3}s step-end infinite}} \
                     @keyframes f{first}-{end} {{{before}{:.3}% {{visibility: visible}} {after}}}",
                    percent(first)
                );
            }
            svg.push_str("</style>\n");
        }
        let _ = writeln!(svg, "<rect width=\"100%\" height=\"100%\" fill=\"{behind}\"/>");
        svg + &pictures + "</svg>\n"
    }
}

/// Foreground and background of a terminal, as web colours.
fn terminal_colours(background: Background) -> [&'static str; 2] {
    match background {
        Background::Dark => ["#e0e0e0", "#101010"],
        Background::Light => ["#202020", "#ffffff"],
    }
}

/// Returns the elements of a row of the screen.
fn row_picture(buffer: &Buffer, row: u16, colours: [&str; 2]) -> String {
    let cells: Vec<&Cell> = (0..buffer.area.width).filter_map(|column| buffer.cell((column, row))).collect();
    let top = MARGIN + CELL.1 * f64::from(row);
    let mut picture = String::new();
    let mut column = 0;
    for run in cells.chunk_by(|one, next| one.style() == next.style()) {
        let left = MARGIN + CELL.0 * column as f64;
        column += run.len();
        put_run(&mut picture, run, left, top, colours);
    }
    picture
}

/// Appends cells of one style: their background, then their text. Each run has its width, whatever font is there.
fn put_run(svg: &mut String, run: &[&Cell], left: f64, top: f64, [foreground, behind]: [&str; 2]) {
    let cell = run[0];
    let mut colours = [web_colour(cell.fg), web_colour(cell.bg)];
    if cell.modifier.contains(Modifier::REVERSED) {
        let [text, ground] = colours;
        colours = [ground.or(Some(behind.to_owned())), text.or(Some(foreground.to_owned()))];
    }
    let [text_colour, ground] = colours;
    let width = CELL.0 * run.len() as f64;
    // Writing to a string does not fail.
    if let Some(ground) = ground {
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{}\" fill=\"{ground}\"/>",
            CELL.1
        );
    }
    // Blanks at the ends are left out, the others do not break: renderers would drop them.
    let blank = |cell: &&&Cell| cell.symbol() == " ";
    let before = run.iter().take_while(blank).count();
    let after = run[before..].iter().rev().take_while(blank).count();
    let run = &run[before..run.len() - after];
    if run.is_empty() {
        return;
    }
    let text: String = run.iter().map(|cell| if cell.symbol() == " " { "\u{a0}" } else { cell.symbol() }).collect();
    let (left, width) = (left + CELL.0 * before as f64, CELL.0 * run.len() as f64);
    let baseline = top + CELL.1 - BASELINE;
    let _ = write!(svg, "<text x=\"{left:.1}\" y=\"{baseline:.1}\" textLength=\"{width:.1}\"");
    let styles = [
        (Modifier::BOLD, " font-weight=\"bold\""),
        (Modifier::DIM, " opacity=\"0.6\""),
        (Modifier::UNDERLINED, " text-decoration=\"underline\""),
    ];
    for (_, style) in styles.iter().filter(|(modifier, _)| cell.modifier.contains(*modifier)) {
        svg.push_str(style);
    }
    if let Some(colour) = text_colour {
        let _ = write!(svg, " fill=\"{colour}\"");
    }
    let _ = writeln!(svg, ">{}</text>", text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;"));
}

/// Returns a colour of 24 bits; none for the terminal's own.
fn web_colour(colour: Color) -> Option<String> {
    match colour {
        Color::Rgb(red, green, blue) => Some(format!("#{red:02x}{green:02x}{blue:02x}")),
        _ => None,
    }
}
