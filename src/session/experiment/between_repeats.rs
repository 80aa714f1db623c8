//! A trial between its rollouts.

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
}
