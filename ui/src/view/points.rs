//! Points that ran more than once: landed repeats of all, mean, standard deviation, and the confidence of the leading one.

use quadfrog::trial::PointRecord;
use ratatui::text::{Line, Span};

use super::draw::{number, span};
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};

/// Columns from which a line names its numbers itself; narrower ones stand below a line that does.
pub const WORDS_FROM: usize = 40;

/// Columns of mean, standard deviation and the space behind them in a narrow line.
const MEAN_WIDTH: usize = 14;

/// A line for each repeated point, best mean first; in few columns below a line that names the numbers.
pub fn lines(session: &SessionModel, theme: &Theme, width: usize) -> Vec<Line<'static>> {
    let mut points: Vec<&PointRecord> = session.trials.points.iter().filter(|point| !point.trials.is_empty()).collect();
    points.sort_by(|a, b| b.mean.total_cmp(&a.mean));
    if width >= WORDS_FROM {
        return points.into_iter().map(|point| line(session, theme, point)).collect();
    }
    let names = points.first().map(|_| {
        // Without a confidence the line of the leading point says it.
        let leads = if points.iter().any(|point| point.confidence.is_some()) { "leads" } else { "" };
        let mean = format!("mean, std {}", session.info.unit);
        let names = format!(" {:<4}{:<7}{mean:<MEAN_WIDTH$}{leads}", "#", "landed");
        Line::from(span(theme, Role::Quiet, names.trim_end()))
    });
    names.into_iter().chain(points.into_iter().map(|point| narrow_line(session, theme, point))).collect()
}

/// The lines of [`lines`] as far as `rows` rows have room: whole points below the names of their numbers, and the number of those
/// that are left out.
pub fn within(lines: Vec<Line<'static>>, theme: &Theme, width: usize, rows: usize) -> Vec<Line<'static>> {
    if lines.len() <= rows {
        return lines;
    }
    let names = usize::from(width < WORDS_FROM);
    let points = lines.len() - names;
    // A row names those that are left out; the names stand over a point or not at all.
    let shown = rows.saturating_sub(names + 1);
    let sign = match shown {
        0 => format!(" {points} points have no room"),
        shown => format!(" {} more have no room", points - shown),
    };
    let kept = if shown == 0 { 0 } else { names + shown };
    lines.into_iter().take(kept).chain([Line::from(span(theme, Role::Quiet, sign))]).take(rows).collect()
}

/// A line below the names of its numbers.
fn narrow_line(session: &SessionModel, theme: &Theme, point: &PointRecord) -> Line<'static> {
    let first = point.trials.first().map_or(String::new(), |trial| format!("#{trial}"));
    let landed = format!("{}/{}", point.without_fall, point.trials.len());
    let spread = point.deviation.map_or(String::new(), |sd| format!(" {}{}", theme.plus_minus(), number(sd)));
    let mean = number(point.mean);
    let room = MEAN_WIDTH.saturating_sub(mean.chars().count());
    let confidence = match point.confidence {
        Some(confidence) => format!("{:.0} %", confidence * 100.0),
        None if leads(session, point) => "leads".to_owned(),
        None => String::new(),
    };
    Line::from(vec![
        span(theme, Role::Quiet, format!(" {first:<4}")),
        Span::raw(format!("{landed:<7}{mean}")),
        span(theme, Role::Quiet, format!("{spread:<room$}")),
        span(theme, Role::Good, confidence),
    ])
}

fn line(session: &SessionModel, theme: &Theme, point: &PointRecord) -> Line<'static> {
    let first = point.trials.first().copied().unwrap_or(0);
    let spread = point.deviation.map_or(String::new(), |sd| format!(" {}{}", theme.plus_minus(), number(sd)));
    let mut spans = vec![
        span(theme, Role::Quiet, format!(" {:<5}", format!("#{first}"))),
        Span::raw(format!("{}/{} landed ", point.without_fall, point.trials.len())),
        Span::raw(format!(" {} {}", number(point.mean), session.info.unit)),
        span(theme, Role::Quiet, spread),
    ];
    if let Some(confidence) = point.confidence {
        spans.push(span(theme, Role::Good, format!("  leads, {:.0} %", confidence * 100.0)));
    } else if leads(session, point) {
        spans.push(span(theme, Role::Good, "  leads"));
    } else if point.contender {
        let state = if is_decided(session) { "  behind" } else { "  contends" };
        spans.push(span(theme, Role::Quiet, state));
    }
    Line::from(spans)
}

/// Whether it is the leading point of a confirmation.
fn leads(session: &SessionModel, point: &PointRecord) -> bool {
    session.leading_point().is_some_and(|leading| leading.trials == point.trials)
}

/// Whether the confirmation is over, or its leader is certain but for the rounding: no other point contends any longer.
fn is_decided(session: &SessionModel) -> bool {
    let certain = |point: &PointRecord| point.confidence.is_some_and(|confidence| confidence >= 0.995);
    session.confirming().is_none() || session.trials.points.iter().any(certain)
}

/// The repeats of a trial's point in words; none where it ran once.
pub fn repeats_of(session: &SessionModel, theme: &Theme, trial: u32) -> Option<String> {
    let point = session.trials.points.iter().find(|point| point.trials.contains(&trial) && point.trials.len() > 1)?;
    let spread = point.deviation.map_or(String::new(), |sd| format!(" {} {:.4}", theme.plus_minus(), sd));
    let trials: Vec<String> = point.trials.iter().map(|trial| format!("#{trial}")).collect();
    let (stood, of, unit) = (point.without_fall, point.trials.len(), &session.info.unit);
    Some(format!("{stood}/{of} landed, {:.4}{spread} {unit} ({})", point.mean, trials.join(" ")))
}
