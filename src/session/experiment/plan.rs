//! Settings of an experiment, and refusals of its requests.

use std::time::Duration;

use crate::control::settings::TaskControl;
use crate::optimize::study::StudyError;
use crate::sim::TerrainConfig;
use crate::trial::{Backend, HopEnvelope, ParameterInfo, Task};

/// Refusal of a request, as a message for the operator.
#[derive(Debug, thiserror::Error)]
pub enum RequestRefusal {
    /// The request does not fit the present stage or the bounds.
    #[error("{0}")]
    NotNow(String),
    /// Another program has begun the proposed trial, or queued a point before it; there is a new proposal.
    #[error("another program was faster: the proposal for trial {0} does not hold any more; approve the new one")]
    Overtaken(u32),
    /// Another program ended the trial under review; there is a new proposal.
    #[error("trial {0} was ended by another program: that result stands")]
    EndedElsewhere(u32),
    /// The study could not be read or written.
    #[error(transparent)]
    Study(#[from] StudyError),
}

pub fn not_now<T>(reason: impl Into<String>) -> Result<T, RequestRefusal> {
    Err(RequestRefusal::NotNow(reason.into()))
}

/// Refuses a request that was made for another proposal than the open one, each given by its trial and its revision. The trial may have
/// another number by now.
pub fn must_be(open: (u32, u32), seen: (u32, u32)) -> Result<(), RequestRefusal> {
    if open.1 == seen.1 {
        return Ok(());
    }
    let (trial, new) = (seen.0, open.0);
    not_now(format!("the proposal for trial {trial} has changed since it was shown; check the new one (trial {new})"))
}

/// Settings that all trials of one study share.
#[expect(missing_docs, reason = "the types say the rest")]
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentPlan {
    pub task: Task,
    pub control: TaskControl,
    /// Parameters with their bounds, in table order.
    pub parameters: Vec<ParameterInfo>,
    pub seed: u64,
    pub budget: u32,
    /// File name of the recording; empty without one.
    pub recording: String,
    /// The same parameters with the widest bounds that they may be given.
    pub widest: Vec<ParameterInfo>,
    /// The controller's gains with the ranges in which they may be set; one that is a parameter is set as such.
    pub gains: Vec<ParameterInfo>,
    /// Number of best points that are repeated to confirm the best.
    pub contenders: u32,
    /// Confidence at which one of them is the best.
    pub confidence: f64,
    /// Number of this worker on the study: 0 has the study's folder, and closes the trials that a crash left running.
    pub worker: u32,
    /// Time without news after which a running trial of another worker counts as abandoned.
    pub abandoned: Duration,
    pub backend: Backend,
    /// Ground of simulated trials, whose friction the seed of a trial may draw.
    pub terrain: Option<TerrainConfig>,
    /// Growth of the largest forces; none where the whole bounds are open.
    pub envelope: Option<HopEnvelope>,
    /// Whether nothing is proposed before the study is given the prior of its sampler.
    pub needs_prior: bool,
}

impl ExperimentPlan {
    /// Whether the study optimizes the parameter or gain `name`.
    pub fn optimizes(&self, name: &str) -> bool {
        self.parameters.iter().any(|parameter| parameter.name == name)
    }
}
