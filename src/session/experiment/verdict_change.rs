//! Changes of a verdict after it has become final.

use jiff::Timestamp;

use super::Experiment;
use super::judging::value_of;
use super::plan::{RequestRefusal, not_now};
use crate::optimize::trial::VerdictChange;
use crate::trial::{CHANGED, JudgedBy, Verdict};

impl Experiment {
    /// Changes the final verdict of a trial for a reason of the operator; returns the name of the one before. The journal keeps both. The
    /// sampler proposes again from the changed history; the operator's changes of the open proposal stay.
    /// Refused during a trial, without a reason, for a trial that was not run, did not jump, has no final verdict or several
    /// rollouts, for the verdict that it has, and for an accepted trial without a value.
    pub fn change_verdict(
        &mut self,
        trial: u32,
        verdict: Verdict,
        reason: &str,
    ) -> Result<&'static str, RequestRefusal> {
        self.must_be_idle()?;
        let reason = reason.trim();
        let Some(row) = self.rows.get(&trial) else { return not_now(format!("there is no trial {trial}")) };
        if self.pending_verdict.as_ref().is_some_and(|pending| pending.suggestion.trial == trial) {
            return not_now("its verdict is the last one: undo takes it back");
        }
        let Some(before) = row.verdict else { return not_now(format!("trial {trial} has no verdict yet")) };
        if row.was_not_run() {
            return not_now(format!("trial {trial} was not run: it has no verdict"));
        }
        if row.did_not_jump() {
            return not_now(format!("the robot did not jump in trial {trial}: it stays void"));
        }
        if before == verdict {
            return not_now(format!("trial {trial} is {} already", verdict.name()));
        }
        if !row.repeats.is_empty() {
            return not_now(format!("trial {trial} has {} rollouts, each with its verdict", row.repeats.len()));
        }
        if reason.is_empty() {
            return not_now("give the reason of the change");
        }
        let value = match verdict {
            // The value of a trial of another program is not that of a measurement here.
            Verdict::Accept => value_of(row, verdict, &self.plan).or_else(|| self.study.formerly_accepted_value(trial)),
            Verdict::Fall | Verdict::Void => value_of(row, verdict, &self.plan),
        };
        if verdict != Verdict::Void && value.is_none() {
            return not_now(format!("nothing was measured in trial {trial}: it cannot be accepted"));
        }
        // The operator's reason first: a long line is cut. Earlier reasons are in the journal.
        let name = row.verdict_name().unwrap_or(before.name());
        let cause = format!("{reason}; {CHANGED}, was {name}; {}", row.cause_by_rule());
        let change = VerdictChange {
            at: Timestamp::now().to_string(),
            verdict: verdict.name().to_owned(),
            value,
            cause: cause.clone(),
            reason: reason.to_owned(),
            old_verdict: before.name().to_owned(),
            old_value: row.value,
        };
        // The repeats that confirm the best are over: their result stays, as in a study that is continued. The verdict that ended them
        // is final then.
        if self.confirmation.is_over() {
            self.report_verdict()?;
        }
        self.study.change_verdict(trial, &change)?;
        if let Some(row) = self.rows.get_mut(&trial) {
            (row.verdict, row.judged_by) = (Some(verdict), Some(JudgedBy::Operator));
            (row.value, row.cause) = (value, cause);
        }
        self.publish_row(trial);
        self.propose()?;
        self.store_model_best()?;
        Ok(name)
    }
}
