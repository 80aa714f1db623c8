//! Import of trials that were run elsewhere.

use jiff::Timestamp;

use super::{Study, StudyError};
use crate::optimize::exchange::TableTrial;
use crate::optimize::journal::Operation;
use crate::optimize::trial::{Distribution, Trial, TrialState};

impl Study {
    /// Adds finished trials, all or none, with the present bounds; the samplers learn from them as from any other. A row
    /// that matches a trial of the study (parameters, value and, if given, times) is left out, so that a second import of
    /// the same table adds no repeats. Each trial matches one row. Returns the numbers of the added trials.
    ///
    /// # Errors
    /// [`StudyError::State`] for a trial that is not finished, [`StudyError::UnknownParameter`], [`StudyError::Value`] or
    /// [`StudyError::Outside`] for an invalid parameter; nothing is added then.
    pub fn import(&mut self, trials: &[TableTrial]) -> Result<Vec<u32>, StudyError> {
        let mut creations = Vec::new();
        for (row, trial) in (1..).zip(trials) {
            if !trial.state.is_finished() {
                let action = "it cannot be added as a result: queue it, or leave it out";
                return Err(StudyError::State { trial: row, state: trial.state, action });
            }
            self.check_point(&trial.parameters)?;
            let range = |(name, _): &(String, f64)| self.options.space.range(name).map(Distribution::Float);
            let template = Trial {
                state: trial.state,
                value: trial.value.filter(|_| trial.state != TrialState::Fail),
                completed: trial.completed.or(trial.started).or_else(|| Some(Timestamp::now())),
                parameters: trial.parameters.clone(),
                distributions: trial.parameters.iter().filter_map(range).collect(),
                user_attributes: trial.attributes.clone().into_iter().collect(),
                ..Trial::default()
            };
            let started = trial.started.or(template.completed);
            let create = Operation::CreateTrial { study: self.id, started, template: Some(Box::new(template)) };
            creations.push((trial, create));
        }
        let study = self.id;
        let applied = self.commit(|journal| {
            let mut there: Vec<&Trial> = journal.studies().get(study).map_or(Vec::new(), |s| s.trials.iter().collect());
            let mut is_new = |row: &TableTrial| match there.iter().position(|trial| is_same(row, trial)) {
                // A trial matches one row.
                Some(place) => {
                    there.swap_remove(place);
                    false
                }
                None => true,
            };
            let new = creations.iter().filter(|(row, _)| is_new(row)).map(|(_, create)| create.clone());
            Ok(new.collect())
        })?;
        let created: Vec<u32> = self.created(&applied).collect();
        let mut noted: Vec<&TableTrial> = trials.iter().filter(|row| !row.note.is_empty()).collect();
        for number in &created {
            let trial = self.trial(*number)?;
            if let Some(place) = noted.iter().position(|row| is_same(row, trial)) {
                self.note(*number, &noted.swap_remove(place).note)?;
            }
        }
        Ok(created)
    }

    /// Checks that the parameters of a point exist and lie within the present bounds.
    pub fn check_point(&self, point: &[(String, f64)]) -> Result<(), StudyError> {
        self.check_parameters(point)?;
        let outside = point.iter().find_map(|(name, value)| {
            let range = self.options.space.range(name).filter(|range| !range.contains(*value))?;
            Some(StudyError::Outside { parameter: name.clone(), value: *value, low: range.low, high: range.high })
        });
        outside.map_or(Ok(()), Err)
    }
}

/// Whether a row of a table matches a trial. Times are compared to the microsecond, the resolution of the journal.
fn is_same(row: &TableTrial, trial: &Trial) -> bool {
    let value = row.value.filter(|_| row.state != TrialState::Fail);
    let point = row.parameters.len() == trial.parameters.len()
        && row.parameters.iter().all(|(name, value)| trial.parameter(name) == Some(*value));
    // One of two times stands for both, as it does for what is imported: a queued trial that was removed has never begun.
    let times_of = |started: Option<Timestamp>, completed: Option<Timestamp>| {
        [started.or(completed), completed.or(started)].map(|at| at.map(Timestamp::as_microsecond))
    };
    let given = times_of(row.started, row.completed);
    let times = given == [None, None] || given == times_of(trial.started, trial.completed);
    row.state == trial.state && value == trial.value && point && times
}
