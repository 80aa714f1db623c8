//! Changes of trials: attributes, outcomes, the queue.

use jiff::Timestamp;
use serde_json::{Value, json};

use super::best::MODEL_BEST;
use super::{Outcome, Study, StudyError, TellOutcome, study_attributes, user_attributes};
use crate::optimize::journal::{Applied, Operation};
use crate::optimize::trial::{CHANGED_VERDICT, FIXED_PARAMS, Trial, TrialState, VerdictChange, json_object};

/// Parameters and user attributes of a trial to enqueue.
pub type WaitingPoint = (Vec<(String, f64)>, Vec<(String, Value)>);

impl Study {
    /// Sets user attributes of a running or waiting trial: verdict, cause, measured terms. A finished trial is immutable
    /// ([`StudyError::State`]), see [`Study::note`].
    pub fn annotate(&mut self, trial: u32, attributes: &[(String, Value)]) -> Result<(), StudyError> {
        let id = self.trial(trial)?.id;
        self.commit(|journal| match journal.trial(id) {
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
        self.tell_if(trial, outcome, &[], &|_| true)
    }

    /// Sets user attributes and finishes a trial in one commit, if `holds(trial)` is true while the journal is locked.
    /// Otherwise nothing is recorded and the answer is [`TellOutcome::AlreadyFinished`]. Errors are those of
    /// [`Study::tell`].
    pub fn tell_if(
        &mut self,
        trial: u32,
        outcome: Outcome,
        attributes: &[(String, Value)],
        holds: &dyn Fn(&Trial) -> bool,
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
        let applied = self.commit(|journal| match journal.trial(id) {
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
        let recorded = applied.last() == Some(&Applied::Accepted);
        Ok(if recorded { TellOutcome::Recorded } else { TellOutcome::AlreadyFinished })
    }

    /// Changes the verdict of a finished trial. The trial itself is immutable: the change is appended to an attribute of the
    /// study, from which this program takes state, value, verdict and cause of the trial. The stored best trial by the
    /// sampler's model becomes invalid. [`StudyError::State`] if the trial is not finished.
    pub fn change_verdict(&mut self, trial: u32, change: &VerdictChange) -> Result<(), StudyError> {
        let id = self.trial(trial)?.id;
        let (study, key) = (self.id, format!("{CHANGED_VERDICT}{trial}"));
        self.commit(|journal| match journal.trial(id) {
            Some(t) if !t.state.is_finished() => {
                Err(StudyError::State { trial, state: t.state, action: "its verdict is not final: judge it" })
            }
            _ => {
                let attributes = journal.studies().get(study).map(|record| &record.user_attributes);
                let before = attributes.and_then(|of| of.get(&key)).and_then(Value::as_array);
                let changes: Vec<Value> = before.into_iter().flatten().cloned().chain([json!(change)]).collect();
                // The verdict last: one that was cut off leaves no best trial of before.
                Ok(study_attributes(study, &[(MODEL_BEST.to_owned(), Value::Null), (key.clone(), changes.into())])
                    .collect())
            }
        })?;
        Ok(())
    }

    /// The value that a trial had when it was accepted last, before its verdict was changed; none where no change has ended that.
    pub fn formerly_accepted_value(&self, trial: u32) -> Option<f64> {
        let changes = self.attributes().get(&format!("{CHANGED_VERDICT}{trial}"))?.as_array()?;
        let accepted = changes.iter().rfind(|change| change["old_verdict"] == "accept")?;
        accepted.get("old_value")?.as_f64()
    }

    /// Enqueues a trial with the given parameters; the others are suggested when it begins. Returns its number, or
    /// [`StudyError::UnknownParameter`] or [`StudyError::Value`] for an invalid parameter.
    pub fn enqueue(&mut self, parameters: &[(String, f64)], attributes: &[(String, Value)]) -> Result<u32, StudyError> {
        let queued = self.enqueue_unless(parameters, attributes, &|_| false)?;
        queued.ok_or_else(|| StudyError::Gone(self.options.name.clone()))
    }

    /// [`Study::enqueue`] unless `done`, called with all trials while the journal is locked, returns true: of several workers
    /// only one enqueues. Returns `None` if `done` was true.
    pub fn enqueue_unless(
        &mut self,
        parameters: &[(String, f64)],
        attributes: &[(String, Value)],
        done: &dyn Fn(&[Trial]) -> bool,
    ) -> Result<Option<u32>, StudyError> {
        let create = self.queued(parameters, attributes)?;
        let study = self.id;
        let applied = self.commit(|journal| {
            let needed = journal.studies().get(study).is_some_and(|record| !done(&record.trials));
            Ok(if needed { vec![create.clone()] } else { Vec::new() })
        })?;
        Ok(self.created(&applied).next())
    }

    /// Enqueues trials in this order, all or none, each with its parameters and user attributes, as [`Study::enqueue`]. Returns
    /// their numbers.
    pub fn enqueue_all(&mut self, points: &[WaitingPoint]) -> Result<Vec<u32>, StudyError> {
        let creations = points.iter().map(|(parameters, attributes)| self.queued(parameters, attributes));
        let creations = creations.collect::<Result<Vec<_>, _>>()?;
        let applied = self.commit(|_| Ok(creations.clone()))?;
        Ok(self.created(&applied).collect())
    }

    /// The operation that enqueues a trial.
    fn queued(&self, parameters: &[(String, f64)], attributes: &[(String, Value)]) -> Result<Operation, StudyError> {
        self.check_parameters(parameters)?;
        let template = Trial {
            state: TrialState::Waiting,
            user_attributes: attributes.iter().cloned().collect(),
            system_attributes: [(FIXED_PARAMS.to_owned(), json_object(parameters))].into(),
            ..Trial::default()
        };
        Ok(Operation::CreateTrial { study: self.id, started: None, template: Some(Box::new(template)) })
    }

    /// Sets user attributes of the study.
    pub fn annotate_study(&mut self, attributes: &[(String, Value)]) -> Result<(), StudyError> {
        let study = self.id;
        self.commit(|_| Ok(study_attributes(study, attributes).collect()))?;
        Ok(())
    }
}
