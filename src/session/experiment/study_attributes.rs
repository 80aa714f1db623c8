//! User attributes of a study in the journal, as typed data (`docs/journal.md`).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::attributes::read;
use crate::optimize::ask::SamplerConfig;
use crate::trial::Task;

/// Attributes of a study that was made by this program.
#[derive(Debug, Serialize)]
pub struct NewStudyAttributes<'a> {
    pub task: Task,
    pub robot: &'a str,
    /// Hash of the robot's files.
    pub robot_files: String,
    pub seed: u32,
    pub sampler: &'a SamplerConfig,
    pub version: &'static str,
    pub budget: u32,
    pub backend: &'a str,
    /// Unit of the objective; none for that of the task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
}

/// The sampler with which a study was continued last.
#[derive(Debug, Serialize)]
pub struct SamplerAttribute<'a> {
    pub sampler: &'a SamplerConfig,
}

/// The backend on which a study was continued last.
#[derive(Debug, Serialize)]
pub struct BackendAttribute {
    pub backend: &'static str,
}

/// The budget of a study, for workers that join it and sessions that continue it.
#[derive(Debug, Serialize)]
pub struct BudgetAttribute {
    pub budget: u32,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct StudyAttributes {
    pub task: Option<Task>,
    pub robot: Option<String>,
    /// Hash of the robot's files; none for a study of an earlier version.
    pub robot_files: Option<String>,
    /// Version that made it.
    pub version: Option<String>,
    pub seed: Option<u32>,
    pub budget: Option<u32>,
    /// Unit of the objective; none for that of the task.
    pub unit: Option<String>,
    /// The backend on which it was made or continued last; none for a study of an earlier version, which was simulated.
    pub backend: Option<String>,
    /// Bounds that the operator has changed, `{"Fx": [40, 110]}`.
    pub bounds: Option<BTreeMap<String, [f64; 2]>>,
    /// Fixed parameters, `{"Fx": {"value": 60, "trials": 5, "from": 12}}`.
    pub fixed: Option<BTreeMap<String, FixedFrom>>,
    /// The confirmation that runs; null when it is over.
    pub confirm: Option<RunningConfirmation>,
    pub confirmed: Option<Conclusion>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FixedFrom {
    pub value: f64,
    /// Number of trials.
    pub trials: u32,
    /// Number of the first trial.
    pub from: u32,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunningConfirmation {
    /// First trials of the compared points.
    pub trials: Vec<u32>,
    /// Most repeats.
    pub repeats: u32,
    /// Number of the first trial that may be one of them.
    pub from: u32,
}

/// The end of a confirmation. Leader and confidence are those of that moment; what is shown is computed from the present trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conclusion {
    /// First trials of the compared points.
    pub trials: Vec<u32>,
    /// First trial of the leading point.
    pub leader: u32,
    /// Confidence that the leading point is the best.
    pub confidence: f64,
    /// Whether the confidence is enough.
    pub sure: bool,
    /// Confidence that is enough; none in a study of an earlier version.
    pub wanted: Option<f64>,
}

impl StudyAttributes {
    pub fn of(attributes: &BTreeMap<String, Value>) -> StudyAttributes {
        read(attributes)
    }
}
