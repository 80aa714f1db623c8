//! Errors of a study.

use crate::optimize::journal::JournalError;
use crate::optimize::trial::TrialState;

/// Errors of a study.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The journal could not be read or written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The stored study has another direction.
    #[error(
        "study `{name}` is stored with direction {stored}, not {asked}: keep that direction, or choose another name"
    )]
    Direction {
        /// Name of the study.
        name: String,
        /// Stored direction.
        stored: String,
        /// Direction of the options.
        asked: &'static str,
    },
    /// The stored scale of a parameter differs.
    #[error(
        "study `{name}`: parameter `{parameter}` is stored as {stored}, not {asked}; only its bounds may change within a study: choose another study name"
    )]
    Incompatible {
        /// Name of the study.
        name: String,
        /// Name of the parameter.
        parameter: String,
        /// Stored kind.
        stored: String,
        /// Kind in the present space.
        asked: &'static str,
    },
    /// An unknown parameter.
    #[error("study `{study}` has no parameter `{parameter}`: it has {known}")]
    UnknownParameter {
        /// Name of the study.
        study: String,
        /// Name as given.
        parameter: String,
        /// Names of the space.
        known: String,
    },
    /// An invalid value of a parameter or of the objective.
    #[error("{quantity} cannot be {value}: give a {expected}")]
    Value {
        /// Quantity.
        quantity: String,
        /// Value.
        value: f64,
        /// Description of a valid value.
        expected: &'static str,
    },
    /// A value outside the bounds.
    #[error("{parameter} = {value} is outside its bounds {low} to {high}")]
    Outside {
        /// Name of the parameter.
        parameter: String,
        /// Value.
        value: f64,
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// A number without a trial.
    #[error("study `{study}` has no trial {trial}: it has {count} trials")]
    UnknownTrial {
        /// Name of the study.
        study: String,
        /// Number.
        trial: u32,
        /// Number of trials in the study.
        count: usize,
    },
    /// A change that the state of the trial excludes.
    #[error("trial {trial} is {state:?}, so {action}")]
    State {
        /// Number of the trial.
        trial: u32,
        /// Its state.
        state: TrialState,
        /// Consequence, with a remedy.
        action: &'static str,
    },
    /// Another trial has begun since the draft.
    #[error("the proposal for trial {trial} is out of date: another trial has begun; ask for a new draft")]
    StaleDraft {
        /// Number in the draft.
        trial: u32,
    },
    /// The budget is used up at present.
    #[error("the budget of trials is used up, running trials included")]
    Full,
    /// The study was deleted or renamed.
    #[error("study `{0}` is no longer in the journal: it was deleted or renamed by another program")]
    Gone(String),
}
