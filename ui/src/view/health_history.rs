//! Temperature, battery, link and lateness over the last ten minutes, in a sweep.

use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};

use super::chart::{TimeAxis, draw_time_axis};
use super::dots::DotGrid;
use super::draw::{NO_STATE, cell_at, heading, number, truncate};
use super::parameter_axes::AXIS;
use crate::action::Action;
use crate::model::Model;
use crate::model::health_history::HealthSecond;
use crate::settings::ChartMode;
use crate::theme::{Role, Theme};

/// Time that the charts show, ns.
const WINDOW_NS: u64 = 600_000_000_000;
/// Columns of a chart at least.
const LEAST_COLUMNS: u16 = 38;

/// One quantity over time.
struct HealthChart {
    name: &'static str,
    unit: &'static str,
    /// Reason why there are no values.
    none: &'static str,
    value: fn(&HealthSecond) -> f64,
    /// Whether the robot reports it.
    reported: bool,
    /// The value from which it is no longer good.
    limit: f64,
    /// Least upper end of the vertical axis.
    top: f64,
    /// Whether large values are bad.
    worse_above: bool,
}

/// Draws the history; `alone` in place of the numbers.
pub fn render(frame: &mut Frame, area: Rect, model: &Model, alone: bool) {
    let numbers = match alone {
        true => format!("; numbers ({})", model.keymap.key(Action::Series)),
        false => String::new(),
    };
    // A replay reads only the ticks that it shows.
    let of = if model.replay.is_some() { ", of one tick in five" } else { "" };
    let aside = format!("worst of each second{of}{numbers}");
    let body = heading(frame, area, &model.theme, "Health of the last 10 minutes", &aside);
    let limits = &model.session.info.limits;
    let charts = [
        HealthChart {
            name: "hottest motor",
            unit: "C",
            none: "the robot reports no temperatures",
            value: |second| second.motor_c,
            reported: true,
            limit: limits.motor_c,
            top: 80.0,
            worse_above: true,
        },
        HealthChart {
            name: "battery",
            unit: "%",
            none: "the robot has no battery",
            value: |second| second.battery_percent,
            reported: true,
            limit: limits.battery_percent,
            top: 100.0,
            worse_above: false,
        },
        HealthChart {
            name: "age of the state",
            unit: "ms",
            none: "SIM: no link",
            value: |second| second.state_age_ms,
            reported: false,
            limit: f64::from(limits.state_age_ms),
            top: 10.0,
            worse_above: true,
        },
        HealthChart {
            name: "lateness",
            unit: "ms",
            none: "no tick yet",
            value: |second| second.lateness_ms,
            reported: false,
            limit: limits.late_ms,
            top: 1.0,
            worse_above: true,
        },
    ];
    let across = usize::from(body.width / LEAST_COLUMNS).clamp(1, charts.len());
    // Two rows of two instead of one of three and one of one.
    let across = if across == 3 { 2 } else { across };
    let rows = Layout::vertical(vec![Constraint::Fill(1); charts.len() / across]).split(body);
    for (index, chart) in charts.iter().enumerate() {
        let columns = Layout::horizontal(vec![Constraint::Fill(1); across]).spacing(2).split(rows[index / across]);
        chart.draw(frame.buffer_mut(), columns[index % across], model);
    }
}

impl HealthChart {
    fn draw(&self, buffer: &mut Buffer, area: Rect, model: &Model) {
        let theme = &model.theme;
        let [head, body, times] =
            Layout::vertical([Constraint::Length(1), Constraint::Fill(1), Constraint::Length(1)]).areas(area);
        let [_, plot] = Layout::horizontal([Constraint::Length(AXIS), Constraint::Fill(1)]).areas(body);
        if plot.width < 8 || plot.height == 0 {
            return;
        }
        let seconds = || model.health_history.seconds();
        let newest_ns = seconds().next_back().map_or(0, |second| second.second * 1_000_000_000);
        let axis = TimeAxis { mode: ChartMode::Sweep, window_ns: WINDOW_NS, newest_ns };
        let values = || seconds().map(|second| (self.value)(second)).filter(|value| value.is_finite());
        let newest = seconds().next_back().map(|second| (self.value)(second)).filter(|value| value.is_finite());
        let silent = self.reported && model.robot_is_silent();
        self.draw_heading(buffer, head, newest, silent, theme);
        // Of a silent robot the values stay that it sent before.
        if silent && values().next().is_none() {
            return;
        }
        if newest.is_none() && !silent {
            let text = truncate(self.none, usize::from(plot.width));
            buffer.set_string(plot.x, plot.y, text, theme.style(Role::Quiet));
            return;
        }
        let high = values().fold(self.top, f64::max);
        let share = |value: f64| 1.0 - value / high;
        let label = |value: f64| if value == 0.0 { "0".to_owned() } else { number(value) };
        let width = usize::from(AXIS) - 1;
        for (row, value) in [(plot.y, high), (plot.bottom() - 1, 0.0)] {
            buffer.set_string(area.x, row, format!("{:>width$.width$}", label(value)), theme.style(Role::Quiet));
        }
        if self.limit <= high {
            let row = plot.y + cell_at(share(self.limit), plot.height);
            for x in (plot.x..plot.right()).step_by(2) {
                buffer.set_string(x, row, theme.limit(), theme.style(Role::Bad));
            }
        }
        let mut dots = DotGrid::new(plot, theme.glyphs);
        let (across, down) = (dots.size.0, dots.size.1 as f64 - 1.0);
        let place = |second: &HealthSecond| {
            let value = Some((self.value)(second)).filter(|value| value.is_finite())?;
            let x = axis.column(second.second * 1_000_000_000, across)?;
            Some((x as f64, share(value).clamp(0.0, 1.0) * down))
        };
        let mut before: Option<(f64, f64)> = None;
        for point in seconds().map(place) {
            if let Some(point) = point {
                // The sweep's return to the left end is no line.
                let from = before.filter(|before| (0.0..=4.0).contains(&(point.0 - before.0))).unwrap_or(point);
                dots.line(from, point);
            }
            before = point;
        }
        dots.draw(buffer, plot, theme.style(Role::SeriesA));
        let [_, times] = Layout::horizontal([Constraint::Length(AXIS), Constraint::Fill(1)]).areas(times);
        draw_time_axis(buffer, times, &axis, None, theme);
    }

    fn draw_heading(&self, buffer: &mut Buffer, area: Rect, newest: Option<f64>, silent: bool, theme: &Theme) {
        let width = usize::from(area.width);
        let name = truncate(self.name, width);
        buffer.set_string(area.x, area.y, &name, theme.style(Role::SeriesA));
        let (role, text) = match newest {
            _ if silent => (Role::Quiet, format!(" {NO_STATE}")),
            None => return,
            Some(newest) => {
                let beyond = if self.worse_above { newest >= self.limit } else { newest <= self.limit };
                let (role, mark) = if beyond { (Role::Warning, " !") } else { (Role::Text, "") };
                let (unit, limit) = (self.unit, number(self.limit));
                (role, format!(" {} {unit}{mark}, limit {limit} {unit}", number(newest)))
            }
        };
        let used = name.chars().count();
        let x = area.x + used as u16;
        buffer.set_string(x, area.y, truncate(&text, width.saturating_sub(used)), theme.style(role));
    }
}
