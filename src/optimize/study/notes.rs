//! The operator's notes on trials, where optuna-dashboard keeps them: attributes of the study, so that a finished trial can
//! have one too.

use super::{Study, StudyError};
use crate::optimize::journal::{JournalError, Operation};
use serde_json::Value;

/// The dashboard reads notes in pieces of this many characters.
const NOTE_PIECE: usize = 2045;

impl Study {
    /// Writes the note (Markdown) that the dashboard shows with a trial; finished trials can have one too. Replaces an
    /// earlier note.
    ///
    /// # Errors
    /// [`StudyError::UnknownTrial`], or journal errors.
    pub fn note(&mut self, trial: u32, text: &str) -> Result<(), StudyError> {
        let id = self.trial(trial)?.id;
        let study = self.id;
        self.journal.commit(|replay| {
            let attributes = &replay.studies()[study].system_attributes;
            let version = format!("dashboard:{id}:note_ver");
            let next = attributes.get(&version).and_then(Value::as_u64).map_or(1, |v| v + 1);
            let characters: Vec<char> = text.chars().collect();
            let mut pieces: Vec<String> = characters.chunks(NOTE_PIECE).map(|c| c.iter().collect()).collect();
            let key = |i: usize| format!("dashboard:{id}:note_str:{i}");
            while attributes.contains_key(&key(pieces.len())) {
                pieces.push(String::new()); // pieces of a longer note that was here before
            }
            let set = |key, value| Operation::StudySystemAttribute { study, key, value };
            let pieces = pieces.into_iter().enumerate().map(|(i, piece)| set(key(i), Value::from(piece)));
            Ok::<_, JournalError>(std::iter::once(set(version.clone(), Value::from(next))).chain(pieces).collect())
        })?;
        Ok(())
    }

    /// The note of a trial, empty if it has none.
    pub fn note_of(&self, trial: u32) -> String {
        let Ok(trial) = self.trial(trial) else { return String::new() };
        let attributes = &self.record().system_attributes;
        let piece = |i| attributes.get(&format!("dashboard:{}:note_str:{i}", trial.id))?.as_str();
        (0..).map_while(piece).collect()
    }
}
