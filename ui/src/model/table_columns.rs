//! The columns of the trial table that a width has room for.

use super::Model;
use crate::column::Column;

/// Columns of the longest source in the table and a space, because the words of the cause follow.
fn source_width(model: &Model) -> usize {
    let rows = model.session.trials.records.values().chain(model.later_trials());
    rows.map(|row| row.origin().chars().count() + 1).fold(9, usize::max)
}

/// A column with its title, its width in characters and its content.
#[derive(Debug)]
pub struct ShownColumn {
    /// Its heading, as wide as the column.
    pub title: String,
    /// Characters; `usize::MAX` before the rest of the line is given to it.
    pub width: usize,
    /// The content of its cells.
    pub cell: CellContent,
}

/// The content of the cells of a column.
#[derive(Debug)]
pub enum CellContent {
    /// The parameter of that name.
    Parameter(String),
    /// A quantity of the trial.
    Of(Column),
    /// The value by another configuration.
    NewValue,
    /// The verdict by another configuration.
    NewVerdict,
}

/// The columns as the operator has chosen them, as far as `width` characters take them; in the whole table with the new
/// judgements after the verdict.
pub fn shown_columns(model: &Model, width: usize, full: bool) -> Vec<ShownColumn> {
    let mut shown = Vec::new();
    for column in &model.trial_table.columns {
        let (title, width) = match column {
            Column::Parameters => {
                shown.extend(model.session.info.parameters.iter().map(|info| ShownColumn {
                    title: format!("{:>7}", format!("{} {}", info.name, info.unit)),
                    width: 7,
                    cell: CellContent::Parameter(info.name.clone()),
                }));
                continue;
            }
            Column::Dx | Column::Dy => (format!("{:>7}", format!("{} m", column.name())), 7),
            Column::Yaw => (format!("{:>7}", "yaw rad"), 7),
            Column::Rise => (format!("{:>7}", "rise m"), 7),
            Column::Air => (format!("{:>7}", "air s"), 7),
            Column::Value => (format!("{:>8}", format!("J {}", model.session.info.unit)), 9),
            Column::Verdict => ("  verdict".to_owned(), 10),
            Column::JudgedBy => ("judged by".to_owned(), 9),
            Column::Source => ("source".to_owned(), source_width(model)),
            Column::Risk => ("fell".to_owned(), 4),
            Column::Time => ("   ran".to_owned(), 7),
            Column::Cause => ("note | cause".to_owned(), usize::MAX),
        };
        shown.push(ShownColumn { title, width, cell: CellContent::Of(*column) });
    }
    if let Some(table) = model.rejudged.as_ref().filter(|_| full) {
        let verdict = |column: &ShownColumn| matches!(column.cell, CellContent::Of(Column::Verdict));
        let at = shown.iter().position(verdict).map_or(0, |at| at + 1);
        let value = format!("{:>9}", format!("new {}", table.unit));
        let new = [(value, CellContent::NewValue), ("  new".to_owned(), CellContent::NewVerdict)];
        let columns = new.map(|(title, cell)| ShownColumn { title, width: 9, cell });
        shown.splice(at..at, columns);
    }
    // The origin of the verdict gives way where the cause would be cut, and in a study of an earlier version, which has none.
    let judged = || model.session.trials.records.values().filter(|row| row.verdict.is_some() && !row.was_not_run());
    let origins = judged().count() == 0 || judged().any(|row| row.judged_by.is_some());
    let of_fixed_width: usize = shown.iter().filter(|c| c.width < usize::MAX).map(|c| c.width + 1).sum();
    let cause = shown.iter().any(|column| column.width == usize::MAX);
    let number_width = number_digits(model) + 2;
    let needed = number_width + of_fixed_width + if cause { LEAST_CAUSE } else { 0 };
    if !origins || needed > width {
        shown.retain(|column| !matches!(column.cell, CellContent::Of(Column::JudgedBy)));
    }
    let mut left = width.saturating_sub(number_width);
    for column in &mut shown {
        column.width = column.width.min(left);
        left = left.saturating_sub(column.width + 1);
    }
    shown.retain(|column| column.width >= column.title.trim().len().min(4));
    shown
}

/// Digits of the largest number of a trial, at least 3. The cursor stands before the number, a mark behind it.
pub fn number_digits(model: &Model) -> usize {
    let recorded = model.timeline.iter().flat_map(|timeline| timeline.rows.keys().next_back());
    let largest = model.session.trials.records.keys().next_back().into_iter().chain(recorded).max();
    largest.and_then(|trial| trial.checked_ilog10()).map_or(3, |power| (power as usize + 1).max(3))
}

/// Characters of note and cause beside the origin of the verdict at least.
const LEAST_CAUSE: usize = 60;
