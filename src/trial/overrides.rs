//! Values that the operator has set in place of proposed ones, by trial.

use std::collections::BTreeMap;

use super::{Proposal, ProposedParameter, TrialRecord};

/// Values of each trial, parameters before gains, from its proposals in their order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Overrides(BTreeMap<u32, Vec<ProposedParameter>>);

impl Overrides {
    /// Takes over what a proposal changes; one without a change removes those of an earlier one with its number.
    pub fn take(&mut self, proposal: &Proposal) {
        let changed: Vec<_> = proposal.changed().cloned().collect();
        match changed.is_empty() {
            true => self.0.remove(&proposal.trial),
            false => self.0.insert(proposal.trial, changed),
        };
    }

    /// Returns those that a trial ran with: of the trial itself, or in a recording and a study of an earlier version those of its
    /// proposal.
    pub fn of(&self, row: &TrialRecord) -> Vec<ProposedParameter> {
        if !row.proposed.is_empty() {
            return row.overrides();
        }
        let of_proposal = self.0.get(&row.trial).into_iter().flatten();
        of_proposal.filter(|p| row.ran_with(&p.name) == Some(p.value)).cloned().collect()
    }
}
