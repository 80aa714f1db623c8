//! Points that ran more than once: landed repeats of all, mean, standard deviation, and the confidence of the leading one.

use quadfrog::trial::PointRecord;
use ratatui::text::{Line, Span};

use super::draw::{number, span};
use crate::model::session::SessionModel;
use crate::theme::{Role, Theme};

/// Columns from which a line may name its numbers itself; others stand below a line that does.
pub const WORDS_FROM: usize = 40;

/// Columns of the number of a point, and of mean, standard deviation and the space behind them, in a narrow line.
const NUMBER_WIDTH: usize = 6;
const MEAN_WIDTH: usize = 13;

/// A line for each repeated point, best mean first, and whether each names its numbers itself: where all have room.
pub fn lines(session: &SessionModel, theme: &Theme, width: usize) -> (Vec<Line<'static>>, bool) {
    let mut points: Vec<&PointRecord> = session.trials.points.iter().filter(|point| !point.trials.is_empty()).collect();
    points.sort_by(|a, b| b.mean.total_cmp(&a.mean));
    let whole: Vec<_> = points.iter().map(|point| line(session, theme, point)).collect();
    match width >= WORDS_FROM && whole.iter().all(|line| line.width() <= width) {
        true => (whole, true),
        false => (points.iter().map(|point| narrow_line(session, theme, point)).collect(), false),
    }
}

/// The lines of [`lines`] below one that says what they are, and in few columns names their numbers; none without points.
pub fn titled_lines(session: &SessionModel, theme: &Theme, width: usize) -> Vec<Line<'static>> {
    let (lines, in_words) = lines(session, theme, width);
    if lines.is_empty() {
        return lines;
    }
    let title = match in_words {
        true => format!(" repeated points{}", star(session)),
        false => {
            // Without a confidence the line of the leading point says it.
            let leads = if session.trials.points.iter().any(|point| point.confidence.is_some()) { "leads" } else { "" };
            let mean = format!("mean, std {}", session.info.unit);
            let names = format!(" {:<NUMBER_WIDTH$}{:<7}{mean:<MEAN_WIDTH$}{leads}", "point", "landed");
            names.trim_end().to_owned()
        }
    };
    std::iter::once(Line::from(span(theme, Role::Quiet, title))).chain(lines).collect()
}

/// The lines as far as `rows` rows have room: whole points below the `titles` lines that name them, and the number of those that are
/// left out, with the place where they are, `elsewhere`.
pub fn within(
    lines: Vec<Line<'static>>,
    theme: &Theme,
    titles: usize,
    rows: usize,
    elsewhere: &str,
) -> Vec<Line<'static>> {
    if lines.len() <= rows {
        return lines;
    }
    let points = lines.len() - titles;
    // A row names those that are left out; the title stands over a point or not at all.
    let shown = rows.saturating_sub(titles + 1);
    let sign = match shown {
        0 => format!(" {points} points have no room{elsewhere}"),
        shown => format!(" {} more have no room{elsewhere}", points - shown),
    };
    let kept = if shown == 0 { 0 } else { titles + shown };
    lines.into_iter().take(kept).chain([Line::from(span(theme, Role::Quiet, sign))]).take(rows).collect()
}

/// Whether the best trial is one of the point.
fn has_best(session: &SessionModel, point: &PointRecord) -> bool {
    session.trials.best().is_some_and(|best| point.trials.contains(&best.trial))
}

/// The explanation of the star, where a point has it.
pub fn star(session: &SessionModel) -> &'static str {
    let starred = session.trials.points.iter().any(|point| has_best(session, point));
    if starred { "; *: that of the best" } else { "" }
}

/// The number of a point's first trial; `*` before that of the best.
fn first_trial(session: &SessionModel, point: &PointRecord) -> String {
    format!("{}#{}", if has_best(session, point) { "*" } else { " " }, point.trials.first().copied().unwrap_or(0))
}

/// A line below the names of its numbers.
fn narrow_line(session: &SessionModel, theme: &Theme, point: &PointRecord) -> Line<'static> {
    let first = first_trial(session, point);
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
        span(theme, Role::Quiet, format!("{first:<width$}", width = NUMBER_WIDTH + 1)),
        Span::raw(format!("{landed:<7}{mean}")),
        span(theme, Role::Quiet, format!("{spread:<room$}")),
        span(theme, Role::Good, confidence),
    ])
}

fn line(session: &SessionModel, theme: &Theme, point: &PointRecord) -> Line<'static> {
    let spread = point.deviation.map_or(String::new(), |sd| format!(" {}{}", theme.plus_minus(), number(sd)));
    let mut spans = vec![
        span(theme, Role::Quiet, format!("{:<6}", first_trial(session, point))),
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
