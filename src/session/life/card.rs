//! The proposal on the table: a draft of the study and the operator's changes to it.

use std::collections::BTreeMap;

use super::attributes::Origin;
use crate::optimize::study::Draft;
use crate::recording::record::{ParameterInfo, Proposal, ProposedParameter, Risk, Source, TrialRecord, Verdict};

/// How many nearest judged trials the share of falls is taken over.
const NEIGHBOURS: usize = 5;

/// A card.
pub struct Card {
    /// What the study proposes.
    pub draft: Draft,
    /// Changes with every change of the card.
    pub revision: u32,
    changed: BTreeMap<String, f64>,
}

impl Card {
    /// A card of a new draft; revisions go on counting, so that no approval of an earlier card fits.
    pub fn new(draft: Draft, previous: Option<&Card>) -> Card {
        Card { draft, revision: previous.map_or(1, |card| card.revision + 1), changed: BTreeMap::new() }
    }

    /// The number that the trial will have.
    pub fn number(&self) -> u32 {
        self.draft.number
    }

    /// Changes one parameter; the proposed value is no change.
    pub fn set(&mut self, name: &str, value: f64) {
        let proposed = self.draft.parameters.iter().any(|p| p.name == name && p.value == value);
        if proposed {
            self.changed.remove(name);
        } else {
            self.changed.insert(name.to_owned(), value);
        }
        self.revision += 1;
    }

    /// Takes all changes back.
    pub fn clear(&mut self) {
        self.changed.clear();
        self.revision += 1;
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
    pub fn proposal(&self, rows: &BTreeMap<u32, TrialRecord>, bounds: &[ParameterInfo]) -> Proposal {
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
            risk: risk(&parameters, rows, bounds),
            parameters,
        }
    }
}

/// How near the point is to earlier falls, in parameters scaled to their bounds.
fn risk(point: &[ProposedParameter], rows: &BTreeMap<u32, TrialRecord>, bounds: &[ParameterInfo]) -> Option<Risk> {
    let distance = |row: &TrialRecord| {
        let squares = point.iter().map(|p| {
            let range = bounds.iter().find(|b| b.name == p.name).map_or(1.0, |b| b.high - b.low);
            let other = row.parameters.iter().find(|(name, _)| *name == p.name).map_or(p.value, |(_, value)| *value);
            if range > 0.0 { ((p.value - other) / range).powi(2) } else { 0.0 }
        });
        squares.sum::<f64>().sqrt()
    };
    let judged = rows.values().filter(|row| matches!(row.verdict, Some(Verdict::Accept | Verdict::Fall)));
    let mut nearest: Vec<_> = judged.map(|row| (distance(row), row)).collect();
    if nearest.is_empty() {
        return None;
    }
    nearest.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let fell = |row: &TrialRecord| row.verdict == Some(Verdict::Fall);
    let fall = nearest.iter().find(|(_, row)| fell(row));
    let around = &nearest[..nearest.len().min(NEIGHBOURS)];
    Some(Risk {
        nearest_fall: fall.map(|(distance, _)| *distance),
        nearest_fall_trial: fall.map(|(_, row)| row.trial),
        falls: around.iter().filter(|(_, row)| fell(row)).count() as u32,
        neighbours: around.len() as u32,
    })
}
