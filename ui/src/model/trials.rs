//! The trials of the study, and the table that shows them: columns, order, filter.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use quadfrog::trial::{ParameterInfo, PointRecord, TrialRecord, Verdict};

use crate::column::Column;

/// The trials of the study, as far as the session has reported them.
#[derive(Debug, Clone, Default)]
pub struct Trials {
    /// The newest record of each trial, by its number.
    pub records: BTreeMap<u32, TrialRecord>,
    /// Run times of the trials of this session.
    pub ran: BTreeMap<u32, RunTime>,
    /// Points that ran more than once.
    pub points: Vec<PointRecord>,
}

/// Run time of a trial, ns since the engine started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunTime {
    /// Its approval.
    pub begun_ns: u64,
    /// The end of its measurement; none while it runs.
    pub ended_ns: Option<u64>,
}

impl Trials {
    /// The newest trial.
    pub fn newest(&self) -> Option<&TrialRecord> {
        self.records.values().next_back()
    }

    /// The number of trials with that verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.records.values().filter(|trial| trial.verdict == Some(verdict)).count()
    }

    /// The best accepted trial: the highest mean over the repeats of its point, the earlier one of equals.
    pub fn best(&self) -> Option<&TrialRecord> {
        self.best_so_far().last()
    }

    /// The accepted trials that were better than all before them, in order.
    pub fn best_so_far(&self) -> impl Iterator<Item = &TrialRecord> + '_ {
        let mut best = f64::NEG_INFINITY;
        self.records.values().filter(move |trial| match self.mean_value(trial) {
            Some(value) if value > best => {
                best = value;
                true
            }
            _ => false,
        })
    }

    /// The value of an accepted trial: the mean over the repeats of its point.
    fn mean_value(&self, trial: &TrialRecord) -> Option<f64> {
        let value = accepted_value(trial)?;
        let point = self.points.iter().find(|point| point.trials.contains(&trial.trial));
        Some(point.map_or(value, |point| point.mean))
    }

    /// Attempts at the parameters of a trial up to it: 1, or one more than the trial that it repeats.
    pub fn attempt(&self, trial: &TrialRecord) -> usize {
        // Parents are older than their children, so the walk ends.
        let parent =
            |t: &&TrialRecord| t.parent.filter(|parent| *parent < t.trial).and_then(|parent| self.records.get(&parent));
        std::iter::successors(Some(trial), parent).count()
    }
}

/// The value of an accepted trial.
pub fn accepted_value(trial: &TrialRecord) -> Option<f64> {
    trial.value.filter(|_| trial.verdict == Some(Verdict::Accept))
}

/// The measured quantity of a column, where it is one.
pub fn measured(trial: &TrialRecord, column: Column) -> Option<f64> {
    let m = trial.measured?;
    match column {
        Column::Dx => Some(m.dx_m),
        Column::Dy => Some(m.dy_m),
        Column::Yaw => Some(m.dyaw_rad),
        Column::Rise => Some(m.apex_m),
        Column::Air => Some(m.air_s),
        _ => None,
    }
}

/// Order of the trial table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SortBy {
    /// Number, oldest first.
    #[default]
    Number,
    /// A parameter, by its index in the session's list.
    Parameter(usize),
    /// A column other than the parameters.
    Column(Column),
}

/// State of the trial table.
#[derive(Debug, Clone, Default)]
pub struct TrialTable {
    /// The selected trial; none follows the newest.
    pub selected: Option<u32>,
    /// Order of the rows.
    pub sort: SortBy,
    /// Whether the order is reversed; rows without a value stay last.
    pub reversed: bool,
    /// Only this verdict.
    pub filter: Option<Verdict>,
    /// Only trials that were the best when they ran.
    pub best_only: bool,
    /// The columns beside the number.
    pub columns: Vec<Column>,
}

impl TrialTable {
    /// The selected row, or the newest.
    pub fn selected<'a>(&self, trials: &'a Trials) -> Option<&'a TrialRecord> {
        match self.selected {
            Some(number) => trials.records.get(&number),
            None => trials.newest(),
        }
    }

    /// The rows, sorted and filtered.
    pub fn rows<'a>(&self, trials: &'a Trials, parameters: &[ParameterInfo]) -> Vec<&'a TrialRecord> {
        let mut rows: Vec<&TrialRecord> = if self.best_only {
            trials.best_so_far().collect()
        } else {
            trials.records.values().filter(|trial| self.filter.is_none() || trial.verdict == self.filter).collect()
        };
        let nth = |trial: &TrialRecord, index| nth_parameter(trial, parameters, index);
        rows.sort_by(|a, b| match self.sort {
            SortBy::Number => a.trial.cmp(&b.trial),
            SortBy::Parameter(index) => descending(nth(a, index), nth(b, index)),
            SortBy::Column(Column::Verdict) => verdict_rank(a.verdict).cmp(&verdict_rank(b.verdict)),
            SortBy::Column(Column::Source | Column::Parameters) => a.source.name().cmp(b.source.name()),
            SortBy::Column(Column::Cause) => a.cause.cmp(&b.cause),
            SortBy::Column(Column::Value) => descending(a.value, b.value),
            SortBy::Column(Column::Risk) => descending(risk_share(a), risk_share(b)),
            SortBy::Column(Column::Time) => {
                let begun = |trial: &TrialRecord| trials.ran.get(&trial.trial).map(|ran| -(ran.begun_ns as f64));
                descending(begun(a), begun(b))
            }
            SortBy::Column(column) => descending(measured(a, column), measured(b, column)),
        });
        if self.reversed {
            let sortable = |trial: &TrialRecord| match self.sort {
                SortBy::Parameter(index) => nth(trial, index).is_some(),
                SortBy::Column(Column::Value) => trial.value.is_some_and(|value| !value.is_nan()),
                SortBy::Column(Column::Verdict) => trial.verdict.is_some(),
                SortBy::Column(Column::Risk) => risk_share(trial).is_some(),
                SortBy::Column(Column::Time) => trials.ran.contains_key(&trial.trial),
                SortBy::Number | SortBy::Column(Column::Source | Column::Parameters | Column::Cause) => true,
                SortBy::Column(column) => measured(trial, column).is_some(),
            };
            // Rows without a value to sort by stay last.
            let sorted = rows.iter().take_while(|row| sortable(row)).count();
            rows[..sorted].reverse();
        }
        rows
    }
}

/// Larger numbers first; NaN and none last.
fn descending(a: Option<f64>, b: Option<f64>) -> Ordering {
    let (a, b) = (a.filter(|a| !a.is_nan()), b.filter(|b| !b.is_nan()));
    match (a, b) {
        (Some(a), Some(b)) => b.total_cmp(&a),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

/// The order of verdicts: accept, fall, void, none yet.
fn verdict_rank(verdict: Option<Verdict>) -> usize {
    verdict.and_then(|verdict| Verdict::ALL.iter().position(|v| *v == verdict)).unwrap_or(Verdict::ALL.len())
}

fn nth_parameter(trial: &TrialRecord, parameters: &[ParameterInfo], index: usize) -> Option<f64> {
    let name = &parameters.get(index)?.name;
    trial.parameters.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
}

/// Share of falls among the nearest trials before it ran.
fn risk_share(trial: &TrialRecord) -> Option<f64> {
    let risk = trial.risk.filter(|risk| risk.neighbours > 0)?;
    Some(f64::from(risk.falls) / f64::from(risk.neighbours))
}
