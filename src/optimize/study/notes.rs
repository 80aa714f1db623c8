//! The operator's notes on trials, stored as by optuna-dashboard: in attributes of the study, which can change after the
//! end of a trial.

use super::{Study, StudyError};
use crate::optimize::journal::{AttributeKind, Operation};
use crate::optimize::trial::pieces;
use serde_json::Value;

impl Study {
    /// Writes or replaces the note (Markdown) that the dashboard shows with a trial, also with a finished one.
    pub fn note(&mut self, trial: u32, text: &str) -> Result<(), StudyError> {
        let id = self.trial(trial)?.id;
        let study = self.id;
        self.commit(|journal| {
            let attributes = &journal.studies()[study].system_attributes;
            let version = format!("dashboard:{id}:note_ver");
            let next = attributes.get(&version).and_then(Value::as_u64).map_or(1, |v| v + 1);
            let mut pieces = pieces(text);
            let key = |i: usize| format!("dashboard:{id}:note_str:{i}");
            while attributes.contains_key(&key(pieces.len())) {
                pieces.push(String::new()); // left over from a longer note
            }
            let set = |key: &str, value| Operation::study_attribute(study, AttributeKind::System, key, value);
            let pieces = pieces.into_iter().enumerate().map(|(i, piece)| set(&key(i), Value::from(piece)));
            Ok(std::iter::once(set(&version, Value::from(next))).chain(pieces).collect())
        })?;
        Ok(())
    }

    /// The note of a trial, or an empty text.
    pub fn note_of(&self, trial: u32) -> String {
        let Ok(trial) = self.trial(trial) else { return String::new() };
        let attributes = &self.record().system_attributes;
        let piece = |i| attributes.get(&format!("dashboard:{}:note_str:{i}", trial.id))?.as_str();
        (0..).map_while(piece).collect()
    }
}
