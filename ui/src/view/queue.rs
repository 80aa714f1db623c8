//! The queue: points that run before the sampler's.

use quadfrog::trial::{QueuedPoint, six_digits};
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
        let [point, rerun] = [Action::QueuePoint, Action::Rerun].map(|action| model.keymap.key(action));
        let texts = [
            "Nothing is queued: the sampler proposes.".to_owned(),
            String::new(),
            format!("{point} in Override queues the point of the form."),
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
    let values = point.parameters.iter().chain(point.gains.iter());
    let values: Vec<_> = values.map(|(name, value)| format!("{name} {}", six_digits(*value))).collect();
    let values = if values.is_empty() { "parameters from the sampler".to_owned() } else { values.join(", ") };
    format!("#{:<4} {source:<15} {values}", point.trial)
}
