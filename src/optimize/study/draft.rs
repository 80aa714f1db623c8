//! Proposals: drafted without effect, then begun.

use super::{Study, StudyError, StudyOptions, user_attributes};
use crate::optimize::ask::{Ask, Draws, Expectation};
use crate::optimize::journal::{AttributeKind, Operation};
use crate::optimize::sampler::{self, propose};
use crate::optimize::space::{Parameter, Range};
use crate::optimize::trial::{Distribution, FIXED_PARAMS, Trial, TrialState, announcement, json_object, value_of};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Trial system attribute: seed and positions of the random streams after the draws of the trial.
pub const DRAWS: &str = "quadfrog:draws";

/// Most doubles that the draws of one trial take from a stream: 10000 candidates of TPE for ten parameters take 310000.
const MOST_DRAWS: u64 = 1 << 20;

/// Value of the attribute [`DRAWS`].
#[derive(Serialize, Deserialize)]
struct StreamPosition {
    seed: u32,
    #[serde(flatten)]
    draws: Draws,
}

/// A parameter of a proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct SuggestedParameter {
    /// Name.
    pub name: String,
    /// Proposed value, in the parameter's own unit.
    pub value: f64,
    /// Whether the value was given, not suggested by the sampler.
    pub fixed: bool,
    /// Bounds and scale of the search.
    pub range: Range,
}

/// A proposal without effect on the study.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialDraft {
    /// Number of the trial, unless another worker begins one first.
    pub number: u32,
    /// The parameters in the order of the space.
    pub parameters: Vec<SuggestedParameter>,
    /// Whether it is an enqueued trial.
    pub enqueued: bool,
    /// User attributes of the enqueued trial.
    pub attributes: BTreeMap<String, Value>,
    /// The joint sample of TPE, by name; announced to other workers.
    pub joint: Vec<(String, f64)>,
    /// Expectation of the sampler's model of the trial at the values above.
    pub expected: Option<Expectation>,
    /// Seed of the random streams.
    pub seed: u32,
    /// Positions of the streams before the draws.
    pub before: Draws,
    /// Positions of the streams after the draws.
    pub after: Draws,
    /// Id of the enqueued trial.
    pub(super) waiting: Option<u64>,
    /// The values with which it was queued: points of the queue change places.
    pub(super) queued: Vec<(String, f64)>,
}

impl TrialDraft {
    /// The proposed values by name.
    pub fn point(&self) -> Vec<(String, f64)> {
        self.parameters.iter().map(|p| (p.name.clone(), p.value)).collect()
    }

    /// Whether `trial` was queued with the point of this draft: another program may have exchanged points of the queue.
    pub fn is_of(&self, trial: &Trial) -> bool {
        let bits = |(name, value): &(String, f64)| (name.clone(), value.to_bits());
        trial.fixed().iter().map(bits).eq(self.queued.iter().map(bits))
    }
}

impl Study {
    /// Computes the next proposal without effect; a second call returns the same. The enqueued trial of lowest number comes
    /// first.
    pub fn draft(&self) -> TrialDraft {
        self.draft_with(&[])
    }

    /// Computes the next proposal with the parameters `fixed` given, as Optuna for a partly fixed trial. In the startup phase
    /// and in univariate mode the other parameters can differ from those of [`Study::draft`], because given parameters
    /// use no random numbers.
    pub fn draft_with(&self, fixed: &[(String, f64)]) -> TrialDraft {
        let trials = self.trials();
        let waiting = trials.iter().find(|t| t.state == TrialState::Waiting);
        let given = merged(waiting.map(Trial::fixed).unwrap_or_default(), fixed);
        let mut streams = self.streams().clone();
        let before = streams.draws();
        let space = &self.options.space;
        let ask = self.ask(&given);
        let candidate = propose(&ask, &mut streams);
        let suggest = |(p, value): (&Parameter, f64)| SuggestedParameter {
            name: p.name.clone(),
            value,
            fixed: value_of(&given, &p.name).is_some(),
            range: p.range,
        };
        TrialDraft {
            number: waiting.map_or(trials.len() as u32, |t| t.number),
            parameters: space.parameters().iter().zip(candidate.values).map(suggest).collect(),
            enqueued: waiting.is_some(),
            attributes: waiting.map(|t| t.user_attributes.clone()).unwrap_or_default(),
            joint: candidate.joint,
            expected: candidate.expected,
            seed: self.options.sampler.seed,
            before,
            after: streams.draws(),
            waiting: waiting.map(|t| t.id),
            queued: waiting.map(Trial::fixed).unwrap_or_default(),
        }
    }

    /// The question to the sampler with some parameters given.
    pub(super) fn ask<'a>(&'a self, given: &'a [(String, f64)]) -> Ask<'a> {
        let StudyOptions { sampler, space, direction, .. } = &self.options;
        let space = self.inside.as_ref().unwrap_or(space);
        Ask {
            config: sampler,
            trials: self.trials(),
            space,
            fixed: given,
            direction: *direction,
            prior: self.prior.as_deref(),
        }
    }

    /// Returns what the sampler's model expects of a trial at `point`, which has a value for each parameter; none without a model
    /// or before it has enough trials.
    pub fn expect(&self, point: &[(String, f64)]) -> Option<Expectation> {
        let values: Option<Vec<f64>> =
            self.options.space.parameters().iter().map(|p| value_of(point, &p.name)).collect();
        sampler::expect(&self.ask(&[]), &values?)
    }

    /// The draft with another waiting trial: for a trial that was queued in a fork and then in this study.
    pub fn redirected(&self, draft: &TrialDraft, waiting: u32) -> Result<TrialDraft, StudyError> {
        let trial = self.trial(waiting)?;
        Ok(TrialDraft { number: waiting, waiting: Some(trial.id), queued: trial.fixed(), ..draft.clone() })
    }

    /// Begins the trial of a draft and records it as running. Values in `overrides` replace those of the draft and are
    /// recorded as fixed. If all parameters are given, no random numbers are used. Returns the number of the trial.
    ///
    /// # Errors
    /// [`StudyError::StaleDraft`] if another trial has begun from the same streams, or another worker has begun the enqueued
    /// trial or exchanged its point; [`StudyError::UnknownParameter`] or [`StudyError::Value`] for an override. The study is
    /// unchanged then.
    pub fn begin(
        &mut self,
        draft: &TrialDraft,
        overrides: &[(String, f64)],
        attributes: &[(String, Value)],
    ) -> Result<u32, StudyError> {
        self.begin_if(draft, overrides, attributes, TrialState::Running, &|_| true)
    }

    /// [`Study::begin`] if `room`, called with all trials while the journal is locked, returns true: workers on a shared
    /// journal keep a common budget exactly. [`StudyError::Full`] if it returns false. The trial has `state` from then on: a
    /// trial that is not run has failed already, in the same commit.
    pub fn begin_if(
        &mut self,
        draft: &TrialDraft,
        overrides: &[(String, f64)],
        attributes: &[(String, Value)],
        state: TrialState,
        room: &dyn Fn(&[Trial]) -> bool,
    ) -> Result<u32, StudyError> {
        self.check_parameters(overrides)?;
        let stale = || StudyError::StaleDraft { trial: draft.number };
        if draft.before != self.streams().draws() || draft.seed != self.options.sampler.seed {
            return Err(stale());
        }
        let fixed = draft.parameters.iter().filter(|s| s.fixed).map(|s| (s.name.clone(), s.value));
        let given = merged(fixed.collect(), overrides);
        let nothing_drawn = draft.parameters.iter().all(|s| value_of(&given, &s.name).is_some() || s.range.is_point());
        let draws = if nothing_drawn { draft.before } else { draft.after };
        let (study, seed) = (self.id, draft.seed);
        let mut id = 0;
        self.commit(|journal| {
            if !journal.studies().get(study).is_some_and(|record| room(&record.trials)) {
                return Err(StudyError::Full);
            }
            id = draft.waiting.unwrap_or(journal.next_trial_id());
            let (waiting, now) = (journal.trial(id), Some(Timestamp::now()));
            let mut system = announcement(&draft.joint);
            system.push((DRAWS.to_owned(), json!(StreamPosition { seed, draws })));
            let fixed = (!given.is_empty()).then(|| (FIXED_PARAMS.to_owned(), json_object(&given)));
            let values = draft.parameters.iter().map(|s| {
                let value = value_of(overrides, &s.name).unwrap_or(s.value);
                (s.name.clone(), value, Distribution::Float(s.range))
            });
            // A program that is ended within the append leaves a trial that has begun with all of this, or none.
            let mut operations = match (draft.waiting, waiting) {
                (None, _) => {
                    let mut begun = Trial::new(draft.number, TrialState::Running);
                    values.for_each(|(name, value, distribution)| begun.set(&name, value, distribution));
                    begun.system_attributes = system.into_iter().chain(fixed).collect();
                    begun.user_attributes = attributes.iter().cloned().collect();
                    vec![Operation::CreateTrial { study, started: now, template: Some(Box::new(begun)) }]
                }
                (_, Some(trial)) if trial.state == TrialState::Waiting && draft.is_of(trial) => {
                    let set = |(key, value): (String, Value)| {
                        Operation::trial_attribute(id, AttributeKind::System, &key, value)
                    };
                    let mut contents: Vec<Operation> = user_attributes(id, attributes).collect();
                    contents.extend(values.map(|(name, value, distribution)| Operation::SetParameter {
                        trial: id,
                        name,
                        value,
                        distribution,
                    }));
                    contents.extend(system.into_iter().map(set));
                    contents.push(Operation::SetState { trial: id, state: TrialState::Running, values: None, at: now });
                    contents.extend(fixed.map(set));
                    contents
                }
                _ => return Err(stale()),
            };
            if state != TrialState::Running {
                operations.push(Operation::SetState { trial: id, state, values: None, at: now });
            }
            Ok(operations)
        })?;
        let mut streams = self.streams().clone();
        streams.advance_to(draws);
        self.streams = streams.into();
        self.journal.state().trial(id).map(|t| t.number).ok_or_else(|| StudyError::Gone(self.options.name.clone()))
    }

    /// The farthest position in the streams of the present seed over all trials. One that the trials up to it cannot have reached
    /// is none of this program: to read up to it would take hours.
    pub(super) fn draws_so_far(&self) -> Draws {
        let position = |t: &Trial| StreamPosition::deserialize(t.system_attributes.get(DRAWS)?).ok();
        let reachable = |t: &Trial, draws: Draws| {
            draws.model.max(draws.startup) <= (u64::from(t.number) + 1).saturating_mul(MOST_DRAWS)
        };
        let seed = self.options.sampler.seed;
        // One whose begin was cut off still waits: its draws are repeated.
        let begun = self.trials().iter().filter(|t| t.state != TrialState::Waiting);
        let own = begun.filter_map(|t| position(t).filter(|p| p.seed == seed && reachable(t, p.draws)));
        own.map(|p| p.draws)
            .fold(Draws::default(), |a, b| Draws { model: a.model.max(b.model), startup: a.startup.max(b.startup) })
    }
}

/// `base` with the values of `over` replaced or added.
fn merged(mut base: Vec<(String, f64)>, over: &[(String, f64)]) -> Vec<(String, f64)> {
    base.retain(|(n, _)| over.iter().all(|(m, _)| m != n));
    base.extend_from_slice(over);
    base
}
