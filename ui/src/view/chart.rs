//! A chart of one series over time, in sweep or scroll mode.

use quadfrog::control::foot_placement::SHORTEST_FLIGHT_S;
use quadfrog::telemetry::Phase;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::dots::{DotGrid, dots_across};
use super::draw::truncate;
use super::series_style::SeriesStyle;
use crate::model::comparison::time_after;
use crate::model::history::{ChartSample, SignalHistory, THINNED_NS, at_trial_time};
use crate::settings::ChartMode;
use crate::theme::{Glyphs, Role, Theme};

/// The time axis, the same for all charts of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeAxis {
    pub mode: ChartMode,
    /// Time shown, ns.
    pub window_ns: u64,
    /// Time of the newest sample, ns.
    pub newest_ns: u64,
}

/// Columns of a vertical axis with its values.
const AXIS: u16 = 6;
/// Rows of a plot up to which its axis has no values beside the rows.
const ROWS_WITHOUT_TICKS: u16 = 2;

/// The part of a chart's area in which the curves are.
pub fn plot_columns(area: Rect) -> Rect {
    let axis = AXIS.min(area.width);
    Rect { x: area.x + axis, width: area.width - axis, ..area }
}

/// Share of the window that stays empty before the sweep's cursor, so that new and old do not touch.
const GAP: f64 = 0.06;

impl TimeAxis {
    /// The position of a time, 0 at the left to 1 at the right; none outside of the window.
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

#[derive(Clone, Copy)]
pub struct Ghost<'a> {
    pub trace: &'a [ChartSample],
    /// Where its impulse begins on the charts' axis, ns.
    pub start_ns: u64,
    pub role: Role,
    /// Whether its value stands beside the other in the heading.
    pub named: bool,
}

/// A chart with its heading line. Under two rows nothing is drawn.
pub struct Chart<'a> {
    pub style: SeriesStyle,
    /// Least and largest value of its vertical axis.
    pub range: (f32, f32),
    pub axis: TimeAxis,
    /// The values in the window.
    pub curve: &'a Curve,
    /// The column of each of these samples, from [`sample_columns`].
    pub columns: &'a [SampleColumn],
    /// The phase of each column, from [`phases`].
    pub phases: &'a [Option<Phase>],
    /// A trial to lay under the samples.
    pub ghost: Option<Ghost<'a>>,
    /// Sample of the value in the heading.
    pub named: Option<&'a ChartSample>,
    /// Time of the cursor; none without one.
    pub cursor_ns: Option<u64>,
    /// Whether the sweep's cursor is drawn as a line.
    pub cursor_line: bool,
    /// Whether the middle of the vertical axis is named: the same for all charts of a screen.
    pub middle_tick: bool,
    pub theme: Theme,
}

/// A series in the window.
#[derive(Default)]
pub struct Curve {
    values: Vec<f32>,
    /// Empty for a series that is not commanded.
    commanded: Vec<f32>,
}

/// Returns the curve of each of these series. Each sample is read once: it has half a kilobyte, and a curve takes four bytes of it.
pub fn curves(styles: &[SeriesStyle], history: &SignalHistory, axis: &TimeAxis) -> Vec<Curve> {
    let mut curves: Vec<Curve> = styles.iter().map(|_| Curve::default()).collect();
    for sample in history.window(axis.window_ns) {
        for (style, curve) in styles.iter().zip(&mut curves) {
            curve.values.push(style.value(sample));
            curve.commanded.extend(style.commanded(sample));
        }
    }
    curves
}

/// Time of a sample, ns, and its column of dots; none outside of the window.
pub type SampleColumn = (u64, Option<usize>);

/// The columns of the samples in the window on every chart of this width.
pub fn sample_columns(axis: &TimeAxis, history: &SignalHistory, width: u16, glyphs: Glyphs) -> Vec<SampleColumn> {
    let across = dots_across(width, glyphs);
    history.window(axis.window_ns).map(|sample| (sample.time_ns, axis.column(sample.time_ns, across))).collect()
}

impl SeriesStyle {
    /// The first of the series' ranges that holds what is drawn of it.
    pub fn range_of(&self, curve: &Curve, ghost: Option<Ghost<'_>>) -> usize {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut widen = |value: f32| {
            // No comparison with NaN holds.
            let value = if value.is_finite() { value } else { f32::NAN };
            low = if value < low { value } else { low };
            high = if value > high { value } else { high };
        };
        for value in &curve.values {
            widen(*value);
        }
        for value in &curve.commanded {
            widen(*value);
        }
        for sample in ghost.iter().flat_map(|ghost| ghost.trace) {
            widen(self.value(sample));
            self.commanded(sample).into_iter().for_each(&mut widen);
        }
        let holds = |range: &(f32, f32)| low >= range.0 && high <= range.1;
        self.ranges.iter().position(holds).unwrap_or(self.ranges.len().saturating_sub(1))
    }
}

impl Chart<'_> {
    pub fn draw(&self, buffer: &mut Buffer, area: Rect) {
        if area.height < 2 || area.width < AXIS + 8 {
            return;
        }
        let plot = plot_columns(Rect { y: area.y + 1, height: area.height - 1, ..area });
        let (low, high) = self.range;
        let used = self.draw_heading(buffer, Rect { height: 1, ..area });
        if plot.height <= ROWS_WITHOUT_TICKS {
            self.draw_range(buffer, Rect { height: 1, ..area }, used, plot);
        } else {
            self.draw_ticks(buffer, plot, (low, high));
        }
        self.draw_zero(buffer, plot, (low, high));
        self.draw_limits(buffer, plot, (low, high));
        if let Some(ghost) = self.ghost {
            self.draw_ghost(buffer, plot, ghost, (low, high));
        }
        let curves = [(&self.curve.commanded, Role::Ghost, true), (&self.curve.values, self.style.role, false)];
        for (values, role, dotted) in curves {
            let mut dots = DotGrid::new(plot, self.theme.glyphs);
            let points = self.columns.iter().copied().zip(values.iter().copied());
            trace(&mut dots, points, (low, high), self.style.largest_step(), dotted);
            dots.draw(buffer, plot, self.theme.style(role));
        }
        self.shade(buffer, plot);
        self.draw_cursor(buffer, plot);
    }

    /// The ends of the vertical axis of a plot with few rows, in which a value in the middle would stand beside an end: at the
    /// right of the heading, of which `used` columns are taken, or else beside the plot if they are opposite.
    fn draw_range(&self, buffer: &mut Buffer, heading: Rect, used: usize, plot: Rect) {
        let ((low, high), style) = (self.range, self.theme.style(Role::Quiet));
        let text = format!("{} to {}", tick_text(low), tick_text(high));
        let columns = text.chars().count();
        if used + 2 + columns <= usize::from(heading.width) {
            buffer.set_string(heading.right() - columns as u16, heading.y, text, style);
        } else if low == -high {
            let text = format!("{}{}", self.theme.plus_minus(), tick_text(high));
            let text = format!("{text:>width$}", width = usize::from(AXIS) - 1);
            buffer.set_stringn(plot.x - AXIS, plot.y, text, usize::from(AXIS), style);
        }
    }

    /// The values at the ends and in the middle of the vertical axis.
    fn draw_ticks(&self, buffer: &mut Buffer, plot: Rect, (low, high): (f32, f32)) {
        let x = plot.x.saturating_sub(AXIS);
        let mut tick = |row: u16, value: f32| {
            let text = format!("{:>width$}", tick_text(value), width = usize::from(AXIS) - 1);
            buffer.set_string(x, plot.y + row, text, self.theme.style(Role::Quiet));
        };
        tick(0, high);
        tick(plot.height - 1, low);
        // Of an even number of rows the lower one, where the line at zero is.
        if self.middle_tick {
            tick(plot.height / 2, (low + high) / 2.0);
        }
    }

    /// Lines at the limits that lie within the axis; they stay below the curve.
    fn draw_limits(&self, buffer: &mut Buffer, plot: Rect, (low, high): (f32, f32)) {
        for limit in self.style.limits.into_iter().filter(|limit| (low..=high).contains(limit)) {
            let row = (((high - limit) / (high - low) * f32::from(plot.height)) as u16).min(plot.height - 1);
            for x in (plot.x..plot.right()).step_by(2) {
                buffer.set_string(x, plot.y + row, self.theme.limit(), self.theme.style(Role::Bad));
            }
        }
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

    /// Name, contact indicator and value. Returns the columns that they take.
    fn draw_heading(&self, buffer: &mut Buffer, area: Rect) -> usize {
        let theme = &self.theme;
        let sample = self.named;
        let ghost = self.ghost.filter(|ghost| ghost.named).zip(self.cursor_ns);
        // Two trials have two contacts, and one sign would be that of either.
        let foot = self.style.foot.filter(|_| ghost.is_none());
        let contact = match (foot, sample.and_then(|sample| self.style.contact(sample))) {
            (Some(_), Some(contact)) => theme.contact_indicator(contact),
            (Some(_), None) => " ",
            (None, _) => "",
        };
        let value = |decimals| sample.map_or("-".to_owned(), |sample| self.number(sample, decimals));
        let ghost = ghost.map(|(ghost, time_ns)| {
            let time_s = (time_ns as f64 - ghost.start_ns as f64) / 1e9;
            (at_trial_time(ghost.trace, time_s as f32), ghost.role)
        });
        let unit = self.style.series.unit();
        let width = usize::from(area.width);
        // From the longest form to the shortest.
        let (forms, role_b) = match ghost {
            Some((other, role)) => {
                let other = |decimals| other.map_or("-".to_owned(), |sample| self.number(sample, decimals));
                let named = [format!("B {} {unit}", other(3)), format!("B {}", other(3))];
                let named = named.map(|b| (format!("A {} ", value(3)), b));
                let short = [3, 2, 1].map(|decimals| (value(decimals), format!("/{}", other(decimals))));
                ([&named[..], &short[..]].concat(), role)
            }
            None => {
                let with_unit = (format!("{} {unit}", value(3)), String::new());
                let short = [3, 2, 1].map(|decimals| (value(decimals), String::new()));
                ([&[with_unit][..], &short[..]].concat(), Role::Text)
            }
        };
        // A number is never cut; the quantity of a joint gives way before it.
        let name = self.style.series.name();
        let joint = name.split(' ').next().filter(|joint| joint.contains('_')).unwrap_or(name);
        let names = [name, joint].map(|name| format!("{name}{contact} "));
        let columns = |text: &str| text.chars().count();
        let fits = |name: &str, (a, b): &(String, String)| columns(name) + columns(a) + columns(b) <= width;
        let found = names.iter().find_map(|name| Some((name, forms.iter().find(|form| fits(name, form))?)));
        let (name, (a, b)) = found.unwrap_or((&names[1], &forms[forms.len() - 1]));
        let pieces = [(name, self.style.role), (a, Role::Text), (b, role_b)];
        let mut used = 0;
        for (text, role) in pieces {
            let text = truncate(text, width - used);
            buffer.set_string(area.x + used as u16, area.y, &text, theme.style(role));
            used += text.chars().count();
        }
        used
    }

    /// The value to some decimals, or none from 100 on; `-` for no number.
    fn number(&self, sample: &ChartSample, decimals: usize) -> String {
        let value = self.style.value(sample);
        if !value.is_finite() {
            return "-".to_owned();
        }
        // Otherwise the text would alternate between -0.000 and +0.000.
        let value = if value.abs() < 0.5 * 0.1_f32.powi(decimals as i32) { 0.0 } else { value };
        if value.abs() >= 100.0 { format!("{value:+.0}") } else { format!("{value:+.decimals$}") }
    }

    /// The ghost's samples at the time that they would have if its impulse had begun where the axis says.
    fn draw_ghost(&self, buffer: &mut Buffer, plot: Rect, ghost: Ghost, range: (f32, f32)) {
        let mut dots = DotGrid::new(plot, self.theme.glyphs);
        let points = ghost.trace.iter().map(|sample| {
            let time_ns = time_after(ghost.start_ns, sample.trial_time_s);
            ((time_ns, self.axis.column(time_ns, dots.size.0)), self.style.value(sample))
        });
        let points: Vec<_> = points.collect();
        trace(&mut dots, points.into_iter(), range, self.style.largest_step(), ghost.named);
        dots.draw(buffer, plot, self.theme.style(ghost.role));
    }

    /// Colours the columns of a jump's phases; [`draw_phases`] shows the same in letters.
    fn shade(&self, buffer: &mut Buffer, plot: Rect) {
        for (column, (role, _)) in jump_columns(self.phases, plot.width) {
            buffer.set_style(Rect { x: plot.x + column, width: 1, ..plot }, self.theme.style(role));
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

/// A value of the vertical axis: 0.25, -30.
fn tick_text(value: f32) -> String {
    let digits = format!("{value:.2}");
    digits.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Distances of the marks on the time axis, s, and columns between two of them at least.
const STEPS_S: [f64; 10] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0];
const STEP_COLUMNS: f64 = 6.0;

/// Draws the marks of the time axis, s: of a sweep from the left end, else from `origin_ns`, without one from the newest sample.
pub fn draw_time_axis(buffer: &mut Buffer, area: Rect, axis: &TimeAxis, origin_ns: Option<u64>, theme: &Theme) {
    let window_s = axis.window_ns as f64 / 1e9;
    let least_s = STEP_COLUMNS * window_s / f64::from(area.width.max(1));
    let step_s = STEPS_S.into_iter().find(|step| *step >= least_s).unwrap_or(window_s);
    let newest_s = match (axis.mode, origin_ns) {
        (ChartMode::Sweep, _) => window_s,
        (ChartMode::Scroll, Some(origin_ns)) => (axis.newest_ns as f64 - origin_ns as f64) / 1e9,
        (ChartMode::Scroll, None) => 0.0,
    };
    let first_s = newest_s - window_s;
    let decimals = usize::from(step_s < 1.0);
    let mut free = area.x;
    for mark in (first_s / step_s).ceil() as i64..=(newest_s / step_s).floor() as i64 {
        let time_s = mark as f64 * step_s;
        let column = (time_s - first_s) / window_s * f64::from(area.width);
        let unit = if mark == 0 { " s" } else { "" };
        let text = format!("{time_s:.decimals$}{unit}");
        let x = area.x + (column as u16).min(area.width.saturating_sub(text.len() as u16));
        if x >= free && x + text.len() as u16 <= area.right() {
            buffer.set_string(x, area.y, &text, theme.style(Role::Quiet));
            free = x + text.len() as u16 + 1;
        }
    }
}

/// Sets the dots of a line through the points, as far as the axis shows them; `dotted` leaves out two columns of four.
/// Values farther apart than `largest_step` are not joined.
fn trace(
    dots: &mut DotGrid,
    points: impl Iterator<Item = (SampleColumn, f32)>,
    (low, high): (f32, f32),
    largest_step: f32,
    dotted: bool,
) {
    let (across, down) = dots.size;
    if across == 0 || down == 0 {
        return;
    }
    let dots_per_unit = down as f32 / (high - low);
    let mut before: Option<(u64, usize, i64)> = None;
    let largest_step = largest_step * dots_per_unit;
    for ((time_ns, column), value) in points {
        before = column.filter(|_| value.is_finite()).map(|x| {
            let y = ((high - value) * dots_per_unit) as i64;
            let y = y.clamp(0, down as i64 - 1);
            if before.is_some_and(|(_, x0, y0)| (x0, y0) == (x, y)) {
                return (time_ns, x, y);
            }
            // Joined to the sample before in this or the next column, or in a thinned trace; not to one at the other end of
            // the chart, nor over a gap in which nothing was received.
            let joined = |(t0, x0, y0): &(u64, usize, i64)| {
                let near = x.wrapping_sub(*x0) <= 1 || x > *x0 && time_ns.saturating_sub(*t0) <= THINNED_NS;
                near && (y - y0).abs() as f32 <= largest_step
            };
            let (x0, y0) = before.filter(joined).map_or((x, y), |(_, x0, y0)| (x0, y0));
            for column in (x0 + 1).min(x)..=x {
                // The part of the line in this column.
                let at = |column: usize| y0 + (y - y0) * (column - x0) as i64 / (x - x0).max(1) as i64;
                let (from, to) = if x > x0 { (at(column - 1), at(column)) } else { (y0, y) };
                let drawn = !dotted || column % 4 < 2;
                for y in (from.min(to)..=from.max(to)).filter(|_| drawn) {
                    dots.set(column as i64, y);
                }
            }
            (time_ns, x, y)
        });
    }
}

/// The phase that each column shows, as the robot moved: it is in flight while no foot is on the ground, also where the impulse
/// still acts. Of several in a column flight comes first, stance last.
pub fn phases(axis: &TimeAxis, history: &SignalHistory, width: u16) -> Vec<Option<Phase>> {
    let mut phases = vec![None; usize::from(width)];
    let (mut flew, mut airborne_since_ns, mut before) = (false, None, Phase::Stance);
    for sample in history.window(axis.window_ns) {
        let jumps = sample.trial.is_some() && sample.trial_time_s >= 0.0;
        let commanded = if jumps { sample.phase } else { Phase::Stance };
        // Each impulse begins a jump.
        flew &= jumps && !(commanded == Phase::Impulse && before != Phase::Impulse);
        before = commanded;
        let airborne = commanded != Phase::Stance && !sample.contact.iter().any(|&down| down);
        airborne_since_ns = airborne.then(|| airborne_since_ns.unwrap_or(sample.time_ns));
        // A shorter flight may be a foot that slips or a sensor that flickers.
        flew |= airborne_since_ns
            .is_some_and(|since_ns| sample.time_ns.saturating_sub(since_ns) as f64 >= SHORTEST_FLIGHT_S * 1e9);
        let phase = match commanded {
            // A robot that has landed before the end of its impulse stands after it, for the controller.
            Phase::Stance if !flew => Phase::Stance,
            _ if airborne => Phase::Flight,
            _ if flew => Phase::Landing,
            _ => Phase::Impulse,
        };
        if let Some(column) = axis.column(sample.time_ns, usize::from(width)) {
            let rank = |phase| match phase {
                Phase::Flight => 3,
                Phase::Impulse => 2,
                Phase::Landing => 1,
                Phase::Stance => 0,
            };
            if phases[column].is_none_or(|drawn| rank(drawn) < rank(phase)) {
                phases[column] = Some(phase);
            }
        }
    }
    phases
}

/// The columns of a jump's phases, each with its role and its names, the shorter one last.
fn jump_columns(phases: &[Option<Phase>], width: u16) -> impl Iterator<Item = (u16, (Role, [&'static str; 2]))> {
    (0..width).zip(phases).filter_map(|(column, phase)| match phase {
        Some(Phase::Impulse) => Some((column, (Role::ShadeImpulse, ["impulse", "push"]))),
        Some(Phase::Flight) => Some((column, (Role::ShadeFlight, ["flight", "air"]))),
        Some(Phase::Landing) => Some((column, (Role::ShadeLanding, ["landing", "land"]))),
        Some(Phase::Stance) | None => None,
    })
}

/// A line under charts with the name of each phase of a jump, marked at its begin: `|push|flight--|landing-`. Where a phase is narrow
/// it has a shorter name, or none.
pub fn draw_phases(buffer: &mut Buffer, area: Rect, phases: &[Option<Phase>], theme: &Theme) {
    let columns: Vec<_> = jump_columns(phases, area.width).collect();
    let joined = |a: &(u16, (Role, [&str; 2])), b: &(u16, (Role, [&str; 2]))| a.1.1 == b.1.1 && b.0 == a.0 + 1;
    for run in columns.chunk_by(joined) {
        let names = run[0].1.1;
        let fits = |text: &&str| run.len() > text.len();
        let shown = names.into_iter().find(fits).unwrap_or_default();
        let begin = if run.len() > 1 { theme.bar() } else { theme.line() };
        let line = theme.line().repeat(run.len() - shown.len() - 1);
        buffer.set_string(area.x + run[0].0, area.y, format!("{begin}{shown}{line}"), theme.style(Role::Quiet));
    }
}
