//! What can go wrong with a study, in words for the operator.

use crate::optimize::journal::JournalError;
use crate::optimize::trial::TrialState;

/// What can go wrong with a study.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The journal could not be read or written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The stored study is of another kind.
    #[error(
        "study `{name}` is stored with direction {stored}, asked for is {asked}: continue it so, or choose another name"
    )]
    Direction {
        /// Its name.
        name: String,
        /// As stored.
        stored: String,
        /// As asked for.
        asked: &'static str,
    },
    /// A parameter was searched on another scale before.
    #[error(
        "study `{name}`: parameter `{parameter}` was stored as {stored} before and is {asked} now; only its bounds may change within a study: choose another study name"
    )]
    Incompatible {
        /// Name of the study.
        name: String,
        /// Name of the parameter.
        parameter: String,
        /// As stored.
        stored: String,
        /// As asked for.
        asked: &'static str,
    },
    /// A parameter that the study does not have.
    #[error("study `{study}` has no parameter `{parameter}`: it has {known}")]
    UnknownParameter {
        /// Name of the study.
        study: String,
        /// The name that was given.
        parameter: String,
        /// The names that there are.
        known: String,
    },
    /// A value that no parameter or objective can have.
    #[error("{what} cannot be {value}: give a {expected}")]
    Value {
        /// What was to be set.
        what: String,
        /// To what.
        value: f64,
        /// What it can be.
        expected: &'static str,
    },
    /// A value outside the bounds.
    #[error("{parameter} = {value} is outside its bounds {low} to {high}")]
    Outside {
        /// The parameter.
        parameter: String,
        /// Its value.
        value: f64,
        /// Its lower bound.
        low: f64,
        /// Its upper bound.
        high: f64,
    },
    /// The number of no trial.
    #[error("study `{study}` has no trial {trial}: it has {count}")]
    UnknownTrial {
        /// Name of the study.
        study: String,
        /// The number.
        trial: u32,
        /// How many trials there are.
        count: usize,
    },
    /// A trial that cannot be changed as asked.
    #[error("trial {trial} is {state:?}, so {action}")]
    State {
        /// Number of the trial.
        trial: u32,
        /// Its state.
        state: TrialState,
        /// What that excludes.
        action: &'static str,
    },
    /// The draft was made before something else began.
    #[error("the proposal for trial {trial} is out of date: the study has moved on since; ask for a new draft")]
    StaleDraft {
        /// The number that it was drafted for.
        trial: u32,
    },
    /// No trial more may begin at present.
    #[error("the study has as many trials as it may have, those still running counted")]
    Full,
    /// The study was deleted meanwhile.
    #[error("study `{0}` is no longer in the journal: it was deleted or renamed by another program")]
    Gone(String),
}
