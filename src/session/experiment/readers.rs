//! A study for its readers, who are to see the same as its session.

use super::attributes::TrialAttributes;
use crate::optimize::repeats::{RepeatResult, RepeatedPoint, improvements, points_of};
use crate::optimize::study::{ModelBest, Outcome, Study, StudyError};
use crate::trial::{TrialRecord, Verdict};

/// Copies `study` with every verdict that its session can still take back reported in the copy: no reader has to know of the wait.
///
/// # Errors
/// When the copy cannot be changed.
pub fn judged(study: &Study) -> Result<Study, StudyError> {
    let verdicts: Vec<(u32, Outcome)> =
        study.running().filter_map(|trial| Some((trial.number, TrialAttributes::of(trial).outcome()?))).collect();
    let mut copy = study.fork();
    for (trial, outcome) in verdicts {
        copy.tell(trial, outcome)?;
    }
    Ok(copy)
}

/// Returns the points of the trials that count, in the order of their first trials, with verdicts that can still be taken back.
pub fn points_of_rows<'a>(rows: impl Iterator<Item = &'a TrialRecord>) -> Vec<RepeatedPoint> {
    points_of(rows.filter_map(|row| {
        Some(RepeatResult {
            trial: row.trial,
            parameters: &row.parameters,
            gains: &row.gains,
            value: row.value.filter(|_| row.has_result())?,
            is_fall: row.verdict != Some(Verdict::Accept),
        })
    }))
}

/// Returns the best of `rows`, which are trials of `study` by their numbers: `by_model`, the best by the sampler's model; without
/// one the accepted feasible trial whose point has the best value, the earliest of equals. The value of a repeated point is the mean
/// of its repeats ([`crate::optimize::repeats`]). A verdict that its session can still take back counts.
pub fn best_of<'a>(
    study: &Study,
    rows: impl Iterator<Item = &'a TrialRecord> + Clone,
    by_model: Option<ModelBest>,
) -> Option<&'a TrialRecord> {
    if let Some(best) = by_model.and_then(|best| rows.clone().find(|row| row.trial == best.trial)) {
        return Some(best);
    }
    let points = points_of_rows(rows.clone());
    let mean = |number| points.iter().find(|point| point.trials.contains(&number)).map(RepeatedPoint::mean);
    let is_feasible = |row: &&TrialRecord| study.trial(row.trial).is_ok_and(|trial| trial.violation() <= 0.0);
    let accepted = rows.filter(|row| row.verdict == Some(Verdict::Accept)).filter(is_feasible);
    let candidates = accepted.filter_map(|row| Some((row, row.trial, row.value?)));
    improvements(candidates, mean, study.options().direction).last()
}
