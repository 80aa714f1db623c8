//! Errors of a study.

use crate::optimize::journal::JournalError;
use crate::optimize::trial::TrialState;

/// Errors of a study.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum StudyError {
    #[error(transparent)]
    Journal(#[from] JournalError),
    #[error(
        "study `{name}` is stored with direction {stored}, not {asked}: keep that direction, or choose another name"
    )]
    Direction { name: String, stored: String, asked: &'static str },
    #[error(
        "study `{name}`: parameter `{parameter}` is stored as {stored}, not {asked}; only its bounds may change within a study: choose another study name"
    )]
    Incompatible { name: String, parameter: String, stored: String, asked: &'static str },
    #[error("study `{study}` has no parameter `{parameter}`: it has {known}")]
    UnknownParameter { study: String, parameter: String, known: String },
    /// An invalid value of a parameter or of the objective.
    #[error("{quantity} cannot be {value}: give a {expected}")]
    Value { quantity: String, value: f64, expected: &'static str },
    #[error("{parameter} = {value} is outside its bounds {low} to {high}")]
    Outside { parameter: String, value: f64, low: f64, high: f64 },
    #[error("study `{study}` has no trial {trial}: it has {count} trials")]
    UnknownTrial { study: String, trial: u32, count: usize },
    /// A change that the state of the trial excludes; the action is the consequence, with a remedy.
    #[error("trial {trial} is {state:?}, so {action}")]
    State { trial: u32, state: TrialState, action: &'static str },
    #[error("the proposal for trial {trial} is out of date: another trial has begun; ask for a new draft")]
    StaleDraft { trial: u32 },
    #[error("the budget of trials is used up, running trials included")]
    Full,
    #[error(
        "no worker can join: {joined} have joined by the study's system attribute `{attribute}`, and the largest number of a worker is {}. Set the attribute in the journal to the number of workers that have joined",
        u32::MAX
    )]
    NoWorkerLeft { attribute: &'static str, joined: u64 },
    #[error(
        "study `{0}` is no longer in the journal: it was deleted or renamed by another program. Nothing more is stored in it; under a new name it is continued once it is opened again"
    )]
    Gone(String),
}
