//! Axes of the panels over one parameter: its shown range to the right, so that all panels of a column agree, and the values
//! upwards.

use quadfrog::trial::ParameterInfo;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};

use super::draw::{cell_at, number};
use crate::theme::{Role, Theme};

/// Columns of a vertical axis with its values.
pub const AXIS: u16 = 7;

/// Span of a vertical axis of values at least, m or rad. Falls alone have no scale.
pub const LEAST_SPAN: f64 = 1e-3;

/// Plot and axes over one parameter.
pub struct ParameterAxes<'a> {
    pub info: &'a ParameterInfo,
    pub plot: Rect,
    /// The row of the parameter's bounds.
    bounds: Rect,
    /// Least and largest value of the vertical axis.
    pub values: (f64, f64),
}

impl<'a> ParameterAxes<'a> {
    /// The axes in an area; none where it is too small.
    pub fn new(info: &'a ParameterInfo, area: Rect, values: (f64, f64)) -> Option<ParameterAxes<'a>> {
        let [_, right] = Layout::horizontal([Constraint::Length(AXIS), Constraint::Fill(1)]).areas(area);
        let [plot, bounds] = Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(right);
        (plot.height >= 2 && plot.width >= 8).then_some(ParameterAxes { info, plot, bounds, values })
    }

    /// The share of the width at which a value of the parameter lies.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.info.low) / (self.info.high - self.info.low)
    }

    pub fn column(&self, value: f64) -> u16 {
        self.plot.x + cell_at(self.share(value), self.plot.width)
    }

    pub fn row(&self, value: f64) -> u16 {
        let (low, high) = self.values;
        self.plot.y + cell_at((high - value) / (high - low), self.plot.height)
    }

    /// Draws the ends of both axes, and a line at the proposed value with the value below it.
    pub fn draw(&self, buffer: &mut Buffer, proposed: Option<f64>, theme: &Theme) {
        let (plot, bounds) = (self.plot, self.bounds);
        let quiet = theme.style(Role::Quiet);
        let width = usize::from(AXIS) - 1;
        for (row, value) in [(plot.y, self.values.1), (plot.bottom() - 1, self.values.0)] {
            let text = match value {
                0.0 => "0".to_owned(),
                LEAST_SPAN => String::new(),
                value => number(value),
            };
            buffer.set_string(plot.x - AXIS, row, format!("{text:>width$.width$}"), quiet);
        }
        let (low, high) = (number(self.info.low), number(self.info.high));
        buffer.set_string(bounds.x, bounds.y, &low, quiet);
        let right = bounds.right().saturating_sub(high.len() as u16);
        buffer.set_string(right, bounds.y, high, quiet);
        let Some(proposed) = proposed else { return };
        self.draw_line(buffer, proposed, theme, Role::Key);
        let now = number(proposed);
        let (first, last) = (bounds.x + low.len() as u16 + 1, right.saturating_sub(now.len() as u16 + 1));
        if first <= last {
            let x = self.column(proposed).saturating_sub(now.len() as u16 / 2).clamp(first, last);
            buffer.set_string(x, bounds.y, now, theme.style(Role::Key));
        }
    }

    /// Draws a line at a value of the parameter.
    pub fn draw_line(&self, buffer: &mut Buffer, value: f64, theme: &Theme, role: Role) {
        for y in self.plot.y..self.plot.bottom() {
            buffer.set_string(self.column(value), y, theme.bar(), theme.style(role));
        }
    }
}
