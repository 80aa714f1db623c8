//! What becomes of trials: attributes, outcomes, the queue.

use jiff::Timestamp;
use serde_json::{Map, Value};

use super::{Outcome, Study, StudyError, Told, user_attributes};
use crate::optimize::journal::{Effect, JournalError, Operation, Template};
use crate::optimize::trial::{Trial, TrialState};

impl Study {
    /// Sets user attributes of a trial that is running or waiting: verdict, cause, measured terms.
    ///
    /// # Errors
    /// [`StudyError::State`] if the trial is finished, for nothing of it can change then; use [`Study::note`].
    pub fn annotate(&mut self, trial: u32, attributes: &[(String, Value)]) -> Result<(), StudyError> {
        let id = self.trial(trial)?.id;
        self.journal.commit(|replay| match replay.trial(id) {
            Some(t) if t.state.is_finished() => Err(StudyError::State {
                trial,
                state: t.state,
                action: "its attributes cannot change any more: write a note instead",
            }),
            _ => Ok(user_attributes(id, attributes).collect()),
        })?;
        Ok(())
    }

    /// Ends a trial. If somebody else has ended it meanwhile, theirs stands and [`Told::AlreadyFinished`] says so.
    ///
    /// # Errors
    /// [`StudyError::Value`] if the value is not a number; [`StudyError::State`] if the trial has not begun.
    pub fn tell(&mut self, trial: u32, outcome: Outcome) -> Result<Told, StudyError> {
        self.tell_if(trial, outcome, &[], |_| true)
    }

    /// [`Study::tell`] together with last user attributes, if `holds` says, of the trial at the very moment, that what the
    /// outcome was concluded from still holds: nobody sees the one without the other. Where it does not hold any more
    /// nothing is recorded and [`Told::AlreadyFinished`] says so.
    ///
    /// # Errors
    /// As [`Study::tell`].
    pub fn tell_if(
        &mut self,
        trial: u32,
        outcome: Outcome,
        attributes: &[(String, Value)],
        holds: impl Fn(&Trial) -> bool,
    ) -> Result<Told, StudyError> {
        let id = self.trial(trial)?.id;
        let (state, values) = match outcome {
            Outcome::Complete(value) if value.is_nan() => {
                let what = format!("the value of trial {trial}");
                return Err(StudyError::Value { what, value, expected: "number, or end the trial as failed" });
            }
            Outcome::Complete(value) => (TrialState::Complete, Some(vec![value])),
            Outcome::Fail => (TrialState::Fail, None),
        };
        let effects = self.journal.commit(|replay| match replay.trial(id) {
            Some(t) if t.state.is_finished() => Ok(Vec::new()),
            Some(t) if t.state == TrialState::Waiting && outcome != Outcome::Fail => {
                Err(StudyError::State { trial, state: t.state, action: "it cannot have a value yet: begin it first" })
            }
            Some(t) if !holds(t) => Ok(Vec::new()),
            _ => {
                let end = Operation::SetState { trial: id, state, values: values.clone(), at: Some(Timestamp::now()) };
                // A finished trial takes no attributes any more: they come first.
                Ok(user_attributes(id, attributes).chain([end]).collect())
            }
        })?;
        Ok(if effects.last() == Some(&Effect::Accepted) { Told::Recorded } else { Told::AlreadyFinished })
    }

    /// Queues a trial with the given parameters; those that are not given will be suggested when it is its turn. Returns
    /// its number.
    ///
    /// # Errors
    /// [`StudyError::UnknownParameter`] or [`StudyError::Value`] for a parameter that cannot be.
    pub fn enqueue(&mut self, parameters: &[(String, f64)], attributes: &[(String, Value)]) -> Result<u32, StudyError> {
        let queued = self.enqueue_unless(parameters, attributes, |_| false)?;
        queued.ok_or_else(|| StudyError::Gone(self.options.name.clone()))
    }

    /// [`Study::enqueue`] unless `done` says, of all trials at the very moment, that it is not needed any more: of several
    /// programs that see the same need one queues. None if it was not needed.
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
        let template = Some(Box::new(Template::waiting(fixed, user)));
        let study = self.id;
        let create = Operation::CreateTrial { study, started: None, template };
        let effects = self.journal.commit(|replay| {
            let needed = replay.studies().get(study).is_some_and(|record| !done(&record.trials));
            Ok::<_, JournalError>(if needed { vec![create.clone()] } else { Vec::new() })
        })?;
        let created = effects.iter().find_map(|e| if let Effect::Created(id) = e { Some(*id) } else { None });
        Ok(created.and_then(|id| self.journal.replay().trial(id)).map(|t| t.number))
    }

    /// Sets user attributes of the study itself.
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
