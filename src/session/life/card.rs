//! The proposal on the table: a draft of the study and the operator's changes to it.

use std::collections::BTreeMap;

use super::attributes::Origin;
use crate::optimize::insight;
use crate::optimize::study::{Draft, Study};
use crate::recording::record::{Proposal, ProposedParameter, Risk, Source};

/// A card.
pub struct Card {
    /// What the study proposes.
    pub draft: Draft,
    /// Changes with every change of the card.
    pub revision: u32,
    /// The study as it will be when the trial begins: what is not told yet is told in it.
    outlook: Study,
    changed: BTreeMap<String, f64>,
}

impl Card {
    /// A card of the next draft of `outlook`; `revision` must be one that no earlier card had.
    pub fn new(outlook: Study, revision: u32) -> Card {
        Card { draft: outlook.draft(), revision, outlook, changed: BTreeMap::new() }
    }

    /// The number that the trial will have.
    pub fn number(&self) -> u32 {
        self.draft.number
    }

    /// Changes one parameter; the proposed value is no change.
    pub fn set(&mut self, name: &str, value: f64, revision: u32) {
        let proposed = self.draft.parameters.iter().any(|p| p.name == name && p.value == value);
        if proposed {
            self.changed.remove(name);
        } else {
            self.changed.insert(name.to_owned(), value);
        }
        self.revision = revision;
    }

    /// Takes all changes back.
    pub fn clear(&mut self, revision: u32) {
        self.changed.clear();
        self.revision = revision;
    }

    /// The changed parameters.
    pub fn overrides(&self) -> Vec<(String, f64)> {
        self.changed.iter().map(|(name, value)| (name.clone(), *value)).collect()
    }

    /// Where the draft comes from.
    pub fn origin(&self) -> Origin {
        if self.draft.enqueued { Origin::of(&self.draft.attributes) } else { Origin::sampler() }
    }

    /// What the operator sees.
    pub fn proposal(&self) -> Proposal {
        let value = |name: &str, proposed: f64| self.changed.get(name).copied().unwrap_or(proposed);
        let parameters: Vec<_> = self
            .draft
            .parameters
            .iter()
            .map(|p| ProposedParameter { name: p.name.clone(), value: value(&p.name, p.value), proposed: p.value })
            .collect();
        let origin = self.origin();
        Proposal {
            trial: self.number(),
            revision: self.revision,
            source: if self.changed.is_empty() { origin.source } else { Source::Operator },
            parent: origin.parent,
            risk: self.risk(&parameters),
            parameters,
        }
    }

    /// How near earlier falls are; none before the first trial that counts.
    fn risk(&self, point: &[ProposedParameter]) -> Option<Risk> {
        let point: Vec<_> = point.iter().map(|p| (p.name.clone(), p.value)).collect();
        let risk = insight::Risk::of(&point, self.outlook.trials(), &self.outlook.options().space);
        (risk.neighbours > 0).then(|| Risk {
            nearest_fall: risk.falls.first().map(|(_, distance)| *distance),
            nearest_fall_trial: risk.falls.first().map(|(trial, _)| *trial),
            falls: risk.fell_near as u32,
            neighbours: risk.neighbours as u32,
        })
    }
}
