//! The best trial of a table, chosen alike in its session and where its study is read.

use crate::optimize::repeats::{RepeatedPoint, improvements, points};
use crate::optimize::study::{ModelBest, Study};
use crate::trial::{TrialRecord, Verdict};

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
    let points = points(study.trials());
    let mean = |number| points.iter().find(|point| point.trials.contains(&number)).map(RepeatedPoint::mean);
    let is_feasible = |row: &&TrialRecord| study.trial(row.trial).is_ok_and(|trial| trial.violation() <= 0.0);
    let accepted = rows.filter(|row| row.verdict == Some(Verdict::Accept)).filter(is_feasible);
    let candidates = accepted.filter_map(|row| Some((row, row.trial, row.value?)));
    improvements(candidates, mean, study.options().direction).last()
}
