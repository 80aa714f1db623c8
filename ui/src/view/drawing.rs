//! A picture of lines, points and characters, with two back ends: the terminal's characters, and pixels.

use nalgebra::Point2;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::dots::DotGrid;
use crate::graphics::raster::{Ink, Raster};
use crate::theme::{Role, Theme};

/// Two drawings resemble each other while no point of one differs by more, in shares of the area: about a centimetre of the
/// robot, twice the steps in which it is drawn.
const RESEMBLANCE: f64 = 0.01;
/// Edges of the circle of the mark `o`.
const CIRCLE_EDGES: usize = 16;

/// A part of a picture; its places are shares of the area, right and down, 0 to 1 inside.
#[derive(Debug, Clone, PartialEq)]
enum Part {
    /// Lines, of whose dots every `step`-th is set where they are characters; a line without length is a dot.
    Lines { role: Role, step: usize, lines: Vec<[Point2<f64>; 2]> },
    /// A character.
    Mark { role: Role, at: Point2<f64>, character: char },
}

impl Part {
    fn points(&self) -> &[Point2<f64>] {
        match self {
            Part::Lines { lines, .. } => lines.as_flattened(),
            Part::Mark { at, .. } => std::slice::from_ref(at),
        }
    }

    /// Whether it is the same part, perhaps at another place.
    fn is_kind_of(&self, other: &Part) -> bool {
        match (self, other) {
            (Part::Lines { role, step, .. }, Part::Lines { role: other_role, step: other_step, .. }) => {
                role == other_role && step == other_step
            }
            (Part::Mark { role, character, .. }, Part::Mark { role: other_role, character: other, .. }) => {
                role == other_role && character == other
            }
            _ => false,
        }
    }
}

/// A picture: its parts, the later ones over the earlier ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Drawing {
    parts: Vec<Part>,
}

impl Drawing {
    /// Adds lines, of whose dots every `step`-th is set.
    pub fn lines(&mut self, role: Role, step: usize, lines: Vec<[Point2<f64>; 2]>) {
        self.parts.push(Part::Lines { role, step, lines });
    }

    /// Adds a character.
    pub fn mark(&mut self, role: Role, at: Point2<f64>, character: char) {
        self.parts.push(Part::Mark { role, at, character });
    }

    /// Whether no point lies more than a hundredth of the area elsewhere in the other drawing.
    pub fn resembles(&self, other: &Drawing) -> bool {
        let alike = |(part, other): (&Part, &Part)| {
            let (points, others) = (part.points(), other.points());
            part.is_kind_of(other)
                && points.len() == others.len()
                && points.iter().zip(others).all(|(point, other)| (point - other).amax() <= RESEMBLANCE)
        };
        self.parts.len() == other.parts.len() && self.parts.iter().zip(&other.parts).all(alike)
    }

    /// Draws characters over what is there.
    pub fn draw_cells(&self, frame: &mut Frame, area: Rect, theme: &Theme) {
        // Over other lines: nothing of their style stays.
        let style = |role| Style::reset().patch(theme.style(role));
        for part in &self.parts {
            match part {
                Part::Lines { role, step, lines } => {
                    let mut dots = DotGrid::new(area, theme.glyphs);
                    let at = |share: &Point2<f64>| (share.x * dots.size.0 as f64, share.y * dots.size.1 as f64);
                    let lines: Vec<_> = lines.iter().map(|[from, to]| (at(from), at(to))).collect();
                    for (from, to) in lines {
                        dots.dotted(from, to, *step);
                    }
                    dots.draw(frame.buffer_mut(), area, style(*role));
                }
                Part::Mark { role, at, character } => {
                    let (x, y) = (at.x * f64::from(area.width), at.y * f64::from(area.height));
                    let inside = x >= 0.0 && y >= 0.0 && x < f64::from(area.width) && y < f64::from(area.height);
                    let cell = (area.x.saturating_add(x as u16), area.y.saturating_add(y as u16));
                    if let Some(cell) = frame.buffer_mut().cell_mut(cell).filter(|_| inside) {
                        cell.set_char(*character).set_style(style(*role));
                    }
                }
            }
        }
    }

    /// Draws pixels in an area of `size` pixels, whose rows of characters are `row` pixels high.
    pub fn draw_pixels(&self, size: (usize, usize), row: f64, theme: &Theme) -> Raster {
        let mut raster = Raster::new(size);
        for part in &self.parts {
            match part {
                Part::Lines { role, step, lines } => {
                    // Half as wide as a dot of braille; the lines of which few dots are set are thin and faint.
                    let width = if *step > 1 { 1.0 } else { (row / 8.0).max(1.5) };
                    let ink = Ink { rgb: theme.rgb(*role), opacity: 1.0 / (*step as f64).sqrt(), width };
                    for [from, to] in lines {
                        raster.line(&ink, scaled(from, size), scaled(to, size));
                    }
                }
                Part::Mark { role, at, character } => {
                    let ink = Ink { rgb: theme.rgb(*role), opacity: 1.0, width: (row / 8.0).max(1.5) };
                    draw_mark(&mut raster, &ink, scaled(at, size), row / 3.0, *character);
                }
            }
        }
        raster
    }
}

fn scaled(share: &Point2<f64>, size: (usize, usize)) -> Point2<f64> {
    Point2::new(share.x * size.0 as f64, share.y * size.1 as f64)
}

/// Draws a circle for `o`, and a cross for every other character.
fn draw_mark(raster: &mut Raster, ink: &Ink, at: Point2<f64>, radius: f64, character: char) {
    let place = |x: f64, y: f64| Point2::new(at.x + radius * x, at.y + radius * y);
    if character == 'o' {
        let corner = |index: usize| {
            let (y, x) = (std::f64::consts::TAU * index as f64 / CIRCLE_EDGES as f64).sin_cos();
            place(x, y)
        };
        (0..CIRCLE_EDGES).for_each(|index| raster.line(ink, corner(index), corner(index + 1)));
    } else {
        raster.line(ink, place(-1.0, -1.0), place(1.0, 1.0));
        raster.line(ink, place(-1.0, 1.0), place(1.0, -1.0));
    }
}
