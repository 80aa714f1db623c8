//! The trials of a replay as another configuration judges them.

use std::collections::BTreeMap;

use quadfrog::engine::RejudgedTrial;
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
    /// The number of suggested verdicts, values and reasons that change, and of those judged while they are.
    pub fn summary(&self) -> String {
        let changed = self.trials.values().filter(|trial| trial.new.differs(&trial.old)).count();
        let (judged, count) = (self.trials.len(), self.count);
        if self.done {
            format!("{changed} of {judged} suggestions change")
        } else {
            format!("{judged} of {count} judged again")
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
