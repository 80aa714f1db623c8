//! What a program that ended in mid-trial has left behind: judged trials count, others are void and come again.
//!
//! Whose trial is whose: the session that has the study's folder (worker 0) closes at its start the trials that worker 0
//! began, for it is the only one. Trials of joined workers are closed by whoever has seen them run for longer than any
//! simulated trial takes (`[workers] abandoned_s`). Trials of other programs are left to those.

use super::attributes::{self, Origin};
use super::confirming::Next;
use super::watch::Watch;
use crate::optimize::study::{Outcome, StudyError, Told};
use crate::optimize::trial::{Trial, TrialState};
use crate::recording::record::Record;
use crate::session::experiment::{Experiment, RequestRefusal};
use crate::trial::{ExperimentStage, ProposalSource, Verdict};

impl Experiment {
    /// What a crash of this session's forerunner left behind.
    pub(super) fn close_interrupted(&mut self) -> Result<(), StudyError> {
        let me = self.plan.worker;
        let left = |trial: &&Trial| me == 0 && attributes::worker_of(trial) == Some(0);
        let running: Vec<Trial> = self.study.running().filter(left).cloned().collect();
        for trial in running {
            self.close_trial(&trial, "interrupted: the program ended before the verdict")?;
        }
        self.queue_owed()
    }

    /// The session ends: a trial that ended without being one (its operator is gone, it was stopped) is void with its cause
    /// and comes again, as after a crash. Any other keeps waiting for a verdict until the study is opened again.
    ///
    /// # Errors
    /// When the study cannot be read or written.
    pub fn leave(&mut self) -> Result<(), StudyError> {
        let number = self.current;
        let Some(row) = self.rows.get_mut(&number) else { return Ok(()) };
        if self.stage != ExperimentStage::Review || row.suggested != Some(Verdict::Void) {
            return Ok(());
        }
        row.verdict = Some(Verdict::Void);
        let cause = row.cause.clone();
        self.show_row(number);
        let trial = self.study.running().find(|trial| trial.number == number).cloned();
        self.stage = ExperimentStage::Finished;
        match trial {
            Some(trial) => self.close_trial(&trial, &cause)?,
            None => return Ok(()),
        }
        self.queue_owed()
    }

    /// Closes what joined workers have left behind that are dead by now.
    pub(super) fn close_abandoned(&mut self) -> Result<(), StudyError> {
        self.watch.observe(self.study.trials());
        let theirs = |trial: &&Trial| attributes::worker_of(trial).is_some_and(|worker| worker > 0);
        let dead = |trial: &&Trial| theirs(trial) && !self.is_mine(trial) && !self.watch.is_alive(trial);
        let dead: Vec<Trial> = self.study.running().filter(dead).cloned().collect();
        if dead.is_empty() {
            return Ok(());
        }
        for trial in dead {
            self.close_trial(&trial, "interrupted: its worker has not ended it in time")?;
        }
        self.queue_owed()
    }

    /// Whether this session runs the trial, or has judged it and not told it yet.
    fn is_mine(&self, trial: &Trial) -> bool {
        attributes::worker_of(trial) == Some(self.plan.worker) && trial.worker == self.study.worker()
    }

    /// Whether other workers run trials: until they end it is not known whether the study is finished. Trials that
    /// nobody has ended in time are not waited for.
    pub fn others_run(&self) -> bool {
        self.study.running().any(|trial| !self.is_mine(trial) && self.watch.is_alive(trial))
    }

    fn close_trial(&mut self, trial: &Trial, cause: &str) -> Result<(), StudyError> {
        let (outcome, last, words) = match attributes::judgement_of(trial) {
            Some(outcome) => (outcome, Vec::new(), "judged before the interruption: it counts"),
            // Queued again by the caller, or by the next session if this one is killed before it gets there.
            None => (Outcome::Fail, attributes::interrupted(cause), "interrupted: it is void and queued again"),
        };
        // Judged at this very moment it is not dead after all.
        let unchanged = |now: &Trial| now.user_attributes == trial.user_attributes;
        if self.study.tell_if(trial.number, outcome, &last, unchanged)? == Told::Recorded {
            self.log(format!("trial {} was {words}", trial.number));
        }
        Ok(())
    }

    /// Queues void trials whose parameters were to come again, and did not get to.
    fn queue_owed(&mut self) -> Result<(), StudyError> {
        let owed: Vec<Trial> = self.study.trials().iter().filter(|trial| attributes::is_owed(trial)).cloned().collect();
        for trial in owed {
            let origin = if attributes::was_interrupted(&trial) {
                // The same seed as before: the study goes on as if nothing had happened.
                Origin::interrupted(&trial)
            } else {
                self.rerun_of(trial.number)?.1
            };
            self.queue_again(trial.number, &trial.parameters, &origin)?;
        }
        Ok(())
    }

    /// Queues what trial `parent` is owed, once: another program may have seen the debt first, and the trial that it has queued
    /// is then the one. Its number.
    pub(super) fn queue_again(
        &mut self,
        parent: u32,
        parameters: &[(String, f64)],
        origin: &Origin,
    ) -> Result<Option<u32>, StudyError> {
        let comes = |other: &Trial| Origin::of(&other.user_attributes).parent == Some(parent);
        let queued = self.study.enqueue_unless(parameters, &origin.attributes(), |trials| trials.iter().any(comes))?;
        Ok(queued.or_else(|| self.study.trials().iter().find(|trial| comes(trial)).map(|trial| trial.number)))
    }

    /// Takes in what other programs have done: their trials join the table, and a point that they have queued comes next
    /// if the operator has not changed the card. To be called now and then.
    ///
    /// # Errors
    /// When the study cannot be read or written.
    pub fn look(&mut self) -> Result<(), RequestRefusal> {
        if !self.is_idle() {
            return Ok(());
        }
        self.study.refresh()?;
        self.close_abandoned()?;
        self.take_rows();
        let Some(card) = &self.card else {
            let room = occupied(self.study.trials(), &self.watch) < self.plan.budget;
            let queued = self.study.waiting().any(|trial| attributes::source_of(trial) == ProposalSource::Confirm);
            // A repeat that another worker had taken has come to nothing, or was the last.
            let confirms = self.pending.is_none() && !matches!(self.next_repeat(&self.study), Next::Nothing);
            return if room || queued || confirms { Ok(self.propose()?) } else { Ok(()) };
        };
        let next = self.study.waiting().next().map(|trial| trial.number);
        // A re-run of our own waits in the outlook alone: its number there means nothing in the study.
        let on_the_table = (card.draft.enqueued && !card.in_outlook_alone).then_some(card.number());
        if next != on_the_table && !card.is_changed() {
            self.log("another program has changed the queue: here is what comes next".to_owned());
            self.propose()?;
        }
        Ok(())
    }

    /// Rows of trials that other programs have run or are running.
    pub(super) fn take_rows(&mut self) {
        for trial in self.study.trials() {
            let news = match self.rows.get(&trial.number) {
                None => trial.state != TrialState::Waiting,
                Some(row) => trial.state.is_finished() && row.verdict.is_none(),
            };
            if news {
                let row = attributes::row_of(trial, self.study.note_of(trial.number), &self.plan.parameters);
                self.outbox.push(Record::Trial(row.clone()));
                self.rows.insert(trial.number, row);
            }
        }
    }
}

/// How many of `trials` take a place of the budget: those that count, and those that run and may still count.
pub(super) fn occupied(trials: &[Trial], watch: &Watch) -> u32 {
    let takes = |trial: &&Trial| match trial.state {
        TrialState::Complete => true,
        // A person may take any time to judge; the session that has the folder closes its own.
        TrialState::Running => attributes::worker_of(trial) == Some(0) || watch.is_alive(trial),
        _ => false,
    };
    let budgeted = |trial: &&Trial| attributes::source_of(trial) != ProposalSource::Confirm;
    trials.iter().filter(takes).filter(budgeted).count() as u32
}
