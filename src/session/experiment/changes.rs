//! The operator's changes of a proposal, and their form in the study.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Prefix of the study attribute with the changes of a proposal that has not begun, `changed:0` for worker 0.
pub const CHANGED_PREFIX: &str = "changed:";

/// The operator's changes to a proposal, by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Changes {
    pub parameters: BTreeMap<String, f64>,
    pub gains: BTreeMap<String, f64>,
}

/// The operator's changes of a proposal that has not begun.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptChanges {
    pub trial: u32,
    /// Whether the changed point was queued, and not drafted by the sampler.
    pub queued: bool,
    #[serde(flatten)]
    pub changes: Changes,
}
