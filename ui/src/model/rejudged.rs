//! The trials of a replay as another configuration judges them.

use std::collections::BTreeMap;

use quadfrog::engine::{RejudgedTrial, changes_in_words};
use quadfrog::trial::Verdict;

/// New judgements beside the recorded ones.
#[derive(Debug, Clone)]
pub struct RejudgedTable {
    /// The folder of the configuration, or the defaults.
    pub configuration: String,
    /// Unit of the new objective.
    pub unit: String,
    /// Trials that will be judged.
    pub count: usize,
    /// Those that are judged, by their number.
    pub trials: BTreeMap<u32, RejudgedTrial>,
    /// Whether all are judged.
    pub done: bool,
}

impl RejudgedTable {
    /// The numbers of suggested verdicts, values and reasons that change, and of those judged while they are.
    pub fn summary(&self) -> String {
        match self.done {
            true => changes_in_words(self.trials.values()),
            false => format!("{} of {} judged again", self.trials.len(), self.count),
        }
    }

    /// The value that the sampler would receive by the new configuration: 0 for a fall; none without a verdict.
    pub fn value(&self, trial: u32) -> Option<f64> {
        let new = &self.trials.get(&trial)?.new;
        match new.verdict? {
            Verdict::Fall => Some(0.0),
            Verdict::Accept => new.value,
            Verdict::Void => None,
        }
    }
}
