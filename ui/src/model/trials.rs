//! The trials of the study, and the table that shows them: columns, order, filter.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use quadfrog::optimize::ask::Direction;
use quadfrog::optimize::repeats::{contenders_of, improvements, least_repeats};
use quadfrog::session::experiment::points_of_rows;
use quadfrog::trial::{JudgedBy, ParameterInfo, PointRecord, PredictedTrial, TrialRecord, Verdict};

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
    /// The best trial by the sampler's model; none for a sampler without one.
    pub model_best: Option<PredictedTrial>,
}

/// Run time of a trial, ns since the engine started.
#[derive(Debug, Clone, PartialEq)]
pub struct RunTime {
    /// Its approval.
    pub begun_ns: u64,
    /// The end of its measurement; none while it runs.
    pub ended_ns: Option<u64>,
}

impl Trials {
    pub fn newest(&self) -> Option<&TrialRecord> {
        self.records.values().next_back()
    }

    /// The number of trials that ran and have that verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.records.values().filter(|trial| has_verdict(trial, verdict)).count()
    }

    /// The best trial by the sampler's model; without one the accepted trial of the highest mean over the repeats of its point,
    /// the earlier one of equals.
    pub fn best(&self) -> Option<&TrialRecord> {
        let by_model = self.model_best.and_then(|best| self.records.get(&best.trial));
        by_model.or_else(|| self.best_so_far().last())
    }

    /// The best trial's number, its value, and in words how both came about: ` by hand` after the value, ` by the model` after the
    /// number. The value is that of the jump: what a model expects of its point is named as such where it is shown.
    pub fn best_value(&self) -> Option<BestValue> {
        let best = self.best()?;
        Some(BestValue {
            trial: best.trial,
            value: best.value?,
            by_hand: if best.hand_value.is_some() { " by hand" } else { "" },
            chosen: if self.model_best.is_some_and(|model| model.trial == best.trial) { " by the model" } else { "" },
        })
    }

    /// The accepted trials that were better than all before them, in order.
    pub fn best_so_far(&self) -> impl Iterator<Item = &TrialRecord> + '_ {
        let accepted = self.records.values().filter_map(|trial| Some((trial, trial.trial, accepted_value(trial)?)));
        let mean = |trial| self.points.iter().find(|point| point.trials.contains(&trial)).map(|point| point.mean);
        improvements(accepted, mean, Direction::Maximize)
    }

    /// Repeats that a confirmation of the best needs at least: of the `contenders` best points those with an
    /// accepted trial are compared.
    pub fn least_repeats(&self, contenders: usize) -> usize {
        let points = points_of_rows(self.records.values());
        let best = contenders_of(points, Direction::Maximize, contenders, self.best().map(|best| best.trial));
        least_repeats(best.iter().filter(|point| point.without_fall > 0))
    }

    /// Attempts at the parameters of a trial up to it: 1, or one more than the trial that it repeats.
    pub fn attempt(&self, trial: &TrialRecord) -> usize {
        // Parents are older than their children, so the walk ends.
        let parent =
            |t: &&TrialRecord| t.parent.filter(|parent| *parent < t.trial).and_then(|parent| self.records.get(&parent));
        std::iter::successors(Some(trial), parent).count()
    }
}

/// The best trial in a line.
#[derive(Debug, Clone, Copy)]
pub struct BestValue {
    pub trial: u32,
    pub value: f64,
    pub by_hand: &'static str,
    pub chosen: &'static str,
}

/// Whether a trial ran and has that verdict.
fn has_verdict(trial: &TrialRecord, verdict: Verdict) -> bool {
    trial.verdict == Some(verdict) && !trial.was_not_run()
}

pub fn accepted_value(trial: &TrialRecord) -> Option<f64> {
    trial.value.filter(|_| trial.verdict == Some(Verdict::Accept))
}

/// Whether the value of a trial is measured by hand: of an accepted one, or of one that waits and looks like it.
pub fn value_is_by_hand(trial: &TrialRecord) -> bool {
    trial.value.is_some() && trial.hand_value.is_some() && trial.verdict.or(trial.suggested) == Some(Verdict::Accept)
}

/// The measured quantity of a column, where it is one.
pub fn measured(trial: &TrialRecord, column: Column) -> Option<f64> {
    let m = trial.measured.as_ref()?;
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
    #[default]
    /// Number, oldest first.
    Number,
    /// A parameter, by its index in the session's list.
    Parameter(usize),
    /// A column other than the parameters.
    Column(Column),
}

/// The only trials that the table shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialFilter {
    Verdict(Verdict),
    NotRun,
}

impl TrialFilter {
    /// The filter after this one; none after the last.
    pub fn next(before: Option<TrialFilter>) -> Option<TrialFilter> {
        let mut all = Verdict::ALL.into_iter().map(TrialFilter::Verdict).chain([TrialFilter::NotRun]);
        match before {
            None => all.next(),
            Some(before) => all.skip_while(|filter| *filter != before).nth(1),
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            TrialFilter::Verdict(verdict) => verdict.name(),
            TrialFilter::NotRun => "not run",
        }
    }

    fn passes(self, trial: &TrialRecord) -> bool {
        match self {
            TrialFilter::Verdict(verdict) => has_verdict(trial, verdict),
            TrialFilter::NotRun => trial.was_not_run(),
        }
    }
}

/// State of the trial table.
#[derive(Debug, Clone, Default)]
pub struct TrialTable {
    /// The selected trial; none follows the newest.
    pub selected: Option<u32>,
    pub sort: SortBy,
    /// Whether the order is reversed; rows without a value stay last.
    pub reversed: bool,
    pub filter: Option<TrialFilter>,
    /// Only trials that were the best when they ran.
    pub best_only: bool,
    /// The columns beside the number.
    pub columns: Vec<Column>,
}

impl TrialTable {
    /// Whether it may leave trials out.
    pub fn is_filtered(&self) -> bool {
        self.best_only || self.filter.is_some()
    }

    /// The rows, sorted and filtered; `later` are those of a replay that follow after the playhead, `waiting` is the trial that
    /// waits for its verdict.
    pub fn rows<'a>(
        &self,
        trials: &'a Trials,
        later: impl Iterator<Item = &'a TrialRecord>,
        parameters: &[ParameterInfo],
        waiting: Option<u32>,
    ) -> Vec<&'a TrialRecord> {
        let mut rows: Vec<&TrialRecord> = if self.best_only {
            trials.best_so_far().collect()
        } else {
            let all = trials.records.values().chain(later);
            all.filter(|trial| self.filter.is_none_or(|filter| filter.passes(trial))).collect()
        };
        // A filter never hides the trial that waits for its verdict.
        let waits =
            |trial: &&TrialRecord| waiting == Some(trial.trial) && !rows.iter().any(|row| row.trial == trial.trial);
        rows.extend(trials.records.values().find(waits));
        let sort_value = |trial: &TrialRecord| {
            let value = match self.sort {
                SortBy::Number => None,
                SortBy::Parameter(index) => trial.parameters.get(&parameters.get(index)?.name),
                SortBy::Column(Column::Value) => trial.value,
                SortBy::Column(Column::Risk) => risk_share(trial),
                // The newest last.
                SortBy::Column(Column::Time) => trials.ran.get(&trial.trial).map(|ran| -(ran.begun_ns as f64)),
                SortBy::Column(column) => measured(trial, column),
            };
            value.filter(|value| !value.is_nan())
        };
        rows.sort_by(|a, b| match self.sort {
            SortBy::Number => a.trial.cmp(&b.trial),
            SortBy::Column(Column::Verdict) => verdict_rank(a.verdict).cmp(&verdict_rank(b.verdict)),
            SortBy::Column(Column::JudgedBy) => judged_rank(a).cmp(&judged_rank(b)),
            SortBy::Column(Column::Source | Column::Parameters) => a.source.name().cmp(b.source.name()),
            SortBy::Column(Column::Cause) => a.cause.cmp(&b.cause),
            _ => descending(sort_value(a), sort_value(b)),
        });
        if self.reversed {
            // Rows without a value to sort by stay last.
            let sorted = match self.sort {
                SortBy::Column(Column::JudgedBy) => rows.iter().take_while(|row| row.judged_by.is_some()).count(),
                SortBy::Column(Column::Verdict) => rows.iter().take_while(|row| row.verdict.is_some()).count(),
                SortBy::Number | SortBy::Column(Column::Source | Column::Parameters | Column::Cause) => rows.len(),
                _ => rows.iter().take_while(|row| sort_value(row).is_some()).count(),
            };
            rows[..sorted].reverse();
        }
        rows
    }
}

/// Larger numbers first, none last.
fn descending(a: Option<f64>, b: Option<f64>) -> Ordering {
    match (a, b) {
        (Some(a), Some(b)) => b.total_cmp(&a),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

/// The order of verdicts: accept, fall, void, none yet.
fn verdict_rank(verdict: Option<Verdict>) -> usize {
    verdict.and_then(|verdict| Verdict::ALL.iter().position(|v| *v == verdict)).unwrap_or(Verdict::ALL.len())
}

/// The order of the origins of verdicts: operator, rule, none.
fn judged_rank(trial: &TrialRecord) -> usize {
    let place = trial.judged_by.and_then(|by| JudgedBy::ALL.iter().position(|known| *known == by));
    place.unwrap_or(JudgedBy::ALL.len())
}

/// Share of falls among the nearest trials before it ran.
fn risk_share(trial: &TrialRecord) -> Option<f64> {
    let risk = trial.risk.filter(|risk| risk.neighbours > 0)?;
    Some(f64::from(risk.falls) / f64::from(risk.neighbours))
}
