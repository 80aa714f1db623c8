//! Trials of several rollouts: each is approved and judged by itself, with a seed of its own. The value of the trial is the mean of
//! the rollouts that count, with 0 for a fall; a void rollout is done again. A judged rollout is on disk when it is shown: after a
//! crash the trial is queued again with it.

use super::attributes::{self, JudgedAttributes, RepeatsAttribute};
use super::between_repeats::BetweenRepeats;
use super::open_proposal::OpenProposal;
use super::plan::{RequestRefusal, not_now};
use super::{Experiment, ExperimentState};
use crate::optimize::study::{Outcome, StudyError, TellOutcome};
use crate::session::objective;
use crate::telemetry::TrialSpec;
use crate::trial::{JudgedBy, Proposal, ProposedParameter, RepeatRecord, TrialRecord, Verdict};

impl Experiment {
    /// Returns the proposal of the first rollout that a trial has in this session.
    pub(super) fn first_proposal(&self, open: &OpenProposal) -> Proposal {
        let proposal = open.proposal();
        match self.plan.control.repeats {
            0 | 1 => proposal,
            repeats => Proposal { repeat: open.continued_repeats() + 1, repeats, ..proposal },
        }
    }

    /// Returns the proposal of the trial's next rollout.
    pub(super) fn repeat_proposal(&self, between: &BetweenRepeats) -> Option<Proposal> {
        let row = self.rows.get(&between.trial())?;
        let values = |list: &[(String, f64)]| -> Vec<ProposedParameter> {
            list.iter()
                .map(|(name, value)| ProposedParameter { name: name.clone(), value: *value, proposed: *value })
                .collect()
        };
        Some(Proposal {
            trial: row.trial,
            revision: between.revision,
            source: row.source,
            parent: row.parent,
            parameters: values(&row.parameters),
            risk: row.risk,
            expected: row.expected,
            gains: values(&row.gains),
            repeat: row.counted_repeats() + 1,
            repeats: self.plan.control.repeats,
        })
    }

    pub(super) fn approve_repeat(&mut self, trial: u32, revision: u32) -> Result<TrialSpec, RequestRefusal> {
        let ExperimentState::BetweenRepeats(between) = &self.state else {
            return not_now("there is no repeat to approve");
        };
        between.must_be(trial, revision)?;
        self.enter(ExperimentState::Running(trial), trial);
        Ok(self.spec(trial))
    }

    /// Records the judged rollout of the trial under review: `suggestion` is its row before the verdict. Returns the trial's
    /// value, with its verdict in the row, after the last rollout; none while others are to be done.
    pub(super) fn judge_repeat(
        &mut self,
        trial: u32,
        seed: u64,
        suggestion: TrialRecord,
    ) -> Result<Option<f64>, RequestRefusal> {
        let wanted = self.plan.control.repeats;
        let Some(row) = self.rows.get_mut(&trial) else { return not_now("no trial is under review") };
        let TrialRecord { verdict, judged_by, value, cause, measured, .. } = row.clone();
        row.repeats.push(RepeatRecord { seed, verdict, judged_by, value, cause, measured });
        if row.counted_repeats() >= wanted {
            let judged = row.repeats.iter().filter_map(|repeat| Some((repeat.verdict?, repeat.value)));
            let counted: Vec<_> = judged.filter(|(verdict, _)| *verdict != Verdict::Void).collect();
            let (verdict, mean, cause) = objective::judge_repeats(&counted);
            (row.verdict, row.suggested, row.value, row.cause) = (Some(verdict), Some(verdict), mean, cause);
            // A rollout of an earlier version has no origin of its verdict.
            let operators = row.repeats.iter().any(|repeat| repeat.judged_by == Some(JudgedBy::Operator));
            row.judged_by = if operators { Some(JudgedBy::Operator) } else { judged_by };
            return Ok(mean);
        }
        let repeats = row.repeats.clone();
        (row.verdict, row.suggested, row.value, row.hand_value, row.measured) = (None, None, None, None, None);
        (row.judged_by, row.cause) = (None, String::new());
        if let Err(error) = self.study.annotate(trial, &attributes::write(&RepeatsAttribute { repeats: &repeats })) {
            self.rows.insert(trial, suggestion);
            return match error {
                StudyError::State { .. } => {
                    self.rows.remove(&trial);
                    self.state = ExperimentState::Finished;
                    self.propose()?;
                    Err(RequestRefusal::EndedElsewhere(trial))
                }
                error => Err(error.into()),
            };
        }
        self.publish_row(trial);
        let revision = self.next_revision();
        self.enter(
            ExperimentState::BetweenRepeats(BetweenRepeats { revision, suggestion: Box::new(suggestion) }),
            trial,
        );
        self.publish_proposal();
        Ok(None)
    }

    /// Takes the verdict on the last rollout back.
    pub(super) fn undo_repeat(&mut self) -> Result<(), RequestRefusal> {
        let ExperimentState::BetweenRepeats(between) = &self.state else {
            return not_now("there is no verdict to undo");
        };
        let mut row = (*between.suggestion).clone();
        let trial = row.trial;
        self.study.annotate(trial, &attributes::write(&RepeatsAttribute { repeats: &row.repeats }))?;
        if let Some(judged) = self.rows.get(&trial) {
            row.note.clone_from(&judged.note);
        }
        self.rows.insert(trial, row);
        self.publish_row(trial);
        self.enter(ExperimentState::Review(trial), trial);
        Ok(())
    }

    /// Gives the trial up between its rollouts: it is void, its rollouts stay on record.
    pub(super) fn give_up(&mut self, trial: u32) -> Result<(), RequestRefusal> {
        let Some(row) = self.rows.get(&trial) else { return not_now(format!("there is no trial {trial}")) };
        let cause = "given up between its repeats".to_owned();
        let judged_by = Some(JudgedBy::Operator);
        let void = TrialRecord { verdict: Some(Verdict::Void), judged_by, cause, ..row.clone() };
        let judged = attributes::write(&JudgedAttributes::of(&void, false));
        let told = self.study.tell_if(trial, Outcome::Fail, &judged, &|_| true)?;
        self.state = ExperimentState::Finished;
        if told == TellOutcome::AlreadyFinished {
            self.rows.remove(&trial);
            self.propose()?;
            return Err(RequestRefusal::EndedElsewhere(trial));
        }
        self.rows.insert(trial, void);
        self.publish_row(trial);
        Ok(self.propose()?)
    }
}
