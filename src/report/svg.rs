//! Figures as SVG, drawn by plotters.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::figure::{Axis, Figure, LIMIT_STYLE, Panel, PointMarker, Series, Shape, Style, thinned};
use super::ticks::{decimals, padded, round_ticks};
use crate::printable::printable;

/// Beginning of a figure's file.
const HEADER: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- quadfrog report -->\n";
/// Width of a figure, pixels.
const WIDTH: u32 = 720;
/// Units of the drawing in one pixel: plotters draws at whole numbers.
const FINE: u32 = 4;
/// Height of a panel over the whole width, and of one of several side by side, pixels.
const HEIGHTS: [u32; 2] = [300, 240];
/// Heights of a line of the legend and of a panel's title, pixels.
const LINE: u32 = 18;
/// Size of the text, pixels.
const TEXT: u32 = 12;
/// Width of the text of a character, relative to the size: mean of a sans-serif face.
const CHARACTER: f64 = 0.54;
/// Most parts of a line in which the lowest and the highest point are drawn.
const PARTS: usize = 700;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// An axis with given ticks.
struct Scale {
    range: [f64; 2],
    whole: RangedCoordf64,
    ticks: Vec<f64>,
}

impl Scale {
    fn new(range: [f64; 2], ticks: Vec<f64>) -> Scale {
        Scale { range, whole: (range[0]..range[1]).into(), ticks }
    }
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.whole.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.range[0]..self.range[1]
    }
}

/// Returns a figure as an SVG document with a white background.
pub fn draw(figure: &Figure) -> String {
    let (body, height) = body(figure);
    let attributes = "xmlns=\"http://www.w3.org/2000/svg\"";
    format!("{HEADER}{}", document(figure, &body, height, attributes))
}

/// Whether a text is a figure that [`draw`] made.
pub fn is_figure(text: &str) -> bool {
    text.starts_with(HEADER)
}

/// Returns a figure as an SVG element of an HTML document.
pub fn inline(figure: &Figure) -> String {
    let (body, height) = body(figure);
    document(figure, &body, height, "")
}

fn document(figure: &Figure, body: &str, height: u32, attributes: &str) -> String {
    let mut title = String::new();
    for c in printable(&figure.caption).chars() {
        match c {
            '<' => title.push_str("&lt;"),
            '>' => title.push_str("&gt;"),
            '&' => title.push_str("&amp;"),
            c => title.push(c),
        }
    }
    let (width, box_width, box_height) = (WIDTH, WIDTH * FINE, height * FINE);
    format!(
        "<svg {attributes} role=\"img\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {box_width} {box_height}\">\n<title>{title}</title>\n{body}</svg>\n"
    )
}

/// Returns the elements of the drawing and the height, pixels.
fn body(figure: &Figure) -> (String, u32) {
    let legend = legend(figure);
    let columns = figure.columns.clamp(1, figure.panels.len().max(1));
    let usual = HEIGHTS[usize::from(columns > 1)];
    let height_of = |panel: &Panel| panel.height.unwrap_or(usual) + if panel.title.is_empty() { 0 } else { LINE };
    let rows: Vec<u32> =
        figure.panels.chunks(columns).map(|row| row.iter().map(height_of).max().unwrap_or(usual)).collect();
    let top = legend.len() as u32 * LINE + if legend.is_empty() { 4 } else { 10 };
    let height = top + rows.iter().sum::<u32>() + 6;
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (WIDTH * FINE, height * FINE)).into_drawing_area();
        let drawn = paint(&root, figure, &legend, columns, &rows, top);
        drawn.and_then(|()| root.present()).expect("a drawing in memory does not fail");
    }
    // The element of plotters itself is replaced: its size is that of the fine drawing.
    let begin = text.find('>').map_or(0, |at| at + 1);
    let end = text.rfind("</svg>").unwrap_or(text.len());
    (text[begin..end].trim_start().to_owned(), height)
}

fn paint(root: &Area, figure: &Figure, legend: &[Vec<Entry>], columns: usize, rows: &[u32], top: u32) -> Drawn {
    root.fill(&WHITE)?;
    for (line, entries) in legend.iter().enumerate() {
        for entry in entries {
            entry.draw(root, (4 + line as u32 * LINE + LINE / 2) as i32)?;
        }
    }
    let width = WIDTH / columns as u32;
    let mut y = top;
    for (row, &height) in figure.panels.chunks(columns).zip(rows) {
        for (column, panel) in row.iter().enumerate() {
            let cell = root.clone().shrink((fine(column as u32 * width), fine(y)), (width * FINE, height * FINE));
            self::panel(&cell, panel, width, height)?;
        }
        y += height;
    }
    Ok(())
}

fn fine(pixels: u32) -> i32 {
    (pixels * FINE) as i32
}

fn colour(style: Style) -> RGBColor {
    RGBColor(style.colour.0, style.colour.1, style.colour.2)
}

/// Font in the size of the figure's text; plotters divides sizes by 1.24.
fn font() -> TextStyle<'static> {
    ("sans-serif", f64::from(TEXT * FINE) * 1.24).into_font().color(&RGBColor(26, 26, 26))
}

fn text_width(text: &str) -> u32 {
    (text.chars().count() as f64 * f64::from(TEXT) * CHARACTER).ceil() as u32
}

/// Sample of a series before its label.
#[derive(Clone, Copy)]
enum Sample {
    Line,
    Marker,
    Bar,
}

/// One entry of the legend.
struct Entry {
    label: String,
    style: Style,
    sample: Sample,
    /// Distance of its beginning from the left, pixels.
    x: u32,
}

/// Width of the sample before a label, pixels.
const SAMPLE: u32 = 34;

/// Returns the lines of the legend; one series without limits needs none.
fn legend(figure: &Figure) -> Vec<Vec<Entry>> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut add = |label: &str, style: usize, sample: Sample| {
        if !label.is_empty() && !entries.iter().any(|entry| entry.label == printable(label)) {
            entries.push(Entry { label: printable(label), style: Style::of(style), sample, x: 0 });
        }
    };
    for panel in &figure.panels {
        for series in &panel.series {
            let sample = match series.shape {
                Shape::Line(_) | Shape::Step(_) | Shape::Band(_) => Sample::Line,
                Shape::Points(_) | Shape::Arrows(_) => Sample::Marker,
                Shape::Marks(_) => Sample::Bar,
            };
            add(&series.label, series.style, sample);
        }
        for limit in &panel.limits {
            add(&limit.label, LIMIT_STYLE, Sample::Line);
        }
    }
    let mut lines: Vec<Vec<Entry>> = Vec::new();
    let mut used = WIDTH;
    for mut entry in entries {
        let width = SAMPLE + text_width(&entry.label) + 18;
        if used + width > WIDTH {
            lines.push(Vec::new());
            used = 12;
        }
        entry.x = used;
        used += width;
        lines.last_mut().expect("a line was begun").push(entry);
    }
    lines
}

impl Entry {
    fn draw(&self, root: &Area, y: i32) -> Drawn {
        let (x, y) = (fine(self.x), y * FINE as i32);
        let ink = colour(self.style);
        match self.sample {
            Sample::Line => {
                let path = [(x, y), (x + fine(SAMPLE - 8), y)];
                let stroke = ink.stroke_width(2 * FINE);
                match self.style.dash {
                    None => root.draw(&PathElement::new(path, stroke))?,
                    Some((dash, gap)) => root.draw(&DashedPathElement::new(path, dash * FINE, gap * FINE, stroke))?,
                }
            }
            Sample::Marker => marker(root, self.style, (x + fine(SAMPLE / 2), y))?,
            Sample::Bar => {
                root.draw(&Rectangle::new([(x + fine(6), y - fine(1)), (x + fine(26), y + fine(1))], ink.filled()))?
            }
        }
        let at = font().pos(Pos::new(HPos::Left, VPos::Center));
        root.draw(&Text::new(self.label.clone(), (x + fine(SAMPLE - 4), y), at))
    }
}

/// Draws a marker at a place of the area.
fn marker(area: &Area, style: Style, (x, y): (i32, i32)) -> Drawn {
    let ink = colour(style);
    let stroke = ink.stroke_width(2 * FINE);
    let r = fine(4);
    let line = |from: (i32, i32), to: (i32, i32)| PathElement::new([from, to], stroke);
    match style.marker {
        PointMarker::Circle => area.draw(&Circle::new((x, y), r, ink.filled())),
        PointMarker::Ring => area.draw(&Circle::new((x, y), r, stroke)),
        PointMarker::Square => area.draw(&Rectangle::new([(x - r, y - r), (x + r, y + r)], ink.filled())),
        PointMarker::Triangle => {
            area.draw(&Polygon::new([(x, y - r - r / 4), (x - r, y + r), (x + r, y + r)], ink.filled()))
        }
        PointMarker::Cross => {
            area.draw(&line((x - r, y - r), (x + r, y + r)))?;
            area.draw(&line((x - r, y + r), (x + r, y - r)))
        }
        PointMarker::Plus => {
            area.draw(&line((x - r, y), (x + r, y)))?;
            area.draw(&line((x, y - r), (x, y + r)))
        }
    }
}

fn panel(cell: &Area, panel: &Panel, width: u32, height: u32) -> Drawn {
    let extents: Vec<[f64; 2]> = panel.series.iter().flat_map(Series::extent).collect();
    let limits: Vec<f64> = panel.limits.iter().map(|limit| limit.value).collect();
    let mut x = range(&panel.x, extents.iter().map(|point| point[0]).collect(), 0.0);
    let mut y = range(&panel.y, extents.iter().map(|point| point[1]).chain(limits).collect(), 0.05);
    let title = if panel.title.is_empty() { 8 } else { LINE + 4 };
    let plot_height = height.saturating_sub(title + 44).max(40);
    let mut left = y_labels(&panel.y, y, plot_height).1;
    let plot_width = width.saturating_sub(left + 16).max(40);
    if panel.equal {
        let scale = ((x[1] - x[0]) / f64::from(plot_width)).max((y[1] - y[0]) / f64::from(plot_height));
        let widened = |[low, high]: [f64; 2], pixels: u32| {
            let more = (scale * f64::from(pixels) - (high - low)).max(0.0) / 2.0;
            [low - more, high + more]
        };
        (x, y) = (widened(x, plot_width), widened(y, plot_height));
        left = left.max(y_labels(&panel.y, y, plot_height).1);
    }
    let x_ticks = ticks(&panel.x, x, plot_width / 55);
    let (y_ticks, _) = y_labels(&panel.y, y, plot_height);
    let x_name = |value: &f64| name(&panel.x, &x_ticks, *value);
    let y_name = |value: &f64| name(&panel.y, &y_ticks, *value);
    if !panel.title.is_empty() {
        let at = font().pos(Pos::new(HPos::Left, VPos::Center));
        cell.draw(&Text::new(printable(&panel.title), (fine(left), fine(LINE / 2 + 2)), at))?;
    }
    let mut chart = ChartBuilder::on(cell)
        .margin_top(title * FINE)
        .margin_right(16 * FINE)
        .margin_left(6 * FINE)
        .x_label_area_size(40 * FINE)
        .y_label_area_size((left - 6) * FINE)
        .build_cartesian_2d(Scale::new(x, x_ticks.clone()), Scale::new(y, y_ticks.clone()))?;
    chart
        .configure_mesh()
        .bold_line_style(RGBColor(225, 225, 225).stroke_width(FINE))
        .light_line_style(TRANSPARENT)
        .axis_style(RGBColor(90, 90, 90).stroke_width(FINE))
        .set_all_tick_mark_size(3 * FINE)
        .label_style(font())
        .axis_desc_style(font())
        .x_labels(x_ticks.len().max(1))
        .y_labels(y_ticks.len().max(1))
        .x_label_formatter(&x_name)
        .y_label_formatter(&y_name)
        .x_desc(printable(&panel.x.text()))
        .y_desc(printable(&panel.y.text()))
        .draw()?;
    for limit in &panel.limits {
        line(&mut chart, Style::of(LIMIT_STYLE), &[[x[0], limit.value], [x[1], limit.value]], 2)?;
    }
    for series in &panel.series {
        self::series(&mut chart, series, x)?;
    }
    Ok(())
}

/// Range of an axis: the given one, else that of the data with a margin of `share` on both sides.
fn range(axis: &Axis, values: Vec<f64>, share: f64) -> [f64; 2] {
    match axis.range {
        Some([low, high]) if low < high && low.is_finite() && high.is_finite() => [low, high],
        _ => padded(&values, share),
    }
}

fn ticks(axis: &Axis, range: [f64; 2], most: u32) -> Vec<f64> {
    if axis.names.is_empty() {
        return round_ticks(range, most.clamp(2, 10) as usize);
    }
    axis.names.iter().map(|(value, _)| *value).filter(|value| (range[0]..=range[1]).contains(value)).collect()
}

/// Returns the ticks of the vertical axis and the width of its labels and its description, pixels.
fn y_labels(axis: &Axis, range: [f64; 2], height: u32) -> (Vec<f64>, u32) {
    let ticks = ticks(axis, range, height / 30);
    let widest = ticks.iter().map(|tick| text_width(&name(axis, &ticks, *tick))).max().unwrap_or(0);
    (ticks, widest + 34)
}

fn name(axis: &Axis, ticks: &[f64], value: f64) -> String {
    match axis.names.iter().find(|(at, _)| (at - value).abs() < 1e-9) {
        Some((_, name)) => printable(name),
        None if !axis.names.is_empty() => String::new(),
        None => {
            let text = format!("{value:.*}", decimals(ticks));
            let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
            text.replace('-', if is_zero { "" } else { "\u{2212}" })
        }
    }
}

/// Draws a line, dashed by its style; a point that is not finite interrupts it.
fn line(chart: &mut Chart, style: Style, points: &[[f64; 2]], width: u32) -> Drawn {
    let ink = colour(style).stroke_width(width * FINE);
    for part in points.split(|[x, y]| !x.is_finite() || !y.is_finite()) {
        let part: Vec<(f64, f64)> = thinned(part, PARTS).into_iter().map(|[x, y]| (x, y)).collect();
        if part.len() < 2 {
            continue;
        }
        match style.dash {
            None => chart.draw_series(LineSeries::new(part, ink))?,
            Some((dash, gap)) => chart.draw_series(DashedLineSeries::new(part, dash * FINE, gap * FINE, ink))?,
        };
    }
    Ok(())
}

fn series(chart: &mut Chart, series: &Series, x: [f64; 2]) -> Drawn {
    let style = Style::of(series.style);
    let inside = |points: &[[f64; 2]]| -> Vec<[f64; 2]> {
        points.iter().map(|&[at, y]| [at, if (x[0]..=x[1]).contains(&at) { y } else { f64::NAN }]).collect()
    };
    let area = chart.plotting_area().strip_coord_spec();
    let (origin, _) = chart.plotting_area().get_pixel_range();
    let top = chart.plotting_area().get_pixel_range().1.start;
    let place = |chart: &Chart, [x, y]: [f64; 2]| {
        let (px, py) = chart.plotting_area().map_coordinate(&(x, y));
        (px - origin.start, py - top)
    };
    match &series.shape {
        Shape::Line(points) => line(chart, style, &inside(points), 2),
        Shape::Step(points) => {
            let mut corners = Vec::with_capacity(2 * points.len());
            for pair in points.windows(2) {
                corners.extend([pair[0], [pair[1][0], pair[0][1]]]);
            }
            corners.extend(points.last());
            line(chart, style, &inside(&corners), 2)
        }
        Shape::Points(_) => {
            for point in series.extent() {
                marker(&area, style, place(chart, point))?;
            }
            Ok(())
        }
        Shape::Marks(_) => {
            for point in series.extent() {
                let (x, y) = place(chart, point);
                let bar = [(x - fine(16), y - fine(1)), (x + fine(16), y + fine(1))];
                area.draw(&Rectangle::new(bar, colour(style).filled()))?;
            }
            Ok(())
        }
        Shape::Arrows(points) => {
            for &[x, y, angle] in points.iter().filter(|point| point.iter().all(|value| value.is_finite())) {
                let (px, py) = place(chart, [x, y]);
                let along = |length: u32, turned: f64| {
                    let (sin, cos) = (angle + turned).sin_cos();
                    (f64::from(length * FINE) * cos, -f64::from(length * FINE) * sin)
                };
                let tip = (px + along(20, 0.0).0 as i32, py + along(20, 0.0).1 as i32);
                let ink = colour(style).stroke_width(3 * FINE / 2);
                area.draw(&PathElement::new([(px, py), tip], ink))?;
                for side in [2.6, -2.6] {
                    let (dx, dy) = along(6, side);
                    area.draw(&PathElement::new([tip, (tip.0 + dx as i32, tip.1 + dy as i32)], ink))?;
                }
                marker(&area, style, (px, py))?;
            }
            Ok(())
        }
        Shape::Band(points) => {
            let known: Vec<_> = points.iter().filter(|point| point.iter().all(|value| value.is_finite())).collect();
            let upper = known.iter().map(|&&[x, mean, spread]| (x, mean + spread));
            let lower = known.iter().rev().map(|&&[x, mean, spread]| (x, mean - spread));
            let edge: Vec<(f64, f64)> = upper.chain(lower).collect();
            if known.len() > 1 {
                chart.draw_series(std::iter::once(Polygon::new(edge, colour(style).mix(0.2).filled())))?;
            }
            line(chart, style, &inside(&known.iter().map(|&&[x, mean, _]| [x, mean]).collect::<Vec<_>>()), 2)
        }
    }
}
