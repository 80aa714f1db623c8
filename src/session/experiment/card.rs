//! The proposal on the table: a draft of the study and the operator's changes to it.

use std::collections::BTreeMap;

use super::attributes::Origin;
use super::gains::listed;
use crate::optimize::insight;
use crate::optimize::study::{Draft, Study};
use crate::optimize::trial::Trial;
use crate::trial::{FallRisk, Gains, Proposal, ProposalSource, ProposedParameter};

/// A card.
pub struct Card {
    /// What the study proposes.
    pub draft: Draft,
    /// Changes with every change of the card.
    pub revision: u32,
    /// The study as it will be when the trial begins: what is not told yet is told in it.
    outlook: Study,
    changed: BTreeMap<String, f64>,
    /// The draft was queued in the outlook alone: in the study its number may be another's by now.
    pub in_outlook_alone: bool,
    /// The configured gains, in table order.
    configured: Vec<(String, f64)>,
    /// The gains that the trial runs with if nobody changes them: the configured ones, or those that it brings.
    gains: Vec<(String, f64)>,
    changed_gains: BTreeMap<String, f64>,
    /// Parameters that the operator has fixed for some trials, as far as they are in the draft.
    held: Vec<(String, f64)>,
}

impl Card {
    /// A card of the next draft of `outlook`, in which the parameters `fixed` are not searched unless the draft was queued
    /// with values of its own. `in_study` says that what waits in it waits in the study too. `gains` are those of the
    /// configuration; `revision` must be one that no earlier card had.
    pub fn new(outlook: Study, in_study: bool, fixed: &[(String, f64)], gains: &Gains, revision: u32) -> Card {
        let queued = outlook.waiting().next().map(Trial::fixed).unwrap_or_default();
        let fixed: Vec<_> = fixed.iter().filter(|(name, _)| queued.iter().all(|(n, _)| n != name)).cloned().collect();
        let draft = outlook.draft_with(&fixed);
        let mut card = Card {
            in_outlook_alone: draft.enqueued && !in_study,
            draft,
            revision,
            outlook,
            changed: BTreeMap::new(),
            configured: listed(gains),
            gains: listed(gains),
            changed_gains: BTreeMap::new(),
            held: fixed,
        };
        let brought = card.origin().gains;
        for (name, value) in &mut card.gains {
            *value = brought.iter().find(|(n, _)| n == name).map_or(*value, |(_, brought)| *brought);
        }
        card
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

    /// Changes one gain; the one that it would have anyway is no change.
    pub fn set_gain(&mut self, name: &str, value: f64, revision: u32) {
        if self.gains.iter().any(|(n, v)| n == name && *v == value) {
            self.changed_gains.remove(name);
        } else {
            self.changed_gains.insert(name.to_owned(), value);
        }
        self.revision = revision;
    }

    /// Makes the changes of an earlier card, as far as `keeps` lets them through.
    pub fn inherit(&mut self, earlier: &Card, keeps: impl Fn(&str, f64) -> bool) {
        let kept = earlier.changed.iter().filter(|(name, value)| keeps(name, **value));
        for (name, value) in kept {
            self.set(name, *value, self.revision);
        }
        for (name, value) in &earlier.changed_gains {
            self.set_gain(name, *value, self.revision);
        }
    }

    /// Whether the operator has changed anything.
    pub fn is_changed(&self) -> bool {
        !self.changed.is_empty() || !self.changed_gains.is_empty()
    }

    /// The study as it will be when the trial begins.
    pub fn outlook(&self) -> &Study {
        &self.outlook
    }

    /// Takes all changes back.
    pub fn clear(&mut self, revision: u32) {
        self.changed.clear();
        self.changed_gains.clear();
        self.revision = revision;
    }

    /// The changed parameters.
    pub fn overrides(&self) -> Vec<(String, f64)> {
        self.changed.iter().map(|(name, value)| (name.clone(), *value)).collect()
    }

    /// The fixed parameters that this trial runs with: those that were not changed for it alone.
    pub fn held(&self) -> Vec<(String, f64)> {
        self.held.iter().filter(|(name, _)| !self.changed.contains_key(name)).cloned().collect()
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
            source: if self.is_changed() { ProposalSource::Operator } else { origin.source },
            parent: origin.parent,
            risk: self.risk(&parameters),
            parameters,
            gains: self
                .gains
                .iter()
                .zip(&self.configured)
                .map(|(brought, usual)| self.gain(brought, usual.1))
                .collect(),
        }
    }

    /// One gain; what differs from the configuration is to be seen, also where nobody has changed it here.
    fn gain(&self, (name, brought): &(String, f64), configured: f64) -> ProposedParameter {
        let value = self.changed_gains.get(name).copied().unwrap_or(*brought);
        ProposedParameter { name: name.clone(), value, proposed: configured }
    }

    /// How near earlier falls are; none before the first trial that counts.
    fn risk(&self, point: &[ProposedParameter]) -> Option<FallRisk> {
        let point: Vec<_> = point.iter().map(|p| (p.name.clone(), p.value)).collect();
        let risk = insight::Risk::of(&point, self.outlook.trials(), &self.outlook.options().space);
        (risk.neighbours > 0).then(|| FallRisk {
            nearest_fall: risk.falls.first().map(|(_, distance)| *distance),
            nearest_fall_trial: risk.falls.first().map(|(trial, _)| *trial),
            falls: risk.fell_near as u32,
            neighbours: risk.neighbours as u32,
        })
    }
}
