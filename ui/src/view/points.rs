//! Points that ran more than once: landed repeats of all, mean, standard deviation, and the confidence of the leading one.

use quadfrog::trial::PointRecord;
use ratatui::text::{Line, Span};

use super::draw::{number, span};
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};

/// A line for each repeated point, best mean first; narrow ones leave words out.
pub fn lines(session: &SessionModel, theme: &Theme, width: usize) -> Vec<Line<'static>> {
    let mut points: Vec<&PointRecord> = session.trials.points.iter().filter(|point| !point.trials.is_empty()).collect();
    points.sort_by(|a, b| b.mean.total_cmp(&a.mean));
    points.into_iter().map(|point| line(session, theme, point, width)).collect()
}

fn line(session: &SessionModel, theme: &Theme, point: &PointRecord, width: usize) -> Line<'static> {
    let first = point.trials.first().copied().unwrap_or(0);
    let spread = point.deviation.map_or(String::new(), |sd| format!(" {}{}", theme.plus_minus(), number(sd)));
    let landed = if width < 40 { "" } else { " landed" };
    let mut spans = vec![
        span(theme, Role::Quiet, format!(" {:<5}", format!("#{first}"))),
        Span::raw(format!("{}/{}{landed} ", point.without_fall, point.trials.len())),
        Span::raw(format!(" {} {}", number(point.mean), session.info.unit)),
        span(theme, Role::Quiet, spread),
    ];
    if let Some(confidence) = point.confidence {
        let leads = if width < 40 { " " } else { "  leads, " };
        spans.push(span(theme, Role::Good, format!("{leads}{:.0} %", confidence * 100.0)));
    } else if point.contender && width >= 40 {
        let state = if is_decided(session) { "  behind" } else { "  contends" };
        spans.push(span(theme, Role::Quiet, state));
    }
    Line::from(spans)
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
