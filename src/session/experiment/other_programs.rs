//! Changes of the study by other programs: their trials, their results, and what they have queued.

use super::confirmation::NextRepeat;
use super::queue_changes::queued_points;
use super::{Experiment, ExperimentState, RequestRefusal, attributes};
use crate::optimize::study::{Study, StudyError};
use crate::optimize::trial::TrialState;
use crate::recording::record::Record;
use crate::trial::QueuedPoint;

impl Experiment {
    /// Sees what other programs have changed a moment ago before a proposal of the sampler becomes a trial: a queued point comes
    /// first, or takes the number of a proposal that the operator has changed; the last trial may have been run. A queued proposal
    /// has its number already.
    pub(super) fn see_the_queue(&mut self, trial: u32, revision: u32) -> Result<(), RequestRefusal> {
        let is_open = |experiment: &Experiment| match &experiment.state {
            ExperimentState::Proposed(open) => !open.is_queued() && open.must_be(trial, revision).is_ok(),
            _ => false,
        };
        if is_open(self) {
            self.refresh()?;
            if !is_open(self) {
                return Err(RequestRefusal::Overtaken(trial));
            }
        }
        Ok(())
    }

    /// Records the changes of other programs: their trials join the table, and a point that they have queued is proposed
    /// next if the operator has not changed the proposal. During a trial only the queue is published. To be called regularly.
    pub fn refresh(&mut self) -> Result<(), RequestRefusal> {
        if matches!(self.state, ExperimentState::AwaitsPrior) {
            return Ok(());
        }
        self.study.refresh()?;
        if !self.is_idle() {
            return Ok(self.publish_changes()?);
        }
        let log = self.queue.close_abandoned(&mut self.study)?;
        self.log_all(log);
        let results = self.take_rows();
        match &self.state {
            ExperimentState::Proposed(open) => {
                let next = self.next_in_study();
                let full = |study: &Study| self.queue.occupied(study.trials()) >= self.plan.budget;
                // The journal does not have the last verdict yet.
                if full(&self.study) && !open.approved().is_beyond_budget() && full(&self.study_with_verdict()?) {
                    self.log("other workers have run the trials that were left".to_owned());
                    self.propose()?;
                } else if (next != open.waits_as() || open.is_exchanged_in(&self.study)) && !open.is_changed() {
                    self.warn("another program has changed the queue: another point is proposed".to_owned());
                    self.propose()?;
                } else {
                    self.renumber()?;
                    if results {
                        self.see_results()?;
                    }
                }
                self.publish_changes()?;
            }
            _ => {
                let room = self.queue.occupied(self.study.trials()) < self.plan.budget;
                let queued = self.study.waiting().any(attributes::confirms);
                // A repeat of another worker may have been void, or may have been the last.
                let confirms =
                    self.pending_verdict.is_none() && !matches!(self.confirmation.next(&self.study), NextRepeat::None);
                if room || queued || confirms || results {
                    self.propose()?;
                }
                if results {
                    self.store_model_best()?;
                }
                self.publish_changes()?;
            }
        }
        Ok(())
    }

    /// Gives the open proposal the number that its trial will have: another program has added trials. Its values and its revision
    /// stay, and with them a question that is open.
    fn renumber(&mut self) -> Result<(), StudyError> {
        let next = self.first_after_rerun().unwrap_or(self.study.trials().len() as u32);
        let ExperimentState::Proposed(open) = &self.state else { return Ok(()) };
        if open.waits_as().is_some() || open.number() == next {
            return Ok(());
        }
        self.rename_kept_changes(next)?;
        let ExperimentState::Proposed(open) = &mut self.state else { return Ok(()) };
        open.set_number(next);
        if open.is_changed() {
            self.warn(format!("another program has added trials: {}", self.overrides_in_words()));
        }
        self.publish_proposal();
        self.publish_stage(next);
        Ok(())
    }

    /// Publishes trials of other workers, and what another program has changed behind the next point of the queue. The proposal
    /// stays.
    pub(super) fn publish_changes(&mut self) -> Result<(), StudyError> {
        let stored = self.study.trials().len();
        let shown = self.published_search.iter().flat_map(|search| &search.queue);
        // Beyond them are a re-run and a repeat of the best that the study does not have yet.
        let shown: Vec<&QueuedPoint> = shown.filter(|point| (point.trial as usize) < stored).collect();
        let counted = self.published_search.as_ref().map(|search| search.counted);
        if counted != Some(self.counted()) || !queued_points(&self.study).iter().eq(shown) {
            let study = self.study_with_verdict()?;
            self.publish_search(&study);
        }
        Ok(())
    }

    /// Shows what the results of other programs say of the open proposal. Its values and its revision stay.
    fn see_results(&mut self) -> Result<(), StudyError> {
        let mut study = self.study_with_verdict()?;
        let model = study.predict();
        self.model_best = model.best;
        self.draw_inside_envelope(&mut study);
        self.outbox.extend(self.confirmation.changed_points(&study).map(Record::Points));
        let ExperimentState::Proposed(open) = &mut self.state else { return Ok(()) };
        open.see(study);
        self.outbox.push(Record::Insight(open.insight(&model)));
        self.publish_proposal();
        self.store_model_best()
    }

    /// Adds the trials that other programs have run or are running to the table. Returns whether there are new results.
    pub(super) fn take_rows(&mut self) -> bool {
        let mut results = false;
        for trial in self.study.trials() {
            let news = match self.rows.get(&trial.number) {
                None => trial.state != TrialState::Waiting,
                // A verdict that the other program could still take back is in the row already.
                Some(row) => {
                    trial.state.is_finished() && (self.running_elsewhere.remove(&trial.number) || row.verdict.is_none())
                }
            };
            if news {
                if !trial.state.is_finished() {
                    self.running_elsewhere.insert(trial.number);
                }
                let row = attributes::row_of(trial, self.study.note_of(trial.number), &self.plan.parameters);
                self.outbox.push(Record::Trial(row.clone()));
                self.rows.insert(trial.number, row);
                results |= trial.state.is_observed();
            }
        }
        results
    }
}
