//! The proposal that waits for approval: a draft of the study and the operator's changes to it.

use std::collections::BTreeMap;

use super::attributes::{self, Origin};
use super::changes::Changes;
use super::plan::{RequestRefusal, must_be};
use crate::optimize::ask::{Expectation, Prediction, SamplerKind};
use crate::optimize::insight;
use crate::optimize::sim::insight::{PriorInsight, WorldWeight};
use crate::optimize::study::{ModelPredictions, Study, TrialDraft};
use crate::optimize::tpe;
use crate::optimize::trial::Trial;
use crate::trial::{
    ExpectedResult, FallRisk, Gains, ParameterInsight, ParameterValues, PredictedTrial, Proposal, ProposalInsight,
    ProposalSource, ProposedParameter, SimulatorComparison, Verdict, WorldResemblance,
};

/// Values at which the densities are given: the width of a chart in a terminal.
const INSIGHT_POINTS: usize = 41;

/// A draft with the operator's changes.
pub struct OpenProposal {
    draft: TrialDraft,
    /// Changed by every change of the proposal: no approval of an earlier one fits a later one.
    revision: u32,
    /// The study at the time at which the trial begins: every verdict is reported in it.
    study: Study,
    changes: Changes,
    waits_in: WaitsIn,
    configured: ParameterValues,
    /// The gains of the trial without changes: the configured ones, or those of its origin. Those that are parameters of the
    /// study have the values of the point instead.
    gains: ParameterValues,
    /// Parameters of the draft that the operator has fixed for some trials.
    fixed: Vec<(String, f64)>,
}

/// Place in which the waiting trial of a draft waits; without meaning for a draft of the sampler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WaitsIn {
    /// The study.
    Study,
    /// The copy of the study with the pending verdict: its re-run. In the study its number may belong to another trial by now.
    Verdict,
    /// The copy of the study, as the next repeat that confirms the best; it is queued with its approval.
    Confirmation,
}

/// Values of an open proposal at its approval.
pub struct ApprovedProposal {
    pub proposal: Proposal,
    pub origin: Origin,
    pub draft: TrialDraft,
    pub overrides: Vec<(String, f64)>,
    /// The fixed parameters, without those that were changed for this trial.
    pub fixed: ParameterValues,
    pub waits_in: WaitsIn,
}

impl ApprovedProposal {
    /// Whether it runs also when the budget is used up: a repeat of the best, also one whose values were changed.
    pub fn is_beyond_budget(&self) -> bool {
        [self.proposal.source, self.origin.source].contains(&ProposalSource::Confirm)
    }
}

impl OpenProposal {
    /// Drafts the next trial of `study`. The parameters `fixed` are not searched unless the draft was queued with other values
    /// of its own, or repeats a point to confirm the best. `waits_in` is the place of the first waiting trial. `gains` are the configured ones; `revision` must be one that no earlier proposal had.
    pub fn new(study: Study, waits_in: WaitsIn, fixed: &[(String, f64)], gains: &Gains, revision: u32) -> OpenProposal {
        let next = study.waiting().next();
        let queued = next.map(Trial::fixed).unwrap_or_default();
        let confirms = next.is_some_and(attributes::confirms);
        let agrees = |(name, value): &&(String, f64)| queued.iter().all(|(n, own)| n != name || own == value);
        let fixed: Vec<_> = fixed.iter().filter(|_| !confirms).filter(agrees).cloned().collect();
        let draft = study.draft_with(&fixed);
        let mut open = OpenProposal {
            waits_in,
            draft,
            revision,
            study,
            changes: Changes::default(),
            configured: gains.values(),
            gains: ParameterValues::default(),
            fixed,
        };
        open.gains = gains.with(&open.origin().gains).values();
        open
    }

    pub fn number(&self) -> u32 {
        self.draft.number
    }

    /// Refuses a request that was made for another proposal.
    pub fn must_be(&self, trial: u32, revision: u32) -> Result<(), RequestRefusal> {
        must_be((self.number(), self.revision), (trial, revision))
    }

    /// Sets the number that its trial will have; the values and the revision stay.
    pub fn set_number(&mut self, number: u32) {
        self.draft.number = number;
    }

    /// Takes the results of `study`, which draws its points where this proposal's study does, for its risk and for what is expected of
    /// its values. Whether a gain was worth its risk stays as the sampler found it for this draft.
    pub fn see(&mut self, study: Study) {
        self.study = study;
        let now = self.study.expect(&self.draft.point());
        if let (Some(drafted), Some(now)) = (&mut self.draft.expected, now) {
            *drafted = Expectation { worth_the_risk: drafted.worth_the_risk, ..now };
        }
    }

    /// Returns the number of the waiting trial of the study that this proposal proposes; none if it does not wait there.
    pub fn waits_as(&self) -> Option<u32> {
        (self.draft.enqueued && self.waits_in == WaitsIn::Study).then_some(self.number())
    }

    /// Whether the waiting trial of `study` that it proposes has another point by now; false if it does not wait there.
    pub fn is_exchanged_in(&self, study: &Study) -> bool {
        self.waits_as().and_then(|number| study.trial(number).ok()).is_some_and(|trial| !self.draft.is_of(trial))
    }

    /// Whether its point was queued, and not drafted by the sampler.
    pub fn is_queued(&self) -> bool {
        self.draft.enqueued
    }

    /// Returns its changes with another value of a parameter; the proposed value is no change.
    pub fn with_parameter(&self, name: &str, value: f64) -> Changes {
        let proposed = self.draft.parameters.iter().any(|p| p.name == name && p.value == value);
        let mut changes = self.changes.clone();
        change(&mut changes.parameters, name, value, proposed);
        changes
    }

    /// Returns its changes with another value of a gain; the value that it has without changes is no change.
    pub fn with_gain(&self, name: &str, value: f64) -> Changes {
        let mut changes = self.changes.clone();
        change(&mut changes.gains, name, value, self.gains.get(name) == Some(value));
        changes
    }

    pub fn set_changes(&mut self, changes: Changes, revision: u32) {
        self.changes = changes;
        self.revision = revision;
    }

    /// Makes the changes of an earlier draft of the same trial, where `allows` is true for a parameter or a gain.
    pub fn inherit(&mut self, earlier: &Changes, allows: impl Fn(&str, f64) -> bool) {
        for (name, value) in earlier.parameters.iter().filter(|(name, value)| allows(name, **value)) {
            self.changes = self.with_parameter(name, *value);
        }
        for (name, value) in earlier.gains.iter().filter(|(name, value)| allows(name, **value)) {
            self.changes = self.with_gain(name, *value);
        }
    }

    pub fn is_changed(&self) -> bool {
        self.changes != Changes::default()
    }

    pub fn approved(&self) -> ApprovedProposal {
        let changed = &self.changes.parameters;
        ApprovedProposal {
            proposal: self.proposal(),
            origin: self.origin(),
            draft: self.draft.clone(),
            overrides: changed.iter().map(|(name, value)| (name.clone(), *value)).collect(),
            fixed: self.fixed.iter().filter(|(name, _)| !changed.contains_key(name)).cloned().collect(),
            waits_in: self.waits_in,
        }
    }

    /// Rollouts of an interrupted trial that this one continues, without void ones.
    pub fn continued_repeats(&self) -> u32 {
        self.origin().repeats.iter().filter(|repeat| repeat.verdict != Some(Verdict::Void)).count() as u32
    }

    fn origin(&self) -> Origin {
        if self.draft.enqueued { Origin::of(&self.draft.attributes) } else { Origin::new(ProposalSource::Sampler) }
    }

    /// Returns the proposal for the operator. A gain that differs from the configuration shows as changed, also where the
    /// trial's origin brought it.
    pub fn proposal(&self) -> Proposal {
        let changed = |changes: &BTreeMap<String, f64>, name: &str, own| changes.get(name).copied().unwrap_or(own);
        let parameter = |name: &str, own: f64| ProposedParameter {
            name: name.to_owned(),
            value: changed(&self.changes.parameters, name, own),
            proposed: own,
        };
        let parameters: Vec<_> = self.draft.parameters.iter().map(|p| parameter(&p.name, p.value)).collect();
        let gain = |((name, own), (_, configured)): (&(String, f64), &(String, f64))| {
            let optimized = parameters.iter().find(|p| p.name == *name).map(|p| p.value);
            ProposedParameter {
                name: name.clone(),
                value: optimized.unwrap_or_else(|| changed(&self.changes.gains, name, *own)),
                proposed: optimized.unwrap_or(*configured),
            }
        };
        let gains = self.gains.iter().zip(&self.configured).map(gain).collect();
        let origin = self.origin();
        Proposal {
            trial: self.number(),
            revision: self.revision,
            source: if self.is_changed() { ProposalSource::Operator } else { origin.source },
            parent: origin.parent,
            risk: self.risk(&parameters),
            expected: self.expected(&parameters),
            parameters,
            gains,
            repeat: 0,
            repeats: 0,
        }
    }

    /// Whether the sampler `sim` has proposed without its model, as `gp`.
    pub fn lacks_prior(&self) -> bool {
        let about_worlds = self.draft.expected.is_some_and(|expected| expected.worlds.is_some());
        self.study.options().sampler.kind == SamplerKind::Sim && !about_worlds
    }

    /// Returns the distance to earlier falls; none before the first trial that counts.
    fn risk(&self, point: &[ProposedParameter]) -> Option<FallRisk> {
        let point: Vec<_> = point.iter().map(|p| (p.name.clone(), p.value)).collect();
        let risk = insight::FallProximity::of(&point, self.study.trials(), &self.study.options().space);
        (risk.neighbours > 0).then(|| FallRisk {
            nearest_fall: risk.falls.first().map(|(_, distance)| *distance),
            nearest_fall_trial: risk.falls.first().map(|(trial, _)| *trial),
            falls: risk.fell_near as u32,
            neighbours: risk.neighbours as u32,
        })
    }

    /// Returns what the sampler's model expects of the values that run, after overrides as well.
    fn expected(&self, point: &[ProposedParameter]) -> Option<ExpectedResult> {
        let drafted = self.draft.expected.filter(|_| point.iter().all(|p| p.value == p.proposed));
        let point: Vec<_> = point.iter().map(|p| (p.name.clone(), p.value)).collect();
        drafted.or_else(|| self.study.expect(&point)).map(|expected| ExpectedResult {
            value: expected.value,
            deviation: expected.deviation,
            p_stand: expected.p_stand,
            simulated_least: expected.worlds.map(|(least, _)| least),
            simulated_most: expected.worlds.map(|(_, most)| most),
            // Advice on the search, not on the values.
            advises_to_stop: self.draft.expected.is_some_and(|drafted| !drafted.worth_the_risk),
        })
    }

    pub fn insight(&self, model: &ModelPredictions) -> ProposalInsight {
        let (trials, options) = (self.study.trials(), self.study.options());
        let densities = match options.sampler.kind {
            // The densities of a random start have decided nothing.
            SamplerKind::Tpe if !tpe::starts_at_random(&options.sampler, trials, &options.space) => {
                insight::densities(&options.sampler, trials, &options.space, options.direction, INSIGHT_POINTS)
            }
            _ => Vec::new(),
        };
        let importances: ParameterValues = insight::importances(trials, &options.space, options.direction).into();
        let parameter = |(name, proposed): (String, f64)| {
            let density = densities.iter().find(|density| density.name == name);
            ParameterInsight {
                proposed,
                importance: importances.get(&name),
                at: density.map(|density| density.at.clone()).unwrap_or_default(),
                good: density.map(|density| density.good.clone()).unwrap_or_default(),
                bad: density.map(|density| density.bad.clone()).unwrap_or_default(),
                name,
            }
        };
        let parameters = self.draft.point().into_iter().map(parameter).collect();
        ProposalInsight { trial: self.number(), parameters, ..model_insight(model) }
    }
}

/// Returns what the sampler's model says of the finished trials.
pub fn model_insight(model: &ModelPredictions) -> ProposalInsight {
    let predicted = |p: &Prediction| PredictedTrial { trial: p.trial, value: p.value, deviation: p.deviation };
    ProposalInsight {
        predicted: model.trials.iter().map(predicted).collect(),
        best: model.best.map(|best| best.trial),
        simulator: model.simulator.as_ref().map(comparison),
        ..ProposalInsight::default()
    }
}

fn comparison(insight: &PriorInsight) -> SimulatorComparison {
    let world = |world: &WorldWeight| WorldResemblance { name: world.name.clone(), weight: world.weight };
    let mut worlds: Vec<WorldResemblance> = insight.worlds.iter().map(world).collect();
    worlds.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    SimulatorComparison {
        ratio: insight.rho.mean,
        ratio_deviation: insight.rho.deviation,
        bias: insight.bias.mean,
        bias_deviation: insight.bias.deviation,
        worlds,
        contradicted: !insight.trusted,
    }
}

fn change(changes: &mut BTreeMap<String, f64>, name: &str, value: f64, unchanged: bool) {
    if unchanged {
        changes.remove(name);
    } else {
        changes.insert(name.to_owned(), value);
    }
}
