//! Trials that were run elsewhere join the study.

use super::{Study, StudyError};
use crate::optimize::exchange::TableTrial;
use crate::optimize::journal::{Effect, JournalError, Operation, Template};
use crate::optimize::trial::{Distribution, TrialState};

impl Study {
    /// Adds finished trials as they are, all or none, with the present bounds: the samplers learn from them as from any
    /// other. Returns their numbers.
    ///
    /// # Errors
    /// [`StudyError::State`] for a trial that is not finished, [`StudyError::UnknownParameter`], [`StudyError::Value`] or
    /// [`StudyError::Outside`] for a parameter that cannot be; nothing is added then.
    pub fn import(&mut self, trials: &[TableTrial]) -> Result<Vec<u32>, StudyError> {
        let mut operations = Vec::new();
        for (row, trial) in (1..).zip(trials) {
            if !trial.state.is_finished() {
                let action = "it cannot be added as a result: queue it, or leave it out";
                return Err(StudyError::State { trial: row, state: trial.state, action });
            }
            self.check_point(&trial.parameters)?;
            let parameter = |(name, value): &(String, f64)| {
                let range = self.options.space.range(name)?;
                Some((name.clone(), *value, Distribution::Float(range)))
            };
            let template = Template {
                state: trial.state,
                values: trial.value.filter(|_| trial.state != TrialState::Fail).map(|value| vec![value]),
                completed: trial.completed.or(trial.started).or_else(|| Some(jiff::Timestamp::now())),
                parameters: trial.parameters.iter().filter_map(parameter).collect(),
                user_attributes: trial.attributes.clone(),
                system_attributes: serde_json::Map::new(),
                intermediate: Vec::new(),
            };
            let started = trial.started.or(template.completed);
            operations.push(Operation::CreateTrial { study: self.id, started, template: Some(Box::new(template)) });
        }
        let effects = self.journal.commit(|_| Ok::<_, JournalError>(operations.clone()))?;
        let created = effects.iter().filter_map(|effect| match effect {
            Effect::Created(id) => self.journal.replay().trial(*id).map(|trial| trial.number),
            _ => None,
        });
        Ok(created.collect())
    }

    /// Whether the parameters of a point exist and lie within the present bounds.
    ///
    /// # Errors
    /// [`StudyError::UnknownParameter`], [`StudyError::Value`] or [`StudyError::Outside`].
    pub fn check_point(&self, point: &[(String, f64)]) -> Result<(), StudyError> {
        self.check_parameters(point)?;
        let outside = point.iter().find_map(|(name, value)| {
            let range = self.options.space.range(name).filter(|range| !range.contains(*value))?;
            Some(StudyError::Outside { parameter: name.clone(), value: *value, low: range.low, high: range.high })
        });
        outside.map_or(Ok(()), Err)
    }
}
