//! Changes of trials: attributes, outcomes, the queue.

use jiff::Timestamp;
use serde_json::{Map, Value};

use super::{Outcome, Study, StudyError, TellOutcome, user_attributes};
use crate::optimize::journal::{Applied, JournalError, Operation, TrialTemplate};
use crate::optimize::trial::{Trial, TrialState};

impl Study {
    /// Sets user attributes of a running or waiting trial: verdict, cause, measured terms.
    ///
    /// # Errors
    /// [`StudyError::State`] if the trial is finished and thus immutable; use [`Study::note`].
    pub fn annotate(&mut self, trial: u32, attributes: &[(String, Value)]) -> Result<(), StudyError> {
        let id = self.trial(trial)?.id;
        self.journal.commit(|journal| match journal.trial(id) {
            Some(t) if t.state.is_finished() => Err(StudyError::State {
                trial,
                state: t.state,
                action: "its attributes are final: write a note instead",
            }),
            _ => Ok(user_attributes(id, attributes).collect()),
        })?;
        Ok(())
    }

    /// Finishes a trial. Returns [`TellOutcome::AlreadyFinished`] if another writer has finished it.
    ///
    /// # Errors
    /// [`StudyError::Value`] if the value is not a number; [`StudyError::State`] if the trial has not begun.
    pub fn tell(&mut self, trial: u32, outcome: Outcome) -> Result<TellOutcome, StudyError> {
        self.tell_if(trial, outcome, &[], |_| true)
    }

    /// Sets user attributes and finishes a trial in one commit, if `holds(trial)` is true while the journal is locked.
    /// Otherwise nothing is recorded and the answer is [`TellOutcome::AlreadyFinished`].
    ///
    /// # Errors
    /// As [`Study::tell`].
    pub fn tell_if(
        &mut self,
        trial: u32,
        outcome: Outcome,
        attributes: &[(String, Value)],
        holds: impl Fn(&Trial) -> bool,
    ) -> Result<TellOutcome, StudyError> {
        let id = self.trial(trial)?.id;
        let (state, values) = match outcome {
            Outcome::Complete(value) if value.is_nan() => {
                let quantity = format!("the value of trial {trial}");
                return Err(StudyError::Value { quantity, value, expected: "number, or end the trial as failed" });
            }
            Outcome::Complete(value) => (TrialState::Complete, Some(vec![value])),
            Outcome::Fail => (TrialState::Fail, None),
        };
        let applied = self.journal.commit(|journal| match journal.trial(id) {
            Some(t) if t.state.is_finished() => Ok(Vec::new()),
            Some(t) if t.state == TrialState::Waiting && outcome != Outcome::Fail => {
                Err(StudyError::State { trial, state: t.state, action: "it cannot have a value: begin it first" })
            }
            Some(t) if !holds(t) => Ok(Vec::new()),
            _ => {
                let end = Operation::SetState { trial: id, state, values: values.clone(), at: Some(Timestamp::now()) };
                // Attributes first: a finished trial is immutable.
                Ok(user_attributes(id, attributes).chain([end]).collect())
            }
        })?;
        Ok(if applied.last() == Some(&Applied::Accepted) {
            TellOutcome::Recorded
        } else {
            TellOutcome::AlreadyFinished
        })
    }

    /// Enqueues a trial with the given parameters; the others are suggested when it begins. Returns its number.
    ///
    /// # Errors
    /// [`StudyError::UnknownParameter`] or [`StudyError::Value`] for an invalid parameter.
    pub fn enqueue(&mut self, parameters: &[(String, f64)], attributes: &[(String, Value)]) -> Result<u32, StudyError> {
        let queued = self.enqueue_unless(parameters, attributes, |_| false)?;
        queued.ok_or_else(|| StudyError::Gone(self.options.name.clone()))
    }

    /// [`Study::enqueue`] unless `done`, called with all trials while the journal is locked, returns true: of several workers
    /// only one enqueues. Returns `None` if `done` was true.
    ///
    /// # Errors
    /// As [`Study::enqueue`].
    pub fn enqueue_unless(
        &mut self,
        parameters: &[(String, f64)],
        attributes: &[(String, Value)],
        done: impl Fn(&[Trial]) -> bool,
    ) -> Result<Option<u32>, StudyError> {
        self.check_parameters(parameters)?;
        let fixed: Map<String, Value> = parameters.iter().map(|(n, v)| (n.clone(), Value::from(*v))).collect();
        let user: Map<String, Value> = attributes.iter().cloned().collect();
        let template = Some(Box::new(TrialTemplate::waiting(fixed, user)));
        let study = self.id;
        let create = Operation::CreateTrial { study, started: None, template };
        let applied = self.journal.commit(|journal| {
            let needed = journal.studies().get(study).is_some_and(|record| !done(&record.trials));
            Ok::<_, JournalError>(if needed { vec![create.clone()] } else { Vec::new() })
        })?;
        let created = applied.iter().find_map(|e| if let Applied::Created(id) = e { Some(*id) } else { None });
        Ok(created.and_then(|id| self.journal.state().trial(id)).map(|t| t.number))
    }

    /// Sets user attributes of the study.
    ///
    /// # Errors
    /// Journal errors.
    pub fn annotate_study(&mut self, attributes: &[(String, Value)]) -> Result<(), StudyError> {
        let study = self.id;
        let set = |(key, value): &(String, Value)| {
            let (key, value) = (key.clone(), value.clone());
            Operation::StudyUserAttribute { study, key, value }
        };
        self.journal.commit(|_| Ok::<_, JournalError>(attributes.iter().map(set).collect()))?;
        Ok(())
    }
}
