//! Movement within the views: rows, pages, the charts' cursor, freezing, zooming, sorting and filtering.

use quadfrog::recording::record::LogLevel;
use strum::VariantArray;

use super::request::reply;
use crate::action::Action;
use crate::column::Column;
use crate::model::live::Panel;
use crate::model::table_columns::{CellContent, shown_columns};
use crate::model::trials::{SortBy, TrialFilter};
use crate::model::{Model, View};
use crate::series::{SETS, Series};
use crate::settings::ChartMode;

/// Moves through the rows of the open view; `isize::MIN` and `MAX` go to the ends.
pub(super) fn move_by(model: &mut Model, step: isize) {
    match model.view {
        View::Trials | View::Live => {
            let rows: Vec<u32> = model.trial_rows().iter().map(|trial| trial.trial).collect();
            let Some(last) = rows.len().checked_sub(1) else { return };
            let selected = model.selected_trial().map(|trial| trial.trial);
            let at = selected.and_then(|n| rows.iter().position(|row| *row == n)).unwrap_or(last);
            let to = at.saturating_add_signed(step).min(last);
            // The newest row is followed, but not one after the playhead of a replay.
            let follow = to == last
                && !model.is_later(rows[to])
                && model.trial_table.sort == SortBy::Number
                && !model.trial_table.reversed;
            model.trial_table.selected = if follow { None } else { Some(rows[to]) };
        }
        View::Log => {
            let last = model.log_view.lines(&model.session.log).count().saturating_sub(1);
            model.log_view.back = match step {
                isize::MIN => last,
                isize::MAX => 0,
                step => model.log_view.back.saturating_add_signed(-step).min(last),
            };
        }
        View::Override => {
            let rows = model.session.info.parameters.len() + model.session.info.gains.len();
            let last = rows.saturating_sub(1);
            model.override_row = model.override_row.saturating_add_signed(step).min(last);
        }
        View::Optimizer | View::Health => {}
    }
}

/// Moves the charts' cursor; the first move freezes them.
pub(super) fn move_cursor(model: &mut Model, step: i64) {
    if model.view != View::Live {
        return;
    }
    if let Some(comparison) = &mut model.live.comparison {
        let (first, last) = comparison.span_ns();
        let step_ns = (last - first) as i64 / 100 * step;
        comparison.cursor_ns = comparison.cursor_ns.saturating_add_signed(step_ns).clamp(first, last);
        return;
    }
    if let Some(landed) = model.landed() {
        let cursor_ns = landed.moved_cursor_ns(model.live.landed_cursor_ns, step);
        model.live.landed_cursor_ns = Some(cursor_ns);
        return;
    }
    if model.live.frozen.is_none() {
        freeze(model);
    }
    // A hundredth of the window: about one character of a chart.
    let step_ns = (model.live.window_s * 1e7) as i64 * step;
    let newest = model.charted().newest_ns();
    let oldest = newest.saturating_sub((model.live.window_s * 1e9) as u64);
    model.live.cursor_ns = model.live.cursor_ns.saturating_add_signed(step_ns).clamp(oldest, newest);
}

/// Freezes the charts, or goes on with them. While a trial waits for its verdict: between that trial and the present.
pub(super) fn freeze(model: &mut Model) {
    let landed = model.landed().map(|landed| landed.trial);
    let reviewed = model.session.under_review().map(|row| row.trial);
    let key = model.keymap.key(Action::Freeze);
    if let Some(trial) = landed {
        model.live.present_in_review = true;
        reply(model, LogLevel::Info, format!("the charts show the present; {key} shows trial {trial} again"));
        return;
    }
    if model.live.present_in_review && model.live.frozen.is_none() && reviewed.is_some() {
        model.live.present_in_review = false;
        if let Some(trial) = model.landed().map(|landed| landed.trial) {
            reply(model, LogLevel::Info, format!("the charts show trial {trial}; {key} shows the present"));
            return;
        }
    }
    let text = match model.live.frozen.take() {
        Some(_) => "the charts show the present".to_owned(),
        None => {
            model.live.cursor_ns = model.history.newest_ns();
            model.live.frozen = Some((model.history.clone(), model.clock));
            format!("the charts are frozen; {key} shows the present")
        }
    };
    reply(model, LogLevel::Info, text);
}

pub(super) fn zoom(model: &mut Model, factor: f64) {
    if let Some(trial) = model.landed().map(|landed| landed.trial) {
        let key = model.keymap.key(Action::Freeze);
        let text = format!("trial {trial} is fitted to the charts; {key} returns to the present, which can be zoomed");
        reply(model, LogLevel::Info, text);
        return;
    }
    model.live.window_s = (model.live.window_s * factor).clamp(1.0, 60.0);
}

/// The next set of series: attitude and feet, forces, motion of the trunk, torques of the joints, the operator's own choice, and
/// the joints in numbers.
pub(super) fn next_series(model: &mut Model) {
    let live = &mut model.live;
    let sets: Vec<&[Series]> = SETS.into_iter().chain(live.chosen_series.as_deref()).collect();
    let shown = sets.iter().position(|set| live.series == *set);
    let next = match (live.panel, shown) {
        (Panel::Charts, Some(set)) => sets.get(set + 1),
        (Panel::Joints, _) => {
            live.panel = Panel::Robot;
            return;
        }
        _ => sets.first(),
    };
    match next {
        Some(set) => (live.panel, live.series) = (Panel::Charts, set.to_vec()),
        None => live.panel = Panel::Joints,
    }
}

pub(super) fn next_mode(model: &mut Model) {
    model.live.mode = match model.live.mode {
        ChartMode::Sweep => ChartMode::Scroll,
        ChartMode::Scroll => ChartMode::Sweep,
    };
}

/// Sorts by the next column that the terminal shows: number, value and verdict first, then the others from left to right.
pub(super) fn next_sort(model: &mut Model) {
    let view = &model.trial_table;
    let mut orders = vec![SortBy::Number];
    let columns = shown_columns(model, usize::from(model.size.0), true);
    let shown = |column: &Column| match column {
        Column::Parameters => columns.iter().any(|column| matches!(column.cell, CellContent::Parameter(_))),
        column => columns.iter().any(|shown| matches!(shown.cell, CellContent::Of(of) if of == *column)),
    };
    let first = [Column::Value, Column::Verdict];
    orders.extend(first.into_iter().filter(shown).map(SortBy::Column));
    for column in Column::VARIANTS.iter().copied().filter(shown).filter(|column| !first.contains(column)) {
        match column {
            Column::Parameters => orders.extend((0..model.session.info.parameters.len()).map(SortBy::Parameter)),
            column => orders.push(SortBy::Column(column)),
        }
    }
    let at = orders.iter().position(|order| *order == view.sort).unwrap_or(0);
    model.trial_table.sort = orders[(at + 1) % orders.len()];
    model.trial_table.reversed = false;
}

pub(super) fn filter(model: &mut Model) {
    if model.view == View::Log {
        model.log_view.back = 0;
        model.log_view.level = match model.log_view.level {
            None => Some(LogLevel::Warning),
            Some(LogLevel::Warning) => Some(LogLevel::Error),
            Some(_) => None,
        };
    } else {
        model.trial_table.filter = TrialFilter::next(model.trial_table.filter);
    }
}
