//! The queue: points that run before the sampler's.

use std::ops::Range;

use quadfrog::trial::{ExperimentStage, Proposal, ProposedParameter, QueuedPoint};
use ratatui::text::Line;

use super::draw::span;
use crate::action::Action;
use crate::legal::may_request;
use crate::model::Model;
use crate::theme::Role;
use crate::wrap::{unbroken, wrap, wrap_all};

/// Columns before the words of a point.
const INDENT: usize = 7;

/// Returns the lines of the queued points, each wrapped to `width` columns, and the lines of the `selected` one, which is marked; for
/// an empty queue how to fill it. Of a finished study they say what makes the points run.
pub fn lines(model: &Model, selected: usize, width: usize) -> (Vec<Line<'static>>, Range<usize>) {
    let theme = &model.theme;
    let key = |action| model.keymap.key(action);
    let quiet = |texts: Vec<String>| {
        let lines: Vec<_> = texts.into_iter().map(|text| Line::from(span(theme, Role::Quiet, text))).collect();
        wrap_all(&lines, width, 0)
    };
    let queue = model.session.queue();
    let finished = model.session.stage_is(ExperimentStage::Finished);
    let rerun = format!("{} in Trials queues the selected trial again.", key(Action::Rerun));
    if queue.is_empty() && may_request(model).is_err() {
        return (quiet(vec!["Nothing is queued.".to_owned()]), 0..0);
    }
    if queue.is_empty() {
        let more = key(Action::Continue);
        let texts = match finished {
            true => vec![format!("Nothing is queued: the study is finished, and {more} gives it more trials."), rerun],
            false => vec![
                "Nothing is queued: the sampler proposes.".to_owned(),
                String::new(),
                format!(
                    "{} queues the values of the proposal; in the form of {} those of the form.",
                    key(Action::QueuePoint),
                    key(Action::Override)
                ),
                rerun,
            ],
        };
        return (quiet(texts), 0..0);
    }
    let mut lines = match finished {
        true => quiet(vec![format!(
            "The study is finished: these run once {} gives it more trials.",
            key(Action::Continue)
        )]),
        false => Vec::new(),
    };
    let mut of_selected = 0..0;
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

/// Returns the point that the open proposal runs in place of the queued one: with the operator's changes.
fn proposed(proposal: &Proposal) -> QueuedPoint {
    let value = |p: &ProposedParameter| (p.name.clone(), p.value);
    QueuedPoint {
        trial: proposal.trial,
        source: proposal.source,
        parent: proposal.parent,
        parameters: proposal.parameters.iter().map(value).collect(),
        gains: proposal.changed_gains().map(value).collect(),
    }
}

/// Returns a point in words, with the digits and units of the card: `#8  re-run of #3  f0 1.300 Hz, Fx 90.00 N, Fz 240.0 N`.
fn described(model: &Model, point: &QueuedPoint) -> String {
    let info = &model.session.info;
    let changed = model.session.open_proposal().filter(|proposal| proposal.trial == point.trial).map(proposed);
    let point = changed.as_ref().unwrap_or(point);
    let source = point.source.with_parent(point.parent);
    let words = point.in_words(info.parameters.iter().chain(&info.gains));
    // A number stays on the line of its unit.
    let words: Vec<String> = words.split(", ").map(unbroken).collect();
    format!("#{:<4} {source:<15} {}", point.trial, words.join(", "))
}
