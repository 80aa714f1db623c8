//! The operations of which a journal consists.

use crate::optimize::trial::{Distribution, Trial, TrialState};
use jiff::Timestamp;
use serde_json::Value;

/// The operation of a journal line. Codes and members are those of Optuna's `JournalStorage` (`docs/journal.md`). Studies
/// and trials are given by their ids; those of trials are counted over all studies.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "fields have the names of the journal's members")]
pub enum Operation {
    /// 0: a new study; per objective 0 not set, 1 minimize, 2 maximize.
    CreateStudy { name: String, directions: Vec<u64> },
    /// 1: deletion of a study.
    DeleteStudy { study: usize },
    /// 2, 3: an attribute of a study.
    StudyAttribute { study: usize, kind: AttributeKind, key: String, value: Value },
    /// 4: a new trial, running unless the template, the contents of an enqueued or imported trial, has another state.
    CreateTrial { study: usize, started: Option<Timestamp>, template: Option<Box<Trial>> },
    /// 5: a parameter of a running trial, its value in the representation of the distribution; a float's own value.
    SetParameter { trial: u64, name: String, value: f64, distribution: Distribution },
    /// 6: beginning or end of a trial, with the values of the objectives of a complete one.
    SetState { trial: u64, state: TrialState, values: Option<Vec<f64>>, at: Option<Timestamp> },
    /// 7: an intermediate value.
    SetIntermediate { trial: u64, step: i64, value: f64 },
    /// 8, 9: an attribute of a trial.
    TrialAttribute { trial: u64, kind: AttributeKind, key: String, value: Value },
    /// 10: without effect, as in Optuna 5; written by other programs.
    Nothing,
}

impl Operation {
    pub(crate) fn study_attribute(study: usize, kind: AttributeKind, key: &str, value: impl Into<Value>) -> Self {
        Operation::StudyAttribute { study, kind, key: key.to_owned(), value: value.into() }
    }

    pub(crate) fn trial_attribute(trial: u64, kind: AttributeKind, key: &str, value: impl Into<Value>) -> Self {
        Operation::TrialAttribute { trial, kind, key: key.to_owned(), value: value.into() }
    }
}

/// The two kinds of attributes; the discriminants are added to the code of the operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttributeKind {
    /// Set by a program.
    User = 0,
    /// Set by Optuna, a sampler or the dashboard.
    System = 1,
}

impl AttributeKind {
    /// The member of a journal line that holds the attribute.
    pub(super) fn member(self) -> &'static str {
        self.of("user_attr", "system_attr")
    }

    /// The one of two values that belongs to this kind.
    pub(super) fn of<T>(self, user: T, system: T) -> T {
        if self == AttributeKind::User { user } else { system }
    }
}
