//! A list of things that are switched on and off: the series of the charts, the columns of the trial table.

use crossterm::event::KeyCode;

use super::Dialog;
use crate::column::Column;
use crate::keymap::Key;
use crate::model::{Model, Panel};
use crate::series::SIGNALS;
use crate::update::Effect;

/// What a list of switches is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The series of the charts.
    Series,
    /// The columns of the trial table.
    Columns,
}

impl Choice {
    /// Each thing's name, what it is, and whether it is on.
    pub fn rows(self, model: &Model) -> Vec<(&'static str, &'static str, bool)> {
        match self {
            Choice::Series => {
                let on = |series| model.live.series.contains(&series);
                SIGNALS.iter().map(|signal| (signal.name, signal.unit, on(signal.series))).collect()
            }
            Choice::Columns => {
                let on = |column| model.trials_view.columns.contains(&column);
                Column::ALL.into_iter().map(|column| (column.name(), column.help(), on(column))).collect()
            }
        }
    }

    /// Switches one; the last one stays on. They keep the order of their table.
    fn toggle(self, model: &mut Model, index: usize) {
        match self {
            Choice::Series => {
                model.live.panel = Panel::Charts;
                toggle(&mut model.live.series, SIGNALS.map(|signal| signal.series), index);
            }
            Choice::Columns => toggle(&mut model.trials_view.columns, Column::ALL, index),
        }
    }
}

fn toggle<T: Copy + PartialEq, const N: usize>(on: &mut Vec<T>, all: [T; N], index: usize) {
    let Some(chosen) = all.get(index) else { return };
    let wanted = |item: &T| on.contains(item) != (item == chosen);
    let switched: Vec<T> = all.into_iter().filter(wanted).collect();
    if !switched.is_empty() {
        *on = switched;
    }
}

/// The list stays open while things are switched; what is switched shows at once.
pub(super) fn key(model: &mut Model, key: Key, what: Choice, mut selected: usize) -> Vec<Effect> {
    let last = what.rows(model).len().saturating_sub(1);
    match key.code() {
        KeyCode::Esc | KeyCode::Enter => return Vec::new(),
        KeyCode::Up => selected = selected.saturating_sub(1),
        KeyCode::Down => selected = (selected + 1).min(last),
        KeyCode::Home => selected = 0,
        KeyCode::End => selected = last,
        KeyCode::Left | KeyCode::Right | KeyCode::Char('x') => what.toggle(model, selected),
        _ => {}
    }
    model.dialog = Some(Dialog::Choose { what, selected });
    Vec::new()
}
