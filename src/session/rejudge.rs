//! A recorded trial judged again: objective and fall detection of another configuration on the recorded ticks.

use super::objective;
use crate::control::running_trial::FallWatch;
use crate::control::settings::ControlSettings;
use crate::telemetry::{Tick, TrialEnd};
use crate::trial::{MeasuredJump, ObjectiveRule, RepeatRecord, TrialRecord, Verdict};

/// Largest difference of two objectives, m or rad (with `rate` a second), that the single precision of recorded ticks explains.
const RECORDED_PRECISION: f64 = 1e-5;

/// The rules' result for a trial, before a person's verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The objective, as measured; of a trial with several rollouts the mean of those that count, with 0 for a fall. None where it
    /// is not known.
    pub value: Option<f64>,
    /// Measured values with the objective; none where nothing was measured.
    pub measured: Option<MeasuredJump>,
    /// Suggested verdict; none where the recording does not show it.
    pub verdict: Option<Verdict>,
    /// Reason.
    pub cause: String,
}

/// Longest time of a trial's ticks that may be missing at its begin and its end, s: two ticks.
const MISSING_S: f64 = 0.002;

impl Judgement {
    /// Returns the suggestion that a row holds.
    pub fn of(row: &TrialRecord) -> Judgement {
        let single = Judgement::measured(row.measured.clone(), row.suggested, row.cause.clone());
        if row.repeats.is_empty() {
            return single;
        }
        let values = row.repeats.iter().filter_map(|repeat| repeat.value);
        Judgement { value: objective::mean(values), ..single }
    }

    fn measured(measured: Option<MeasuredJump>, verdict: Option<Verdict>, cause: String) -> Judgement {
        Judgement { value: measured.as_ref().and_then(|measured| measured.measured_value), measured, verdict, cause }
    }

    /// Returns by how much the value exceeds that of `old`; 0 within the precision of recorded ticks, none where one is missing.
    pub fn difference(&self, old: &Judgement) -> Option<f64> {
        let difference = self.value? - old.value?;
        Some(if difference.abs() <= RECORDED_PRECISION { 0.0 } else { difference })
    }

    /// Whether verdict, reason or value differ from those of `old`. Words of the operator may stand before the reason of `old`.
    pub fn differs(&self, old: &Judgement) -> bool {
        let same_value = self.difference(old).map_or(self.value == old.value, |difference| difference == 0.0);
        let same_cause = old
            .cause
            .strip_suffix(&self.cause)
            .is_some_and(|words| words.is_empty() || words.ends_with(": ") || words.ends_with("; "));
        self.verdict != old.verdict || !same_cause || !same_value
    }

    /// Returns the judgement of a trial of several rollouts from theirs.
    pub fn of_repeats(repeats: &[Judgement]) -> Judgement {
        if let Some((index, open)) = repeats.iter().enumerate().find(|(_, repeat)| repeat.verdict.is_none()) {
            return Judgement::unknown(format!("repeat {}: {}", index + 1, open.cause));
        }
        let judged = repeats.iter().filter_map(|repeat| Some((repeat.verdict?, repeat.value)));
        let counted: Vec<_> = judged.filter(|(verdict, _)| *verdict != Verdict::Void).collect();
        let (verdict, value, cause) = objective::judge_repeats(&counted);
        let measured = repeats.last().and_then(|repeat| repeat.measured.clone());
        Judgement { value, measured, verdict: Some(verdict), cause }
    }

    /// Returns a judgement without a verdict, for a reason.
    pub fn unknown(cause: String) -> Judgement {
        Judgement { value: None, measured: None, verdict: None, cause }
    }
}

/// Returns the row of a rollout of a trial with several, as if it were a trial of its own.
pub fn row_of_repeat(row: &TrialRecord, repeat: &RepeatRecord) -> TrialRecord {
    TrialRecord {
        suggested: repeat.verdict,
        cause: repeat.cause.clone(),
        measured: repeat.measured.clone(),
        repeats: Vec::new(),
        ..row.clone()
    }
}

/// Judges the ticks of one rollout again; `row` is that of its trial, of a trial with several that of
/// [`row_of_repeat`]. A fall under `settings` ends the run where it is detected. A trial that fell when
/// it ran and does not fall under `settings` has no verdict: what would have followed is not recorded. Of the other ends (stop,
/// fault, rest) the recorded one holds.
pub fn rejudge(row: &TrialRecord, ticks: &[Tick], rule: &ObjectiveRule, settings: &ControlSettings) -> Judgement {
    let is_whole = ticks.windows(2).all(|pair| pair[1].number == pair[0].number + 1);
    let (Some(first), Some(last), true) = (ticks.first(), ticks.last(), is_whole) else {
        return Judgement::unknown("some of its ticks cannot be read".into());
    };
    if first.trial_time_s > MISSING_S {
        return Judgement::unknown("its begin is not recorded".into());
    }
    let mut watch = FallWatch::default();
    let fall = ticks
        .iter()
        .enumerate()
        .find_map(|(index, tick)| Some((index, watch.update(&tick.state, &tick.estimate, settings, f64::INFINITY)?)));
    if let Some((index, cause)) = fall {
        let measured = objective::measure(rule, &ticks[..=index]);
        let (verdict, cause) = objective::suggest(&TrialEnd::Fell(cause));
        return Judgement::measured(measured, Some(verdict), cause);
    }
    let end_s = row.measured.as_ref().map_or(0.0, |measured| measured.end_s);
    if last.trial_time_s + MISSING_S < end_s {
        return Judgement::unknown("its end is not recorded".into());
    }
    let measured = objective::measure(rule, ticks);
    if objective::ended_at_rest(row) {
        let (verdict, cause) = objective::suggest_measured(&TrialEnd::Settled, measured.as_ref(), rule.bounce);
        return Judgement::measured(measured, Some(verdict), cause);
    }
    if objective::ended_by_fall(row) {
        return Judgement::measured(measured, None, "no fall; the recording ends where it fell before".into());
    }
    Judgement::measured(measured, row.suggested, row.cause.clone())
}
