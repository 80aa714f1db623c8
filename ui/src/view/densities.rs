//! TPE's two densities along a parameter, l(x) of the good trials and g(x) of the others, with the proposed value: TPE
//! proposes where l is high and g is low.

use quadfrog::trial::ProposalInsight;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};

use super::dots::DotGrid;
use super::draw::{cell_at, heading, number, truncate};
use crate::theme::{Role, Theme};

pub fn render(frame: &mut Frame, area: Rect, insight: Option<&ProposalInsight>, name: &str, theme: &Theme) {
    let title = match insight {
        Some(insight) if area.width >= 58 => format!("TPE density of {name} (#{}): l good, g rest", insight.trial),
        Some(insight) if area.width >= 36 => format!("TPE {name} (#{})", insight.trial),
        _ => format!("TPE {name}"),
    };
    let reason = match insight {
        Some(insight) if !insight.predicted.is_empty() => "the sampler's model has no densities",
        Some(_) => "sampled without a model",
        None => "no proposal yet",
    };
    let insight = insight.and_then(|insight| insight.parameters.iter().find(|p| p.name == *name));
    let importance = insight.and_then(|insight| insight.importance);
    let aside = importance.map_or(String::new(), |share| format!("importance {:.0} %", share * 100.0));
    let body = heading(frame, area, theme, &title, &aside);
    let [plot, scale] = Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(body);
    if plot.height < 2 || plot.width < 8 {
        return;
    }
    let Some(insight) = insight.filter(|insight| insight.at.len() > 1) else {
        let text = truncate(reason, usize::from(plot.width));
        frame.buffer_mut().set_string(plot.x, plot.y, text, theme.style(Role::Quiet));
        return;
    };
    let (low, high) = (insight.at[0], insight.at[insight.at.len() - 1]);
    let top = insight.good.iter().chain(&insight.bad).copied().fold(0.0, f64::max);
    let buffer = frame.buffer_mut();
    // Before the first trials both equal the prior.
    let equal = insight.good.iter().zip(&insight.bad).all(|(l, g)| (l - g).abs() <= 1e-9 * top);
    let good_label = if equal { "l = g" } else { "l" };
    let curves = [(&insight.bad, Role::SeriesB, "g"), (&insight.good, Role::Good, good_label)];
    for (density, role, _) in curves {
        let mut dots = DotGrid::new(plot, theme.glyphs);
        let (across, down) = (dots.size.0 as f64 - 1.0, dots.size.1 as f64 - 1.0);
        let place = |(x, y): (f64, f64)| ((x - low) / (high - low) * across, (1.0 - y / top) * down);
        let points: Vec<(f64, f64)> = insight.at.iter().copied().zip(density.iter().copied()).map(place).collect();
        if top > 0.0 {
            points.windows(2).for_each(|pair| dots.line(pair[0], pair[1]));
        }
        dots.draw(buffer, plot, theme.style(role));
    }
    let column = cell_at((insight.proposed - low) / (high - low), plot.width);
    for y in plot.y..plot.bottom() {
        buffer.set_string(plot.x + column, y, theme.bar(), theme.style(Role::Key));
    }
    // A letter at each curve's peak distinguishes the curves without colours.
    for (density, role, label) in curves {
        let Some((x, y)) = insight.at.iter().zip(density).max_by(|a, b| a.1.total_cmp(b.1)) else { continue };
        let column = cell_at((x - low) / (high - low), plot.width).min(plot.width.saturating_sub(label.len() as u16));
        let row = cell_at(1.0 - y / top.max(f64::MIN_POSITIVE), plot.height);
        buffer.set_string(plot.x + column, plot.y + row, label, theme.style(role));
    }
    let (left, right) = (number(low), number(high));
    buffer.set_string(scale.x, scale.y, &left, theme.style(Role::Quiet));
    let at = scale.right().saturating_sub(right.len() as u16);
    buffer.set_string(at, scale.y, &right, theme.style(Role::Quiet));
    let now = number(insight.proposed);
    let free = scale.width.saturating_sub((left.len() + right.len() + now.len()) as u16 + 2);
    if free > 0 {
        let x = (scale.x + column).saturating_sub(now.len() as u16 / 2);
        let x = x.clamp(scale.x + left.len() as u16 + 1, at.saturating_sub(now.len() as u16 + 1));
        buffer.set_string(x, scale.y, now, theme.style(Role::Key));
    }
}
