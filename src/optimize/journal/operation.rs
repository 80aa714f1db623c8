//! The operations of which a journal consists.

use crate::optimize::trial::{Distribution, FIXED_PARAMS, TrialState};
use jiff::Timestamp;
use serde_json::{Map, Value};

/// The operation of a journal line. Codes and members are those of Optuna's `JournalStorage` (`docs/journal.md`).
#[derive(Debug, Clone, PartialEq)]
pub enum Operation {
    /// 0: a new study.
    CreateStudy {
        /// Name, unique among studies that are not deleted.
        name: String,
        /// Per objective: 0 not set, 1 minimize, 2 maximize.
        directions: Vec<u64>,
    },
    /// 1: deletion of a study.
    DeleteStudy {
        /// Id of the study.
        study: usize,
    },
    /// 2: a user attribute of a study.
    StudyUserAttribute {
        /// Id of the study.
        study: usize,
        /// Name.
        key: String,
        /// Value.
        value: Value,
    },
    /// 3: a system attribute of a study.
    StudySystemAttribute {
        /// Id of the study.
        study: usize,
        /// Name.
        key: String,
        /// Value.
        value: Value,
    },
    /// 4: a new trial, running unless the template has another state.
    CreateTrial {
        /// Id of the study.
        study: usize,
        /// Time of the beginning.
        started: Option<Timestamp>,
        /// Contents of an enqueued or imported trial.
        template: Option<Box<TrialTemplate>>,
    },
    /// 5: a parameter of a running trial.
    SetParameter {
        /// Id of the trial, counted over all studies.
        trial: u64,
        /// Name.
        name: String,
        /// Value in the representation of the distribution; a float's own value.
        value: f64,
        /// Distribution.
        distribution: Distribution,
    },
    /// 6: beginning or end of a trial.
    SetState {
        /// Id of the trial.
        trial: u64,
        /// New state.
        state: TrialState,
        /// Values of the objectives of a complete trial.
        values: Option<Vec<f64>>,
        /// Time of the change.
        at: Option<Timestamp>,
    },
    /// 7: an intermediate value.
    SetIntermediate {
        /// Id of the trial.
        trial: u64,
        /// Step.
        step: i64,
        /// Value.
        value: f64,
    },
    /// 8: a user attribute of a trial.
    TrialUserAttribute {
        /// Id of the trial.
        trial: u64,
        /// Name.
        key: String,
        /// Value.
        value: Value,
    },
    /// 9: a system attribute of a trial.
    TrialSystemAttribute {
        /// Id of the trial.
        trial: u64,
        /// Name.
        key: String,
        /// Value.
        value: Value,
    },
    /// 10: without effect, as in Optuna 5; written by other programs.
    Nothing,
}

/// The contents of an enqueued or imported trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrialTemplate {
    /// State.
    pub state: TrialState,
    /// Values of the objectives.
    pub values: Option<Vec<f64>>,
    /// Time of the end.
    pub completed: Option<Timestamp>,
    /// Parameters with their distributions.
    pub parameters: Vec<(String, f64, Distribution)>,
    /// User attributes.
    pub user_attributes: Map<String, Value>,
    /// System attributes.
    pub system_attributes: Map<String, Value>,
    /// Intermediate values by step.
    pub intermediate: Vec<(i64, f64)>,
}

impl TrialTemplate {
    /// A waiting trial with the given parameters.
    pub fn waiting(fixed: Map<String, Value>, user_attributes: Map<String, Value>) -> Self {
        let system_attributes = Map::from_iter([(FIXED_PARAMS.to_owned(), Value::Object(fixed))]);
        TrialTemplate { state: TrialState::Waiting, user_attributes, system_attributes, ..TrialTemplate::default() }
    }
}
