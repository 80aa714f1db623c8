//! Jobs on the experiment whose results were not taken yet.

use crate::session::operator_request::StampedRequest;
use crate::telemetry::Permit;

/// Origin of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asker {
    Operator,
    /// The automatic rule of approval.
    Rule,
}

/// An unfinished job.
#[derive(Debug)]
pub struct UnfinishedJob {
    pub number: u64,
    pub given_ns: u64,
    pub purpose: JobPurpose,
}

#[derive(Debug)]
pub enum JobPurpose {
    Request(StampedRequest, Asker),
    Approve(StampedRequest, Asker, ApprovalState),
    Measure(u32),
    KeepMeasurement(u32),
    /// A trial that was approved and not run.
    Withdraw,
    Refresh,
    /// The prior of the sampler.
    Prior,
    Close,
}

/// State at the key press of an approval: the trial runs only if it still holds when the study has stored the trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApprovalState {
    pub permit: Permit,
    /// STOPs until then.
    pub stops: u64,
}
