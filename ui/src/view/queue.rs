//! The queue: points that run before the sampler's.

use quadfrog::trial::QueuedPoint;
use ratatui::text::Line;

use super::draw::{span, truncate};
use crate::action::Action;
use crate::model::Model;
use crate::theme::Role;

/// Returns a line for each queued point, `selected` marked, at most `width` columns wide; for an empty queue how to fill it.
pub fn lines(model: &Model, selected: usize, width: usize) -> Vec<Line<'static>> {
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
        return texts.map(|text| Line::from(span(theme, Role::Quiet, truncate(&text, width)))).to_vec();
    }
    let line = |(index, point): (usize, &QueuedPoint)| {
        let role = if index == selected { Role::Selected } else { Role::Text };
        Line::from(span(theme, role, format!("{:<width$}", truncate(&described(point), width))))
    };
    queue.iter().enumerate().map(line).collect()
}

/// Returns a point in words: `#8  re-run of #3  f0 1.3, Fx 90, Fz 240`.
fn described(point: &QueuedPoint) -> String {
    let source = point.source.with_parent(point.parent);
    format!("#{:<4} {source:<15} {}", point.trial, point.in_words())
}
