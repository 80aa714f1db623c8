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

    /// Returns those that a trial ran with: of the trial itself, or in a recording and a study of an earlier version those of its
    /// proposal.
    pub fn of(&self, row: &TrialRecord) -> Vec<ProposedParameter> {
        let ran = |name: &str| row.parameters.get(name).or_else(|| row.gains.get(name));
        if !row.proposed.is_empty() {
            let own = |(name, proposed): &(String, f64)| {
                Some(ProposedParameter { name: name.clone(), value: ran(name)?, proposed: *proposed })
            };
            return row.proposed.iter().filter_map(own).collect();
        }
        let of_proposal = self.0.get(&row.trial).into_iter().flatten();
        of_proposal.filter(|p| ran(&p.name) == Some(p.value)).cloned().collect()
    }
}
