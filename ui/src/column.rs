//! The columns of the trial table: which there are, what they are called in `console.toml`, and how they sort.

use std::cmp::Ordering;

use quadfrog::trial::{TrialRecord, Verdict};

use crate::model::Model;

/// A column, or the group of the parameters' columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Column {
    /// One column for each parameter.
    Parameters,
    /// Forward displacement, m.
    Dx,
    /// Displacement to the left, m.
    Dy,
    /// Turn, rad.
    Yaw,
    /// Rise of the trunk, m.
    Apex,
    /// Longest time in the air, s.
    Air,
    /// The objective that the sampler is told.
    Value,
    /// The verdict, or what the rules suggest.
    Verdict,
    /// Who chose the parameters.
    Source,
    /// Falls among the nearest trials when it was approved.
    Risk,
    /// When it ran, on the session's clock.
    Time,
    /// Cause and note.
    Cause,
}

impl Column {
    /// All columns, from left to right.
    pub const ALL: [Column; 12] = [
        Column::Parameters,
        Column::Dx,
        Column::Dy,
        Column::Yaw,
        Column::Apex,
        Column::Air,
        Column::Value,
        Column::Verdict,
        Column::Source,
        Column::Risk,
        Column::Time,
        Column::Cause,
    ];

    /// Its name in `console.toml` and in the dialog.
    pub const fn name(self) -> &'static str {
        match self {
            Column::Parameters => "parameters",
            Column::Dx => "dx",
            Column::Dy => "dy",
            Column::Yaw => "yaw",
            Column::Apex => "apex",
            Column::Air => "air",
            Column::Value => "value",
            Column::Verdict => "verdict",
            Column::Source => "source",
            Column::Risk => "risk",
            Column::Time => "time",
            Column::Cause => "cause",
        }
    }

    /// What it holds, in words.
    pub const fn help(self) -> &'static str {
        match self {
            Column::Parameters => "one column for each parameter",
            Column::Dx => "displacement forward, m",
            Column::Dy => "displacement to the left, m",
            Column::Yaw => "turn, rad",
            Column::Apex => "rise of the trunk, m",
            Column::Air => "longest time in the air, s",
            Column::Value => "the objective that the sampler is told",
            Column::Verdict => "the verdict, or what the rules suggest",
            Column::Source => "who chose the parameters",
            Column::Risk => "falls among the nearest trials before it ran",
            Column::Time => "when it ran, since the session began",
            Column::Cause => "cause and note",
        }
    }

    /// The column of that name.
    pub fn from_name(name: &str) -> Option<Column> {
        Column::ALL.into_iter().find(|column| column.name() == name)
    }
}

/// What the trial table is sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SortBy {
    /// Number, oldest first.
    #[default]
    Number,
    /// A parameter, by its place in the session's list.
    Parameter(usize),
    /// A column other than the parameters.
    Column(Column),
}

/// The measured term of a column, where it is one.
pub fn measured(trial: &TrialRecord, column: Column) -> Option<f64> {
    let m = trial.measured?;
    match column {
        Column::Dx => Some(m.dx_m),
        Column::Dy => Some(m.dy_m),
        Column::Yaw => Some(m.dyaw_rad),
        Column::Apex => Some(m.apex_m),
        Column::Air => Some(m.air_s),
        _ => None,
    }
}

/// Larger numbers first; what is no number, or none, comes last.
pub fn descending(a: Option<f64>, b: Option<f64>) -> Ordering {
    let (a, b) = (a.filter(|a| !a.is_nan()), b.filter(|b| !b.is_nan()));
    match (a, b) {
        (Some(a), Some(b)) => b.total_cmp(&a),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

/// The order of verdicts: accept, fall, void, none yet.
pub fn verdict_rank(verdict: Option<Verdict>) -> usize {
    verdict.and_then(|verdict| Verdict::ALL.iter().position(|v| *v == verdict)).unwrap_or(Verdict::ALL.len())
}

impl Model {
    /// The rows of the trial table as sorted and filtered.
    pub fn table(&self) -> Vec<&TrialRecord> {
        let view = &self.trials_view;
        let mut rows: Vec<&TrialRecord> = if view.best_only {
            self.best_so_far().collect()
        } else {
            self.trials.values().filter(|trial| view.filter.is_none() || trial.verdict == view.filter).collect()
        };
        let order = |a: &&TrialRecord, b: &&TrialRecord| match view.sort {
            SortBy::Number => descending(Some(f64::from(b.trial)), Some(f64::from(a.trial))),
            SortBy::Parameter(index) => descending(self.nth_parameter(a, index), self.nth_parameter(b, index)),
            SortBy::Column(Column::Verdict) => verdict_rank(a.verdict).cmp(&verdict_rank(b.verdict)),
            SortBy::Column(Column::Source | Column::Parameters) => a.source.name().cmp(b.source.name()),
            SortBy::Column(Column::Cause) => a.cause.cmp(&b.cause),
            SortBy::Column(Column::Value) => descending(a.value, b.value),
            SortBy::Column(Column::Risk) => descending(risk_share(a), risk_share(b)),
            SortBy::Column(Column::Time) => {
                let begun = |trial: &TrialRecord| self.ran.get(&trial.trial).map(|ran| -(ran.begun_ns as f64));
                descending(begun(a), begun(b))
            }
            SortBy::Column(column) => descending(measured(a, column), measured(b, column)),
        };
        rows.sort_by(order);
        if view.reversed {
            // Rows that have nothing to be sorted by stay last.
            let sorted_ones = rows.iter().take_while(|row| self.sorts(row)).count();
            rows[..sorted_ones].reverse();
        }
        rows
    }

    fn nth_parameter(&self, trial: &TrialRecord, index: usize) -> Option<f64> {
        let name = &self.session.parameters.get(index)?.name;
        trial.parameters.get(name)
    }

    /// Whether the row has what the table is sorted by.
    fn sorts(&self, trial: &TrialRecord) -> bool {
        match self.trials_view.sort {
            SortBy::Number => true,
            SortBy::Parameter(index) => self.nth_parameter(trial, index).is_some(),
            SortBy::Column(Column::Value) => trial.value.is_some_and(|value| !value.is_nan()),
            SortBy::Column(Column::Verdict) => trial.verdict.is_some(),
            SortBy::Column(Column::Risk) => risk_share(trial).is_some(),
            SortBy::Column(Column::Time) => self.ran.contains_key(&trial.trial),
            SortBy::Column(Column::Source | Column::Parameters | Column::Cause) => true,
            SortBy::Column(column) => measured(trial, column).is_some(),
        }
    }
}

/// Share of falls among the nearest trials before it ran.
fn risk_share(trial: &TrialRecord) -> Option<f64> {
    let risk = trial.risk.filter(|risk| risk.neighbours > 0)?;
    Some(f64::from(risk.falls) / f64::from(risk.neighbours))
}
