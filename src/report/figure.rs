//! Figures as data: panels with axes, series and limit lines. `src/report/svg.rs` draws them.
//!
//! ```text
//! Figure { name, caption, columns, panels }
//!   Panel { title, x: Axis, y: Axis, series, limits, equal }
//!     Axis { label, unit, range, names }
//!     Series { label, style, shape: Line | Step | Points | Arrows | Marks | Band }
//!     Limit { label, value }
//! ```
//!
//! A style is a number: [`Style::of`] gives its colour, dashes and marker, which differ from each other also without
//! colour. Series of one label share one entry of the legend and should share the style. The legend stands above the
//! panels, outside of every plot.
//!
//! ```
//! use quadfrog::report::figure::{Axis, Figure, Panel, Series};
//! let mut panel = Panel::new("", Axis::new("Trial", ""), Axis::new("Best so far", "m"));
//! panel.series.push(Series::step("TPE", 0, [[0.0, 0.31], [1.0, 0.52]]));
//! let figure = Figure::new("best", "Best so far.", 1, [panel]);
//! assert!(quadfrog::report::svg::draw(&figure).contains("Best so far (m)"));
//! ```

use serde::Serialize;

/// Short names, for modules that draw.
pub use self::{FigurePanel as Panel, FigureSeries as Series};

/// A figure: panels in a grid with one legend and one caption.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Name of its file without extension: lower-case letters, digits and hyphens.
    pub name: String,
    /// Caption: a sentence that says what is drawn.
    pub caption: String,
    /// Panels side by side.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// A figure of `panels` in `columns` columns.
    pub fn new(
        name: impl Into<String>,
        caption: impl Into<String>,
        columns: usize,
        panels: impl IntoIterator<Item = Panel>,
    ) -> Figure {
        let panels = panels.into_iter().collect();
        Figure { name: name.into(), caption: caption.into(), columns: columns.max(1), panels }
    }
}

/// One plot of a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FigurePanel {
    /// Title above the plot; empty for none.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Series, drawn in this order.
    pub series: Vec<Series>,
    /// Horizontal limit lines.
    pub limits: Vec<Limit>,
    /// Whether a unit of x is as long as a unit of y, as on a map.
    pub equal: bool,
    /// Height of the plot with its axis, in pixels of a figure 720 wide; none for the usual height.
    pub height: Option<u32>,
}

impl FigurePanel {
    /// A panel without series.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Panel {
        Panel { title: title.into(), x, y, series: Vec::new(), limits: Vec::new(), equal: false, height: None }
    }

    /// Adds a horizontal limit line.
    pub fn limit(&mut self, label: impl Into<String>, value: f64) {
        self.limits.push(Limit { label: label.into(), value });
    }
}

/// An axis.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Axis {
    /// Quantity.
    pub label: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// Least and greatest value; none for the range of the data and limits.
    pub range: Option<[f64; 2]>,
    /// Names in place of numbers, each at its value; empty for numbers.
    pub names: Vec<(f64, String)>,
}

impl Axis {
    /// An axis over the range of its data.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Axis {
        Axis { label: label.into(), unit: unit.into(), ..Axis::default() }
    }

    /// An axis of names at 0, 1, 2, ...
    pub fn named<N: Into<String>>(label: impl Into<String>, names: impl IntoIterator<Item = N>) -> Axis {
        let names: Vec<_> = names.into_iter().enumerate().map(|(at, name)| (at as f64, name.into())).collect();
        let range = Some([-0.5, names.len() as f64 - 0.5]);
        Axis { label: label.into(), unit: String::new(), range, names }
    }

    /// This axis from `least` to `greatest`.
    pub fn within(self, least: f64, greatest: f64) -> Axis {
        Axis { range: Some([least, greatest]), ..self }
    }

    /// Label with the unit in brackets.
    pub fn text(&self) -> String {
        if self.unit.is_empty() { self.label.clone() } else { format!("{} ({})", self.label, self.unit) }
    }
}

/// A horizontal limit line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// Label in the legend.
    pub label: String,
    /// Value on the vertical axis.
    pub value: f64,
}

/// A series of a panel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FigureSeries {
    /// Label in the legend; empty for no entry.
    pub label: String,
    /// Number of its [`Style`].
    pub style: usize,
    /// Data.
    pub shape: Shape,
}

/// Data of a series. A point that is not finite interrupts a line and is left out of other shapes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Line through (x, y).
    Line(Vec<[f64; 2]>),
    /// Line that keeps y until the next x.
    Step(Vec<[f64; 2]>),
    /// Markers at (x, y).
    Points(Vec<[f64; 2]>),
    /// Markers at (x, y) with an arrow towards the angle in rad, counterclockwise from +x.
    Arrows(Vec<[f64; 3]>),
    /// Short horizontal bars at (x, y), for limits that depend on x.
    Marks(Vec<[f64; 2]>),
    /// Line through (x, mean) and a shaded band of mean - spread to mean + spread.
    Band(Vec<[f64; 3]>),
}

impl FigureSeries {
    fn new(label: impl Into<String>, style: usize, shape: Shape) -> Series {
        Series { label: label.into(), style, shape }
    }

    /// A line through (x, y).
    pub fn line(label: impl Into<String>, style: usize, points: impl IntoIterator<Item = [f64; 2]>) -> Series {
        Series::new(label, style, Shape::Line(points.into_iter().collect()))
    }

    /// A line that keeps y until the next x.
    pub fn step(label: impl Into<String>, style: usize, points: impl IntoIterator<Item = [f64; 2]>) -> Series {
        Series::new(label, style, Shape::Step(points.into_iter().collect()))
    }

    /// Markers at (x, y).
    pub fn points(label: impl Into<String>, style: usize, points: impl IntoIterator<Item = [f64; 2]>) -> Series {
        Series::new(label, style, Shape::Points(points.into_iter().collect()))
    }

    /// Markers at (x, y) with an arrow towards an angle in rad.
    pub fn arrows(label: impl Into<String>, style: usize, points: impl IntoIterator<Item = [f64; 3]>) -> Series {
        Series::new(label, style, Shape::Arrows(points.into_iter().collect()))
    }

    /// Short horizontal bars at (x, y).
    pub fn marks(label: impl Into<String>, style: usize, points: impl IntoIterator<Item = [f64; 2]>) -> Series {
        Series::new(label, style, Shape::Marks(points.into_iter().collect()))
    }

    /// A mean with its spread: (x, mean, spread).
    pub fn band(label: impl Into<String>, style: usize, points: impl IntoIterator<Item = [f64; 3]>) -> Series {
        Series::new(label, style, Shape::Band(points.into_iter().collect()))
    }

    /// Finite (x, y) of the series, those of a band's edges included.
    pub fn extent(&self) -> Vec<[f64; 2]> {
        let points: Vec<[f64; 2]> = match &self.shape {
            Shape::Line(points) | Shape::Step(points) | Shape::Points(points) | Shape::Marks(points) => points.clone(),
            Shape::Arrows(points) => points.iter().map(|&[x, y, _]| [x, y]).collect(),
            Shape::Band(points) => points.iter().flat_map(|&[x, y, s]| [[x, y - s], [x, y + s]]).collect(),
        };
        points.into_iter().filter(|[x, y]| x.is_finite() && y.is_finite()).collect()
    }
}

/// Returns at most about `2 * buckets` points of a line: the lowest and the highest of each of `buckets` equal parts, so
/// that no peak is lost. A line of fewer points is returned as it is.
pub fn thinned(points: &[[f64; 2]], buckets: usize) -> Vec<[f64; 2]> {
    if points.len() <= 2 * buckets || buckets == 0 {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(2 * buckets + 2);
    let length = points.len().div_ceil(buckets);
    for bucket in points.chunks(length) {
        let by_y = |a: &&[f64; 2], b: &&[f64; 2]| a[1].total_cmp(&b[1]);
        let (low, high) = (bucket.iter().min_by(by_y), bucket.iter().max_by(by_y));
        let mut pair: Vec<[f64; 2]> = low.into_iter().chain(high).copied().collect();
        pair.sort_by(|a, b| a[0].total_cmp(&b[0]));
        pair.dedup();
        kept.extend(pair);
    }
    kept
}

/// Kinds of markers, by their order in [`Style::of`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the form")]
pub enum PointMarker {
    Circle,
    Cross,
    Triangle,
    Square,
    Ring,
    Plus,
}

/// Look of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    /// Red, green, blue.
    pub colour: (u8, u8, u8),
    /// Length of a dash and of the gap after it, pixels of a figure 720 wide; none for a solid line.
    pub dash: Option<(u32, u32)>,
    /// Marker of points.
    pub marker: PointMarker,
}

/// Number of the style for falls: vermillion crosses.
pub const FALL_STYLE: usize = 1;
/// Number of the style for limits: black, dotted.
pub const LIMIT_STYLE: usize = 6;

impl Style {
    /// Returns a style by its number; the numbers repeat after seven. Colours are those of Okabe and Ito without yellow,
    /// which is too light on white (Okabe and Ito, Color Universal Design, 2008).
    pub fn of(number: usize) -> Style {
        let style = |colour, dash, marker| Style { colour, dash, marker };
        match number % 7 {
            0 => style((0, 114, 178), None, PointMarker::Circle),
            1 => style((213, 94, 0), Some((16, 8)), PointMarker::Cross),
            2 => style((0, 158, 115), Some((2, 3)), PointMarker::Triangle),
            3 => style((204, 121, 167), Some((14, 4)), PointMarker::Square),
            4 => style((230, 159, 0), Some((4, 4)), PointMarker::Ring),
            5 => style((86, 180, 233), Some((10, 8)), PointMarker::Plus),
            _ => style((0, 0, 0), Some((3, 3)), PointMarker::Ring),
        }
    }
}
