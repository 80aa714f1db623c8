//! The queue: points that run before the sampler's.

use std::ops::Range;

use quadfrog::trial::QueuedPoint;
use ratatui::text::Line;

use super::draw::span;
use crate::action::Action;
use crate::model::Model;
use crate::theme::Role;
use crate::wrap::{unbroken, wrap, wrap_all};

/// Columns before the words of a point.
const INDENT: usize = 7;

/// Returns the lines of the queued points, each wrapped to `width` columns, and the lines of the `selected` one, which is marked; for
/// an empty queue how to fill it.
pub fn lines(model: &Model, selected: usize, width: usize) -> (Vec<Line<'static>>, Range<usize>) {
    let theme = &model.theme;
    let queue = model.session.queue();
    if queue.is_empty() {
        let [point, rerun, form] =
            [Action::QueuePoint, Action::Rerun, Action::Override].map(|action| model.keymap.key(action));
        let texts = [
            "Nothing is queued: the sampler proposes.".to_owned(),
            String::new(),
            format!("{point} queues the values of the proposal; in the form of {form} those of the form."),
            format!("{rerun} in Trials queues the selected trial again."),
        ];
        let lines = texts.map(|text| Line::from(span(theme, Role::Quiet, text)));
        return (wrap_all(&lines, width, 0), 0..0);
    }
    let (mut lines, mut of_selected) = (Vec::new(), 0..0);
    for (index, point) in queue.iter().enumerate() {
        let role = if index == selected { Role::Selected } else { Role::Text };
        let begin = lines.len();
        for row in wrap(&Line::from(described(model, point)), width, INDENT) {
            lines.push(Line::from(span(theme, role, format!("{:<width$}", row.to_string()))));
        }
        if index == selected {
            of_selected = begin..lines.len();
        }
    }
    (lines, of_selected)
}

/// Returns a point in words, with the digits and units of the card: `#8  re-run of #3  f0 1.300 Hz, Fx 90.00 N, Fz 240.0 N`.
fn described(model: &Model, point: &QueuedPoint) -> String {
    let info = &model.session.info;
    let source = point.source.with_parent(point.parent);
    let words = point.in_words(info.parameters.iter().chain(&info.gains));
    // A number stays on the line of its unit.
    let words: Vec<String> = words.split(", ").map(unbroken).collect();
    format!("#{:<4} {source:<15} {}", point.trial, words.join(", "))
}
