//! A study: what has been tried, what to try next, and the journal that remembers it.
//!
//! A proposal is made in two steps. [`Study::draft`] computes it without any effect, so that the operator can look at it
//! while the last verdict may still be undone; [`Study::begin`] commits it. After every call that changes the study its
//! lines are in the journal, so that a study killed at any moment continues where it was: the positions of the random
//! streams are kept with each trial.

mod check;
mod draft;
mod error;
mod import;
mod notes;
mod storage;
mod telling;
mod workers;

pub use draft::{Draft, Suggestion};
pub use error::StudyError;
pub use storage::Storage;
pub use workers::worker_seed;

use crate::optimize::journal::{Durability, Journal, JournalError, Operation, StudyRecord};
use crate::optimize::sampler::{Direction, Draws, SamplerConfig, Streams, propose};
use crate::optimize::space::{Parameter, Range, Space};
use crate::optimize::trial::{Distribution, FIXED_PARAMS, Trial, TrialState, announcement};
use jiff::Timestamp;
use serde_json::Value;
use std::collections::BTreeMap;

/// Trial system attribute: seed of the streams and how far they had been read when the trial began.
pub const DRAWS: &str = "quadfrog:draws";
/// Study system attribute: names of the objectives, as Optuna and its dashboard know it.
const METRIC_NAMES: &str = "study:metric_names";

/// What a study is.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyOptions {
    /// Name, unique within its journal.
    pub name: String,
    /// Whether the objective is to grow or to shrink.
    pub direction: Direction,
    /// Name of the objective, with its unit: shown by the dashboard.
    pub metric: String,
    /// What is searched. It may differ from that of earlier sessions: trials outside it stay in the history.
    pub space: Space,
    /// Which sampler proposes, with its seed.
    pub sampler: SamplerConfig,
    /// User attributes that a new study gets; one that is continued keeps its own.
    pub attributes: Vec<(String, Value)>,
    /// Whether calls wait for the disk.
    pub durability: Durability,
}

/// How a trial ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// With a value of the objective.
    Complete(f64),
    /// Without one: the samplers will not see it.
    Fail,
}

/// What became of an outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// It was recorded.
    Recorded,
    /// Somebody else, for example at the dashboard, had finished the trial already, or was about to; theirs stands.
    AlreadyFinished,
}

/// A study, open for asking and telling.
#[derive(Debug)]
pub struct Study {
    journal: Journal,
    id: usize,
    options: StudyOptions,
    streams: Streams,
}

impl Study {
    /// Creates the study, or continues the one of that name where it stands. Trials left running by a session that was
    /// killed are still running then; see [`Study::running`].
    ///
    /// # Errors
    /// If the journal cannot be read or written, or holds a study of that name with another direction or another scale of
    /// a parameter.
    pub fn open(storage: Storage, options: StudyOptions) -> Result<Study, StudyError> {
        let mut journal = storage.journal(options.durability)?;
        if journal.replay().find(&options.name).is_none() {
            journal.commit(|replay| {
                let exists = replay.find(&options.name).is_some();
                let id = replay.studies().len();
                Ok::<_, JournalError>(if exists { Vec::new() } else { creation(id, &options) })
            })?;
        }
        let Some(id) = journal.replay().find(&options.name) else { return Err(StudyError::Gone(options.name)) };
        let streams = Streams::new(options.sampler.seed);
        let mut study = Study { journal, id, options, streams };
        study.check_compatible()?;
        study.streams.advance_to(study.draws_so_far());
        Ok(study)
    }

    /// Takes in what other writers have appended.
    ///
    /// # Errors
    /// If the journal cannot be read.
    pub fn refresh(&mut self) -> Result<(), StudyError> {
        Ok(self.journal.refresh()?)
    }

    /// The same study in memory: what is told to it reaches no disk, and its next proposal is the one that this study
    /// would make if it were told the same.
    pub fn fork(&self) -> Study {
        Study {
            journal: self.journal.fork(),
            id: self.id,
            options: self.options.clone(),
            streams: self.streams.clone(),
        }
    }

    /// The next proposal, without any effect: twice gives the same. The enqueued trial of lowest number comes first.
    pub fn draft(&self) -> Draft {
        self.draft_with(&[])
    }

    /// The next proposal if the parameters `fixed` are given: what Optuna suggests for a partly fixed trial. In the startup
    /// phase and in univariate mode the other parameters may then differ from those of [`Study::draft`], because given
    /// ones use no random numbers.
    pub fn draft_with(&self, fixed: &[(String, f64)]) -> Draft {
        let trials = self.trials();
        let waiting = trials.iter().find(|t| t.state == TrialState::Waiting);
        let given = merged(waiting.map(Trial::fixed).unwrap_or_default(), fixed);
        let before = self.streams.draws();
        let mut streams = self.streams.clone();
        let StudyOptions { sampler, space, direction, .. } = &self.options;
        let proposal = propose(sampler, &mut streams, trials, space, &given, *direction);
        let suggest = |(p, value): (&Parameter, f64)| Suggestion {
            name: p.name.clone(),
            value,
            fixed: given.iter().any(|(n, _)| *n == p.name),
            low: p.range.low,
            high: p.range.high,
            log: p.range.log,
        };
        Draft {
            number: waiting.map_or(trials.len() as u32, |t| t.number),
            parameters: space.parameters().iter().zip(proposal.values).map(suggest).collect(),
            enqueued: waiting.is_some(),
            attributes: waiting.map(|t| t.user_attributes.clone()).unwrap_or_default(),
            joint: proposal.joint,
            seed: sampler.seed,
            before,
            after: streams.draws(),
            waiting: waiting.map(|t| t.id),
        }
    }

    /// Searches `space` from now on; its parameters must be those of before, only bounds may differ. As in Optuna, a
    /// parameter whose bounds have changed leaves the joint space and is sampled by itself from then on; earlier trials
    /// outside the new bounds stay in the history.
    ///
    /// # Errors
    /// [`StudyError::Incompatible`] if the scale of a parameter differs from the stored one. The old space stands then.
    pub fn search(&mut self, space: Space) -> Result<(), StudyError> {
        let before = std::mem::replace(&mut self.options.space, space);
        self.check_compatible().inspect_err(|_| self.options.space = before)
    }

    /// The draft for another waiting trial: one that was queued in a fork, and then in this study too.
    pub fn redirected(&self, draft: &Draft, waiting: u32) -> Result<Draft, StudyError> {
        let id = self.trial(waiting)?.id;
        Ok(Draft { number: waiting, waiting: Some(id), ..draft.clone() })
    }

    /// Begins the trial of a draft: from here on it is running, in the journal too. Values in `overrides` replace those of
    /// the draft and are recorded as fixed; the others are as drafted. A draft of which everything is given uses no random
    /// numbers. Returns the number of the trial.
    ///
    /// # Errors
    /// [`StudyError::StaleDraft`] if another trial has begun from the same streams, or the enqueued trial was taken by
    /// another worker; [`StudyError::UnknownParameter`] or [`StudyError::Value`] for an override that cannot be;
    /// journal errors. Nothing has changed then.
    pub fn begin(
        &mut self,
        draft: &Draft,
        overrides: &[(String, f64)],
        attributes: &[(String, Value)],
    ) -> Result<u32, StudyError> {
        self.begin_if(draft, overrides, attributes, |_| true)
    }

    /// [`Study::begin`] if `room` says, of all trials at the very moment, that there is room for one more: workers on a
    /// shared journal can keep a budget to the trial.
    ///
    /// # Errors
    /// As [`Study::begin`]; [`StudyError::Full`] if there is no room.
    pub fn begin_if(
        &mut self,
        draft: &Draft,
        overrides: &[(String, f64)],
        attributes: &[(String, Value)],
        room: impl Fn(&[Trial]) -> bool,
    ) -> Result<u32, StudyError> {
        self.check_parameters(overrides)?;
        let stale = || StudyError::StaleDraft { trial: draft.number };
        if draft.before != self.streams.draws() || draft.seed != self.options.sampler.seed {
            return Err(stale());
        }
        let given: Vec<(String, f64)> =
            merged(draft.parameters.iter().filter(|s| s.fixed).map(|s| (s.name.clone(), s.value)).collect(), overrides);
        let nothing_drawn = draft.parameters.iter().all(|s| given.iter().any(|(n, _)| *n == s.name) || s.low == s.high);
        let draws = if nothing_drawn { draft.before } else { draft.after };
        let (study, seed) = (self.id, draft.seed);
        let mut id = 0;
        self.journal.commit(|replay| {
            if !replay.studies().get(study).is_some_and(|record| room(&record.trials)) {
                return Err(StudyError::Full);
            }
            let now = Timestamp::now();
            let mut operations = Vec::new();
            match draft.waiting {
                Some(waiting) => {
                    id = waiting;
                    if replay.trial(id).is_none_or(|t| t.state != TrialState::Waiting) {
                        return Err(stale());
                    }
                    let state = TrialState::Running;
                    operations.push(Operation::SetState { trial: id, state, values: None, at: Some(now) });
                }
                None => {
                    id = replay.next_trial_id();
                    operations.push(Operation::CreateTrial { study, started: Some(now), template: None });
                }
            }
            let mut system = announcement(&draft.joint);
            if !given.is_empty() {
                let object = given.iter().map(|(n, v)| (n.clone(), Value::from(*v))).collect();
                system.push((FIXED_PARAMS.to_owned(), Value::Object(object)));
            }
            system.push((DRAWS.to_owned(), draws_value(seed, draws)));
            operations.extend(system.into_iter().map(|(key, value)| Operation::TrialSystemAttribute {
                trial: id,
                key,
                value,
            }));
            operations.extend(draft.parameters.iter().map(|s| {
                let value = overrides.iter().find(|(n, _)| *n == s.name).map_or(s.value, |(_, v)| *v);
                let range = Range { low: s.low, high: s.high, log: s.log };
                Operation::SetParameter {
                    trial: id,
                    name: s.name.clone(),
                    value,
                    distribution: Distribution::Float(range),
                }
            }));
            operations.extend(user_attributes(id, attributes));
            Ok(operations)
        })?;
        self.streams.advance_to(draws);
        self.journal.replay().trial(id).map(|t| t.number).ok_or_else(|| StudyError::Gone(self.options.name.clone()))
    }

    /// All trials by number.
    pub fn trials(&self) -> &[Trial] {
        &self.record().trials
    }

    /// The trial of that number.
    ///
    /// # Errors
    /// [`StudyError::UnknownTrial`] if there is none.
    pub fn trial(&self, number: u32) -> Result<&Trial, StudyError> {
        let (study, count) = (self.options.name.clone(), self.trials().len());
        self.trials().get(number as usize).ok_or(StudyError::UnknownTrial { study, trial: number, count })
    }

    /// The complete trial with the best value, the earliest of equal ones.
    pub fn best(&self) -> Option<&Trial> {
        let direction = self.options.direction;
        let complete = self.trials().iter().filter(|t| t.state == TrialState::Complete && t.violation() <= 0.0);
        complete.min_by(|a, b| direction.best_first(a.value.unwrap_or(f64::NAN), b.value.unwrap_or(f64::NAN)))
    }

    /// Trials that have begun and not ended: of other workers, or left by a session that was killed.
    pub fn running(&self) -> impl Iterator<Item = &Trial> {
        self.trials().iter().filter(|t| t.state == TrialState::Running)
    }

    /// Trials that wait to be run, in the order in which they will be.
    pub fn waiting(&self) -> impl Iterator<Item = &Trial> {
        self.trials().iter().filter(|t| t.state == TrialState::Waiting)
    }

    /// What the study is.
    pub fn options(&self) -> &StudyOptions {
        &self.options
    }

    /// User attributes of the study.
    pub fn attributes(&self) -> &BTreeMap<String, Value> {
        &self.record().user_attributes
    }

    /// This session's identity as a writer: the `worker` of the trials that it began.
    pub fn worker(&self) -> &str {
        self.journal.worker()
    }

    fn record(&self) -> &StudyRecord {
        &self.journal.replay().studies()[self.id]
    }

    /// How far streams of our seed have been read by all sessions so far.
    fn draws_so_far(&self) -> Draws {
        let ours = |t: &Trial| {
            let value = t.system_attributes.get(DRAWS)?;
            (value["seed"].as_u64()? == u64::from(self.options.sampler.seed)).then_some(())?;
            Some(Draws { model: value["model"].as_u64()?, startup: value["startup"].as_u64()? })
        };
        self.trials()
            .iter()
            .filter_map(ours)
            .fold(Draws::default(), |a, b| Draws { model: a.model.max(b.model), startup: a.startup.max(b.startup) })
    }
}

/// The operations that make a study.
fn creation(study: usize, options: &StudyOptions) -> Vec<Operation> {
    let create = Operation::CreateStudy { name: options.name.clone(), directions: vec![options.direction as u64] };
    let metric = Operation::StudySystemAttribute {
        study,
        key: METRIC_NAMES.to_owned(),
        value: Value::from(vec![options.metric.clone()]),
    };
    let attribute = |(key, value): &(String, Value)| {
        let (key, value) = (key.clone(), value.clone());
        Operation::StudyUserAttribute { study, key, value }
    };
    [create, metric].into_iter().chain(options.attributes.iter().map(attribute)).collect()
}

fn user_attributes(trial: u64, attributes: &[(String, Value)]) -> impl Iterator<Item = Operation> {
    attributes.iter().map(move |(key, value)| {
        let (key, value) = (key.clone(), value.clone());
        Operation::TrialUserAttribute { trial, key, value }
    })
}

/// `base` with the values of `over` replacing or joining its own.
fn merged(mut base: Vec<(String, f64)>, over: &[(String, f64)]) -> Vec<(String, f64)> {
    base.retain(|(n, _)| over.iter().all(|(m, _)| m != n));
    base.extend_from_slice(over);
    base
}

fn draws_value(seed: u32, draws: Draws) -> Value {
    serde_json::json!({ "seed": seed, "model": draws.model, "startup": draws.startup })
}
