//! A trial between its rollouts.

use super::plan::{RequestRefusal, must_be};
use crate::trial::TrialRecord;

/// A trial of which further rollouts are to be done.
pub struct BetweenRepeats {
    /// Changed by every verdict: an approval of an earlier proposal does not fit.
    pub revision: u32,
    /// The row before the last verdict, for undo.
    pub suggestion: Box<TrialRecord>,
}

impl BetweenRepeats {
    pub fn trial(&self) -> u32 {
        self.suggestion.trial
    }

    /// Refuses a request that was made for another proposal.
    pub fn must_be(&self, trial: u32, revision: u32) -> Result<(), RequestRefusal> {
        must_be((self.trial(), self.revision), (trial, revision))
    }
}
