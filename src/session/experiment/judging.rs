//! The end of a trial: measurement, suggestion, verdict.

use super::attributes::{self, JudgedAttributes};
use super::plan::{ExperimentPlan, RequestRefusal, not_now};
use super::{Experiment, ExperimentState, PendingVerdict};
use crate::optimize::study::{Outcome, StudyError};
use crate::session::objective;
use crate::telemetry::{Tick, TrialEnd};
use crate::trial::{JudgedBy, JumpParameters, NOT_RECORDED, TrialRecord, Verdict, counted};

const NOT_UNDER_REVIEW: &str = "no trial is under review";
const DID_NOT_JUMP: &str = "the robot did not jump in this trial: judge it void, or run it again";

impl Experiment {
    /// Measures the trial that has ended; it waits for its verdict then. `recorded` is its number of ticks: if some are
    /// missing in `ticks`, nothing is measured.
    pub fn ended(&mut self, trial: u32, end: &TrialEnd, ticks: &[Tick], recorded: u64) {
        self.ended_by(trial, end, ticks, recorded, None);
    }

    /// The same of a trial that `observer`, in words, has stopped; none if this session's operator has.
    pub fn ended_by(&mut self, trial: u32, end: &TrialEnd, ticks: &[Tick], recorded: u64, observer: Option<&str>) {
        if !matches!(self.state, ExperimentState::Running(running) if running == trial) {
            return;
        }
        let missing = recorded.saturating_sub(ticks.len() as u64);
        let rule = self.spec(trial).objective();
        let measured = if missing == 0 { objective::measure(&rule, ticks) } else { None };
        let (mut suggested, mut cause) = objective::suggest_measured(end, measured.as_ref(), rule.bounce);
        if let Some(observer) = observer.filter(|_| *end == TrialEnd::Stopped) {
            cause = format!("{cause} by {observer}");
        }
        let jumped = missing > 0 || ticks.iter().any(|tick| tick.trial.is_some() && tick.trial_time_s >= 0.0);
        let not_recorded = format!("{} of it {NOT_RECORDED}", counted(missing as usize, "tick"));
        match suggested {
            Verdict::Accept if missing > 0 => (suggested, cause) = (Verdict::Void, not_recorded),
            Verdict::Void if missing > 0 => cause = format!("{cause}; {not_recorded}"),
            _ if objective::trips_limit(end) && !jumped => {
                (suggested, cause) = (Verdict::Void, format!("before the jump: {cause}"));
            }
            _ => {}
        }
        if let Some(row) = self.rows.get_mut(&trial) {
            row.measured = measured;
            row.suggested = Some(suggested);
            row.cause = cause;
            row.value = value_of(row, suggested, &self.plan);
        }
        self.publish_row(trial);
        self.enter(ExperimentState::Review(trial), trial);
    }

    /// Writes the measurement of the trial under review to the study: if the program ends before the verdict, the session that
    /// continues the study judges it. The rollouts of a trial of several are kept with their verdicts alone.
    pub fn keep_measurement(&mut self) -> Result<(), StudyError> {
        let ExperimentState::Review(trial) = self.state else { return Ok(()) };
        if self.plan.control.repeats > 1 {
            return Ok(());
        }
        match self.write_judgement(trial, false) {
            // Ended by another program; the verdict reports it.
            Err(StudyError::State { .. }) => Ok(()),
            written => written,
        }
    }

    /// Judges the trial under review for the operator; with `rerun` its parameters are queued again.
    /// Refused when no trial is under review, an accepted trial has no value, a trial without a jump is not judged void, or one
    /// that tripped a limit is judged void without a reason.
    pub fn judge(&mut self, verdict: Verdict, rerun: bool) -> Result<(), RequestRefusal> {
        self.judge_because(verdict, JudgedBy::Operator, rerun, "")
    }

    /// Judges the trial under review by a rule of the program, without a person.
    /// Refused as [`Experiment::judge`].
    pub fn judge_by_rule(&mut self, verdict: Verdict) -> Result<(), RequestRefusal> {
        self.judge_because(verdict, JudgedBy::Rule, false, "")
    }

    /// Judges the trial under review void for a reason of the operator; with `rerun` its parameters are queued again.
    /// Refused when no trial is under review.
    pub fn void_because(&mut self, reason: &str, rerun: bool) -> Result<(), RequestRefusal> {
        self.judge_because(Verdict::Void, JudgedBy::Operator, rerun, reason.trim())
    }

    fn judge_because(
        &mut self,
        verdict: Verdict,
        by: JudgedBy,
        rerun: bool,
        reason: &str,
    ) -> Result<(), RequestRefusal> {
        let trial = self.reviewed()?;
        let Some(row) = self.rows.get_mut(&trial) else { return not_now(NOT_UNDER_REVIEW) };
        if verdict != Verdict::Void && row.did_not_jump() {
            return not_now(DID_NOT_JUMP);
        }
        if verdict == Verdict::Void && reason.is_empty() && objective::tripped_limit(row) {
            return not_now(format!(
                "trial {trial} tripped a limit ({}), which is its parameters' outcome; to judge it void give the reason why they did not cause it",
                row.cause
            ));
        }
        let value = value_of(row, verdict, &self.plan);
        let outcome = match (verdict, value) {
            (Verdict::Void, _) => Outcome::Fail,
            (_, Some(value)) => Outcome::Complete(value),
            (_, None) => {
                return not_now("nothing was measured in this trial; enter a value measured by hand, or judge it void");
            }
        };
        let suggestion = row.clone();
        (row.verdict, row.judged_by) = (Some(verdict), Some(by));
        row.value = value;
        let repeats = self.plan.control.repeats;
        if let Some(suggested) = row.suggested.filter(|suggested| *suggested != verdict) {
            let given = if reason.is_empty() { String::new() } else { format!(": {reason}") };
            let by = if rerun { "re-run by the operator" } else { "by the operator" };
            row.cause = format!("{by}{given}; looked like {}: {}", suggested.name(), row.cause);
        } else if !reason.is_empty() {
            row.cause = format!("by the operator: {reason}; {}", row.cause);
        }
        let mut outcome = outcome;
        if repeats > 1 {
            let seed = self.spec(trial).seed;
            match self.judge_repeat(trial, seed, suggestion.clone())? {
                Some(mean) => outcome = Outcome::Complete(mean),
                None => return Ok(()),
            }
        }
        match self.write_judgement(trial, rerun) {
            // Another worker has closed the trial as abandoned, or another program has ended it.
            Err(StudyError::State { .. }) => {
                self.rows.remove(&trial);
                self.state = ExperimentState::Finished;
                self.propose()?;
                return Err(RequestRefusal::EndedElsewhere(trial));
            }
            Err(error) => {
                self.rows.insert(trial, suggestion);
                return Err(error.into());
            }
            Ok(()) => {}
        }
        self.publish_row(trial);
        let rerun = rerun.then_some(self.study.trials().len() as u32);
        self.pending_verdict = Some(PendingVerdict { suggestion, outcome, rerun });
        self.propose()?;
        Ok(self.store_model_best()?)
    }

    /// Takes the last verdict back.
    /// Refused when it was reported already.
    pub fn undo(&mut self) -> Result<(), RequestRefusal> {
        if matches!(self.state, ExperimentState::BetweenRepeats(_)) {
            return self.undo_repeat();
        }
        let Some(pending) = self.pending_verdict.as_ref().filter(|_| self.is_idle()) else {
            return not_now(
                "there is no verdict to undo; the last one became final when the next trial was approved or skipped, or when another \
                 verdict was changed after the repeats",
            );
        };
        let mut row = pending.suggestion.clone();
        let trial = row.trial;
        if let Some(judged) = self.rows.get(&trial) {
            row.note.clone_from(&judged.note);
        }
        // If this fails, the verdict stands on the disk and must still be reported.
        self.study.annotate(trial, &attributes::write(&JudgedAttributes::of(&row, false)))?;
        self.pending_verdict = None;
        self.confirmation.reopen();
        self.confirmation.forget_report();
        self.rows.insert(trial, row);
        self.publish_row(trial);
        self.enter(ExperimentState::Review(trial), trial);
        self.publish_model(trial);
        Ok(self.store_model_best()?)
    }

    /// Uses a value measured by hand for the trial under review; none returns to the measured one.
    /// Refused when no trial is under review, the value is not finite, or a value is given for a trial without a jump.
    pub fn set_hand_value(&mut self, value: Option<f64>) -> Result<(), RequestRefusal> {
        let trial = self.reviewed()?;
        if value.is_some_and(|value| !value.is_finite()) {
            return not_now("a measured value must be a finite number");
        }
        let Some(row) = self.rows.get_mut(&trial) else { return not_now(NOT_UNDER_REVIEW) };
        if value.is_some() && row.did_not_jump() {
            return not_now(DID_NOT_JUMP);
        }
        let before = row.clone();
        row.hand_value = value;
        row.value = row.suggested.and_then(|suggested| value_of(row, suggested, &self.plan));
        if let Err(error) = self.keep_measurement() {
            self.rows.insert(trial, before);
            return Err(error.into());
        }
        self.publish_row(trial);
        Ok(())
    }

    /// Ends the session during a review: a trial that is to be void by the rules (stopped, or its operator is gone) is void
    /// with its cause, and its parameters are queued again as after a crash; one with a value by hand is not. A trial that
    /// tripped a limit is a fall and is not queued. Any other waits for its verdict until the study is opened again.
    pub fn close_unreviewed(&mut self) -> Result<(), StudyError> {
        let ExperimentState::Review(trial) = self.state else { return Ok(()) };
        let Some(row) = self.rows.get_mut(&trial) else { return Ok(()) };
        let limit = objective::tripped_limit(row);
        if limit && self.plan.control.repeats > 1 {
            // The judged rollouts are kept; a session that continues the study does the others.
            if let Err(error) = self.judge_by_rule(Verdict::Fall) {
                self.log(error.to_string());
            }
            return self.report_verdict().map(drop);
        }
        let verdict = if limit { Verdict::Fall } else { Verdict::Void };
        if row.suggested != Some(verdict) || verdict == Verdict::Void && row.hand_value.is_some() {
            return Ok(());
        }
        let before = row.clone();
        (row.verdict, row.judged_by) = (Some(verdict), Some(JudgedBy::Rule));
        if let Err(error) = self.write_closed(trial, limit, &before.cause) {
            // On the disk it has no verdict.
            self.rows.insert(trial, before);
            return Err(error);
        }
        self.publish_row(trial);
        self.state = ExperimentState::Finished;
        Ok(())
    }

    /// Writes the verdict of a trial that the end of the session judges: a fall by a limit, or void and queued again.
    fn write_closed(&mut self, trial: u32, limit: bool, cause: &str) -> Result<(), StudyError> {
        if limit {
            return match self.write_judgement(trial, false) {
                Ok(()) => self.study.tell(trial, Outcome::Complete(0.0)).map(drop),
                // Ended by another program: that result stands.
                Err(StudyError::State { .. }) => Ok(()),
                Err(error) => Err(error),
            };
        }
        let log = self.queue.close(&mut self.study, trial, cause)?;
        self.log_all(log);
        Ok(())
    }

    fn reviewed(&self) -> Result<u32, RequestRefusal> {
        match self.state {
            ExperimentState::Review(trial) => Ok(trial),
            _ => not_now(NOT_UNDER_REVIEW),
        }
    }

    pub(super) fn write_judgement(&mut self, trial: u32, rerun: bool) -> Result<(), StudyError> {
        match self.rows.get(&trial) {
            Some(row) => self.study.annotate(trial, &attributes::write(&JudgedAttributes::of(row, rerun))),
            None => Ok(()),
        }
    }
}

/// Returns the value of a row with a verdict: 0 for a fall (paper, section II-D), none for void, else the value measured by
/// hand or by the robot.
pub(super) fn value_of(row: &TrialRecord, verdict: Verdict, plan: &ExperimentPlan) -> Option<f64> {
    match verdict {
        Verdict::Fall => Some(0.0),
        Verdict::Void => None,
        Verdict::Accept => row.hand_value.or_else(|| {
            let jump = JumpParameters::from_values(&row.parameters, plan.control.f1_hz);
            let rule = plan.control.trial(plan.task, jump).objective();
            row.measured.as_ref().map(|measured| objective::value(&rule, measured))
        }),
    }
}
