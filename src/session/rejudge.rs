//! A recorded trial judged again: objective and fall detection of another configuration on the recorded ticks.

use super::objective;
use crate::control::running_trial::FallWatch;
use crate::control::settings::ControlSettings;
use crate::telemetry::{Tick, TrialEnd};
use crate::trial::{MeasuredJump, ObjectiveRule, TrialRecord, Verdict};

/// Largest difference of two objectives, m or rad (with `rate` a second), that the single precision of recorded ticks explains.
const RECORDED_PRECISION: f64 = 1e-5;

/// The rules' result for a trial, before a person's verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Measured values with the objective; none where nothing was measured.
    pub measured: Option<MeasuredJump>,
    /// Suggested verdict; none where the recording does not show it.
    pub verdict: Option<Verdict>,
    /// Reason.
    pub cause: String,
}

impl Judgement {
    /// Returns the suggestion that a row holds.
    pub fn of(row: &TrialRecord) -> Judgement {
        Judgement { measured: row.measured.clone(), verdict: row.suggested, cause: row.cause.clone() }
    }

    /// Returns the measured objective, before any verdict.
    pub fn value(&self) -> Option<f64> {
        self.measured.as_ref()?.measured_value
    }

    /// Returns by how much the value exceeds that of `old`; 0 within the precision of recorded ticks, none where one is missing.
    pub fn difference(&self, old: &Judgement) -> Option<f64> {
        let difference = self.value()? - old.value()?;
        Some(if difference.abs() <= RECORDED_PRECISION { 0.0 } else { difference })
    }

    /// Whether verdict, reason or value differ from those of `old`.
    pub fn differs(&self, old: &Judgement) -> bool {
        let same_value = self.difference(old).map_or(self.value() == old.value(), |difference| difference == 0.0);
        self.verdict != old.verdict || self.cause != old.cause || !same_value
    }

    fn unknown(cause: String) -> Judgement {
        Judgement { measured: None, verdict: None, cause }
    }
}

/// Judges the ticks of one run of a trial again. A fall under `settings` ends the run where it is detected. A trial that fell when
/// it ran and does not fall under `settings` has no verdict: what would have followed is not recorded. Of the other ends (stop,
/// fault, rest) the recorded one holds.
pub fn rejudge(row: &TrialRecord, ticks: &[Tick], rule: &ObjectiveRule, settings: &ControlSettings) -> Judgement {
    if !row.repeats.is_empty() {
        return Judgement::unknown("several rollouts: only single ones are judged again".into());
    }
    let missing = ticks.windows(2).filter(|pair| pair[1].number != pair[0].number + 1).count();
    if missing > 0 || ticks.is_empty() {
        return Judgement::unknown("some of its ticks cannot be read".into());
    }
    let mut watch = FallWatch::default();
    let fall = ticks
        .iter()
        .enumerate()
        .find_map(|(index, tick)| Some((index, watch.update(&tick.state, &tick.estimate, settings, f64::INFINITY)?)));
    if let Some((index, cause)) = fall {
        let measured = objective::measure(rule, &ticks[..=index]);
        let (verdict, cause) = objective::suggest(&TrialEnd::Fell(cause));
        return Judgement { measured, verdict: Some(verdict), cause };
    }
    let measured = objective::measure(rule, ticks);
    if objective::ended_at_rest(row) {
        let (verdict, cause) = objective::suggest_measured(&TrialEnd::Settled, measured.as_ref(), rule.bounce);
        return Judgement { measured, verdict: Some(verdict), cause };
    }
    if objective::ended_by_fall(row) {
        return Judgement { measured, verdict: None, cause: "no fall; the recording ends where it fell before".into() };
    }
    Judgement { measured, ..Judgement::of(row) }
}
