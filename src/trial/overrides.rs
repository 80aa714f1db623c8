//! Values that the operator has set in place of proposed ones, by trial.

use std::collections::BTreeMap;

use super::{Proposal, ProposedParameter, TrialRecord};

/// Values of each trial, parameters before gains, from its proposals in their order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Overrides(BTreeMap<u32, Vec<ProposedParameter>>);

impl Overrides {
    /// Takes over what a proposal changes; one without a change removes those of an earlier one with its number.
    pub fn take(&mut self, proposal: &Proposal) {
        let values = proposal.parameters.iter().chain(&proposal.gains);
        let changed: Vec<_> = values.filter(|p| p.value != p.proposed).cloned().collect();
        match changed.is_empty() {
            true => self.0.remove(&proposal.trial),
            false => self.0.insert(proposal.trial, changed),
        };
    }

    /// Returns those that a trial ran with.
    pub fn of<'a>(&'a self, row: &'a TrialRecord) -> impl Iterator<Item = &'a ProposedParameter> {
        let ran =
            |p: &&ProposedParameter| row.parameters.get(&p.name).or_else(|| row.gains.get(&p.name)) == Some(p.value);
        self.0.get(&row.trial).into_iter().flatten().filter(ran)
    }
}
