//! Which running trials of others are still alive. Workers may be on hosts whose clocks disagree, so nobody's time of day is
//! believed: a trial counts as dead when this session itself has seen it run for too long without any news of it.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use crate::optimize::trial::{Trial, TrialState};

/// Since when this session has seen which trial run.
#[derive(Debug)]
pub(super) struct Watch {
    /// After how long without news a running trial counts as dead.
    abandoned: Duration,
    /// By number: when the last news of it was seen, and how many attributes it had then.
    seen: BTreeMap<u32, (Instant, usize)>,
}

impl Watch {
    pub(super) fn new(abandoned: Duration) -> Watch {
        Watch { abandoned, seen: BTreeMap::new() }
    }

    /// Takes in how the trials stand now; to be called whenever the study was read.
    pub(super) fn observe(&mut self, trials: &[Trial]) {
        let now = Instant::now();
        let before = std::mem::take(&mut self.seen);
        let running = trials.iter().filter(|trial| trial.state == TrialState::Running);
        self.seen = running
            .map(|trial| {
                // A judgement is news: it adds attributes.
                let attributes = trial.user_attributes.len();
                let since = before.get(&trial.number).filter(|(_, had)| *had == attributes);
                (trial.number, since.copied().unwrap_or((now, attributes)))
            })
            .collect();
    }

    /// Whether a running trial may still be run by somebody; one that was never seen before may.
    pub(super) fn is_alive(&self, trial: &Trial) -> bool {
        self.seen.get(&trial.number).is_none_or(|(since, _)| since.elapsed() < self.abandoned)
    }
}
