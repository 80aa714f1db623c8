//! The last line: the next step and as many keys as have room.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::draw::{columns as columns_of, span, truncate};
use super::next_step::with_row;
use crate::action::Action;
use crate::model::dialog::Dialog;
use crate::model::{Model, View};
use crate::theme::Role;

pub(super) fn render(frame: &mut Frame, area: Rect, model: &Model) {
    frame.render_widget(line_within(model, usize::from(area.width), true), area);
}

/// Returns the next step, whole, and as many other keys as `width` columns have room for; the key of the help stands for the
/// others. Where the terminal does not show the open view, the keys of its rows are left out.
pub(super) fn line_within(model: &Model, width: usize, view_is_shown: bool) -> Line<'static> {
    let theme = &model.theme;
    let mut next = with_row(model, view_is_shown);
    let columns = |(key, text): &(String, String)| key.chars().count() + text.chars().count() + 4;
    // In Trials the keys of the row are worth more than the words of the step.
    let whole = 1 + columns_of(&next.lead) + next.others.iter().map(columns).sum::<usize>();
    if model.view == View::Trials && !next.short.is_empty() && whole > width {
        next.lead = std::mem::take(&mut next.short);
    }
    let room = width.saturating_sub(columns_of(&next.lead) + 1);
    let more = (model.keymap.key(Action::Help), "more".to_owned());
    let mut shown = next.others;
    let width_of = |shown: &[(String, String)]| shown.iter().map(columns).sum::<usize>();
    if width_of(&shown) > room {
        // The first key is worth more than the one of the help.
        while shown.len() > 1 && width_of(&shown) + columns(&more) > room {
            shown.pop();
        }
        if width_of(&shown) + columns(&more) <= room {
            shown.push(more);
        } else if width_of(&shown) > room {
            shown = vec![more];
        }
        shown.retain(|key| columns(key) <= room);
    }
    let lead = match &model.dialog {
        Some(dialog) => {
            let asks = !dialog.only_shows() && !matches!(dialog, Dialog::Override(_) | Dialog::Palette { .. });
            without_parts(&next.lead, width.saturating_sub(1), asks)
        }
        None => next.lead,
    };
    let lead = truncate(&lead, width.saturating_sub(1));
    let mut spans = vec![Span::raw(" "), span(theme, Role::Key, lead)];
    for (key, text) in shown {
        spans.extend([
            span(theme, Role::Quiet, format!(" {} ", theme.dot())),
            span(theme, Role::Key, key),
            span(theme, Role::Quiet, format!(" {text}")),
        ]);
    }
    Line::from(spans)
}

/// The step of a dialog within `width` columns: whole sentences after the first one go, of a question the last one, else those
/// before the last one; then whole keys before the last one.
fn without_parts(lead: &str, width: usize, asks: bool) -> String {
    let fits = |text: &str| columns_of(text.trim_end()) <= width;
    let mut sentences: Vec<&str> = lead.split_inclusive(". ").collect();
    while sentences.len() > 2 && !fits(&sentences.concat()) {
        sentences.remove(sentences.len() - if asks { 1 } else { 2 });
    }
    let last = sentences.pop().unwrap_or_default();
    let before = sentences.concat();
    let mut keys: Vec<&str> = last.split(", ").collect();
    while keys.len() > 1 && !asks && !fits(&format!("{before}{}", keys.join(", "))) {
        keys.remove(keys.len() - 2);
    }
    (before + &keys.join(", ")).trim_end().to_owned()
}
