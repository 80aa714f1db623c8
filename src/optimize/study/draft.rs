//! A proposal before it begins.

use crate::optimize::sampler::Draws;
use serde_json::Value;
use std::collections::BTreeMap;

/// A parameter of a proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestion {
    /// Name.
    pub name: String,
    /// Proposed value, in the parameter's own unit.
    pub value: f64,
    /// Whether the value was given (enqueued), not suggested by the sampler.
    pub fixed: bool,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Whether the search is logarithmic.
    pub log: bool,
}

/// A proposal that has had no effect yet.
#[derive(Debug, Clone, PartialEq)]
pub struct Draft {
    /// The number that the trial will have, unless another worker begins one first.
    pub number: u32,
    /// The parameters in the order of the space.
    pub parameters: Vec<Suggestion>,
    /// Whether it is an enqueued trial.
    pub enqueued: bool,
    /// User attributes that the enqueued trial brought along.
    pub attributes: BTreeMap<String, Value>,
    /// The joint sample that TPE drew, by name; announced to other workers.
    pub joint: Vec<(String, f64)>,
    /// Seed of the streams behind it.
    pub seed: u32,
    /// Where the streams stood before.
    pub before: Draws,
    /// Where they will stand after it has begun.
    pub after: Draws,
    /// The waiting trial behind it.
    pub(super) waiting: Option<u64>,
}
