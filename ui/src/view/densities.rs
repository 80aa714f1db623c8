//! The reason for the proposed value of a parameter. TPE: the density of the good trials and that of the rest; it proposes where the
//! first is high and the second is low. A sampler with a model of the objective: its mean and standard deviation at the
//! points of the finished trials.

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::trial::{ParameterInfo, ParameterInsight, ProposalInsight};
use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::dots::DotGrid;
use super::draw::{cell_at, heading, heading_width, truncate};
use super::parameter_axes::ParameterAxes;
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};

pub fn render(frame: &mut Frame, area: Rect, session: &SessionModel, info: &ParameterInfo, theme: &Theme) {
    // A finished study that is continued has none of a proposal.
    let of_proposal = |insight: &&ProposalInsight| !insight.parameters.is_empty() || !insight.predicted.is_empty();
    let insight = session.insight.as_ref().filter(of_proposal);
    let modelled = insight.is_some_and(|insight| !insight.predicted.is_empty());
    let parameter = insight.and_then(|insight| insight.parameters.iter().find(|p| p.name == info.name));
    let aside = parameter.map_or(String::new(), importance);
    let titles = titles(insight, modelled, session.info.sampler, &info.name);
    let fits = |(least, title): &&(u16, String)| {
        *least <= area.width && heading_width(title, &aside) <= usize::from(area.width)
    };
    let title = titles.iter().find(fits).map_or(&info.name, |(_, title)| title);
    let body = heading(frame, area, theme, title, &aside);
    let drawn = match insight {
        Some(insight) if modelled => render_prediction(frame, body, session, insight, info, theme),
        _ => parameter.is_some_and(|parameter| render_densities(frame, body, session, parameter, info, theme)),
    };
    if !drawn && body.height > 0 {
        let reason = match (insight, &session.insight) {
            (Some(_), _) => "drawn without a model",
            (None, Some(_)) => "no proposal in this session",
            (None, None) => "no proposal yet",
        };
        let text = truncate(reason, usize::from(body.width));
        frame.buffer_mut().set_string(body.x, body.y, text, theme.style(Role::Quiet));
    }
}

/// The importance of a parameter in words; empty where it is not known.
fn importance(parameter: &ParameterInsight) -> String {
    parameter.importance.map_or(String::new(), |share| format!("importance {:.0} %", share * 100.0))
}

/// Whether a panel of `width` columns names the importance of a parameter.
pub fn has_importance(parameter: &ParameterInsight, width: u16) -> bool {
    let aside = importance(parameter);
    !aside.is_empty() && heading_width(&parameter.name, &aside) <= usize::from(width)
}

/// The titles, the longest first, each with the columns from which it is taken.
fn titles(
    insight: Option<&ProposalInsight>,
    modelled: bool,
    sampler: Option<SamplerKind>,
    name: &str,
) -> Vec<(u16, String)> {
    let is_tpe = sampler.is_none_or(|kind| kind == SamplerKind::Tpe);
    let of = if is_tpe { "TPE" } else { sampler.map_or("", SamplerKind::name) };
    let short = |of: &str| (0, format!("{of} {name}"));
    match insight.map(|insight| insight.trial) {
        Some(trial) if modelled => vec![
            (58, format!("Predicted J over {name} (#{trial}): mean and deviation")),
            (36, format!("Predicted J over {name}")),
            short("Model"),
        ],
        Some(trial) => {
            let long = if is_tpe { "TPE densities of" } else { of };
            vec![(58, format!("{long} {name} (#{trial})")), (36, format!("{of} {name} (#{trial})")), short(of)]
        }
        None => vec![short(of)],
    }
}

/// Mean and one standard deviation to both sides at each finished trial's value of the parameter.
fn render_prediction(
    frame: &mut Frame,
    area: Rect,
    session: &SessionModel,
    insight: &ProposalInsight,
    info: &ParameterInfo,
    theme: &Theme,
) -> bool {
    let ends = insight.predicted.iter().flat_map(|p| [p.value - p.deviation, p.value + p.deviation]);
    let (low, high) = ends.fold((0.0_f64, 1e-3_f64), |(low, high), value| (low.min(value), high.max(value)));
    let Some(axes) = ParameterAxes::new(info, area, (low, high)) else { return false };
    let buffer = frame.buffer_mut();
    if let Some(parameter) = insight.parameters.iter().find(|p| p.name == info.name) {
        draw_proposed(buffer, &axes, session, parameter, theme);
    } else {
        axes.draw(buffer, None, theme);
    }
    let points = || {
        insight.predicted.iter().filter_map(|predicted| {
            let trial = session.trials.records.get(&predicted.trial)?;
            Some((axes.column(trial.parameters.get(&info.name)?), predicted))
        })
    };
    for (column, predicted) in points() {
        for y in axes.row(predicted.value + predicted.deviation)..=axes.row(predicted.value - predicted.deviation) {
            buffer.set_string(column, y, theme.bar(), theme.style(Role::Quiet));
        }
    }
    // The best by the model last: its repeats lie at the same place.
    for best in [false, true] {
        for (column, predicted) in points().filter(|(_, p)| (insight.best == Some(p.trial)) == best) {
            let symbol = if best { "*" } else { "o" };
            buffer.set_string(column, axes.row(predicted.value), symbol, theme.style(Role::SeriesA));
        }
    }
    true
}

/// The axes with the value that the sampler proposed, and that of an override as the proposal beside it.
fn draw_proposed(
    buffer: &mut Buffer,
    axes: &ParameterAxes,
    session: &SessionModel,
    sampled: &ParameterInsight,
    theme: &Theme,
) {
    let overridden = session.override_of(sampled);
    if overridden.is_some() {
        axes.draw_line(buffer, sampled.proposed, theme, Role::Quiet);
    }
    axes.draw(buffer, overridden.or(Some(sampled.proposed)), theme);
}

fn render_densities(
    frame: &mut Frame,
    area: Rect,
    session: &SessionModel,
    insight: &ParameterInsight,
    info: &ParameterInfo,
    theme: &Theme,
) -> bool {
    if insight.at.len() < 2 {
        return false;
    }
    let top = insight.good.iter().chain(&insight.bad).copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let Some(axes) = ParameterAxes::new(info, area, (0.0, top)) else { return false };
    let (buffer, plot) = (frame.buffer_mut(), axes.plot);
    // Before the first trials both equal the prior.
    let equal = insight.good.iter().zip(&insight.bad).all(|(good, rest)| (good - rest).abs() <= 1e-9 * top);
    let curves = [(&insight.bad, Role::SeriesB, "r"), (&insight.good, Role::Good, if equal { "g=r" } else { "g" })];
    for (density, role, _) in curves {
        let mut dots = DotGrid::new(plot, theme.glyphs);
        let (across, down) = (dots.size.0 as f64 - 1.0, dots.size.1 as f64 - 1.0);
        let place = |(x, y): (f64, f64)| (axes.share(x) * across, (1.0 - y / top) * down);
        let points: Vec<(f64, f64)> = insight.at.iter().copied().zip(density.iter().copied()).map(place).collect();
        points.windows(2).for_each(|pair| dots.line(pair[0], pair[1]));
        dots.draw(buffer, plot, theme.style(role));
    }
    draw_proposed(buffer, &axes, session, insight, theme);
    // A letter at each curve's peak distinguishes the curves without colours; the legend explains the letters.
    for (density, role, letter) in curves {
        let Some((x, y)) = insight.at.iter().zip(density).max_by(|a, b| a.1.total_cmp(b.1)) else { continue };
        let column = axes.column(*x).min(plot.right().saturating_sub(letter.len() as u16));
        buffer.set_string(column, plot.y + cell_at(1.0 - y / top, plot.height), letter, theme.style(role));
    }
    true
}
