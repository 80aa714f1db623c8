//! View 4, Override: the proposal, its bounds and what can be done about it.
//!
//! ```text
//! Proposal of trial 8, by the sampler ───────────────────── o change   O back   n skip
//!   f0    1.243 Hz     0.750 [-----o-----] 1.750
//! > Fx    120.0 N      0.000 [--------o--] 150.0    was 118.2
//! ```

use quadfrog::recording::record::Proposal;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{heading, number, proposal, span};
use crate::action::Action;
use crate::model::Model;
use crate::theme::Role;

/// Draws the view.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    let key = |action| model.keymap.key(action);
    let keys = format!(
        "{} change, {} back to the proposed, {} skip",
        key(Action::Override),
        key(Action::ClearOverrides),
        key(Action::Skip)
    );
    let (title, mut lines) = match model.proposal_on_table() {
        Some(proposal) => (format!("Trial #{}, by: {}", proposal.trial, proposal.source.name()), rows(model, proposal)),
        None => ("Parameters".to_owned(), bounds(model)),
    };
    let body = heading(frame, area, theme, &title, &keys);
    if let Err(reason) = Action::Override.legal(model) {
        lines.push(Line::default());
        lines.push(Line::from(span(theme, Role::Quiet, format!("  Nothing can be changed now: {reason}."))));
    }
    frame.render_widget(Paragraph::new(lines), body);
}

fn rows(model: &Model, on_table: &Proposal) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let mut lines = Vec::new();
    for (index, p) in on_table.parameters.iter().enumerate() {
        let Some(info) = model.parameter(&p.name) else { continue };
        let selected = index == model.override_row;
        let mut spans = vec![
            span(
                theme,
                if selected { Role::Key } else { Role::Text },
                format!("{} {:<5}", if selected { ">" } else { " " }, p.name),
            ),
            Span::raw(format!("{:>8} {:<4}", number(p.value), info.unit)),
            span(theme, Role::Quiet, format!("{:>8} ", number(info.low))),
            span(theme, Role::Quiet, proposal::place(theme, p.value, info.low, info.high, 30)),
            span(theme, Role::Quiet, format!(" {:<8}", number(info.high))),
        ];
        if p.value != p.proposed {
            spans.push(span(theme, Role::Warning, format!("proposed was {}", number(p.proposed))));
        }
        lines.push(Line::from(spans));
    }
    lines
}

fn bounds(model: &Model) -> Vec<Line<'static>> {
    let line = |info: &quadfrog::recording::record::ParameterInfo| {
        Line::from(format!("  {:<5} {} to {} {}", info.name, number(info.low), number(info.high), info.unit))
    };
    model.session.parameters.iter().map(line).collect()
}
