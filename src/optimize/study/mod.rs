//! A study: the history of trials, the next proposal, and the journal that stores both.
//!
//! A proposal has two steps. [`Study::draft`] computes it without effect, so that the operator can review it while the last
//! verdict can still be undone; [`Study::begin`] commits it. Every call that changes the study returns after its lines are
//! in the journal. A study that was killed continues where it stopped: the positions of the random streams are stored
//! with each trial.

mod best;
mod check;
mod draft;
mod error;
mod exchange;
mod import;
mod notes;
mod results;
mod storage;
mod workers;

pub use best::{ModelBest, ModelPredictions};
pub use draft::{DRAWS, SuggestedParameter, TrialDraft};
pub use error::StudyError;
pub use results::WaitingPoint;
pub use storage::Storage;
pub use workers::worker_seed;

use crate::optimize::ask::{Direction, Draws, SamplerConfig, Streams};
use crate::optimize::journal::{
    Applied, AttributeKind, Durability, Journal, JournalError, JournalState, JournalWait, Operation, StudyRecord,
};
use crate::optimize::prior::PriorModel;
use crate::optimize::space::Space;
use crate::optimize::trial::{Trial, TrialState};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Study system attribute of Optuna and its dashboard: names of the objectives.
const METRIC_NAMES: &str = "study:metric_names";

/// Options of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyOptions {
    /// Name, unique within its journal.
    pub name: String,
    /// Direction of the objective.
    pub direction: Direction,
    /// Name of the objective with its unit, shown by the dashboard.
    pub metric: String,
    /// Search space. Its bounds may differ from those of earlier sessions; trials outside it stay in the history.
    pub space: Space,
    /// Sampler with its seed.
    pub sampler: SamplerConfig,
    /// User attributes of a new study; a continued one keeps its own.
    pub attributes: Vec<(String, Value)>,
    /// Whether calls wait for the disk.
    pub durability: Durability,
}

/// Result of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// A value of the objective.
    Complete(f64),
    /// No value: ignored by the samplers.
    Fail,
}

/// Answer of [`Study::tell`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TellOutcome {
    /// The outcome is recorded.
    Recorded,
    /// Another writer, for example the dashboard, has finished the trial, or the condition of [`Study::tell_if`] is false;
    /// nothing is recorded.
    AlreadyFinished,
}

/// An open study.
#[derive(Debug)]
pub struct Study {
    journal: Journal,
    id: usize,
    options: StudyOptions,
    /// Position in the random streams at the opening.
    drawn: Draws,
    /// The streams, read up to their position when the first point is drawn: a reader of the study draws none.
    streams: OnceLock<Streams>,
    /// Part of the search space in which points are drawn; none for the whole space.
    inside: Option<Space>,
    /// Results of simulated robots, for the sampler `sim`.
    prior: Option<Arc<PriorModel>>,
}

impl Study {
    /// Creates the study, or continues the one of that name. Trials of a session that was killed are still running; see
    /// [`Study::running`]. A study of that name with another direction or another scale of a parameter is refused.
    pub fn open(storage: Storage, options: StudyOptions) -> Result<Study, StudyError> {
        let mut journal = storage.journal(options.durability)?;
        if journal.state().find(&options.name).is_none() {
            journal.commit(|journal| {
                let exists = journal.find(&options.name).is_some();
                Ok::<_, JournalError>(if exists { Vec::new() } else { creation(journal.studies().len(), &options) })
            })?;
        }
        let Some(id) = journal.state().find(&options.name) else { return Err(StudyError::Gone(options.name)) };
        let (drawn, streams) = (Draws::default(), OnceLock::new());
        let mut study = Study { journal, id, options, drawn, streams, inside: None, prior: None };
        study.check_compatible()?;
        study.complete_exchange()?;
        study.begin_streams();
        Ok(study)
    }

    /// Continues the random streams of the present seed where the trials of the study have ended.
    fn begin_streams(&mut self) {
        self.drawn = self.draws_so_far();
        self.streams = OnceLock::new();
    }

    fn streams(&self) -> &Streams {
        self.streams.get_or_init(|| {
            let mut streams = Streams::new(self.options.sampler.seed);
            streams.advance_to(self.drawn);
            streams
        })
    }

    /// Returns the wait for the lock of the journal's file, or for its server.
    pub fn journal_wait(&self) -> JournalWait {
        self.journal.wait()
    }

    /// Reads the lines of other writers.
    pub fn refresh(&mut self) -> Result<(), StudyError> {
        Ok(self.journal.refresh()?)
    }

    /// Copies the study to memory: its changes are not stored, and its next proposal is the one that this study would make
    /// after the same changes.
    pub fn fork(&self) -> Study {
        let (options, drawn, streams) = (self.options.clone(), self.drawn, self.streams.clone());
        Study {
            journal: self.journal.fork(),
            id: self.id,
            options,
            drawn,
            streams,
            inside: self.inside.clone(),
            prior: self.prior.clone(),
        }
    }

    /// Gives the results of simulated robots to the sampler `sim`. Without them, or where its model cannot be fitted, it proposes as
    /// `gp`; [`Expectation::worlds`](crate::optimize::ask::Expectation::worlds) of the draft is none then.
    pub fn use_prior(&mut self, prior: Arc<PriorModel>) {
        self.prior = Some(prior);
    }

    /// Replaces the search space; only bounds may differ. As in Optuna, a parameter whose bounds have changed leaves the
    /// joint space and is sampled separately; earlier trials outside the new bounds stay in the history. With
    /// [`StudyError::Incompatible`], for a scale that differs from the stored one, the space is unchanged.
    pub fn search(&mut self, space: Space) -> Result<(), StudyError> {
        let before = std::mem::replace(&mut self.options.space, space);
        self.check_compatible().inspect_err(|_| self.options.space = before)
    }

    /// Draws the next points inside `space`, a part of the search space with the same parameters. Unlike the bounds of
    /// [`Study::search`] it is not stored with the trials, so the joint space of TPE stays as it is.
    pub fn draw_inside(&mut self, space: Space) {
        self.inside = Some(space);
    }

    /// All trials in the order of their numbers.
    pub fn trials(&self) -> &[Trial] {
        &self.record().trials
    }

    /// The trial of that number, or [`StudyError::UnknownTrial`].
    pub fn trial(&self, number: u32) -> Result<&Trial, StudyError> {
        let (study, count) = (self.options.name.clone(), self.trials().len());
        self.trials().get(number as usize).ok_or(StudyError::UnknownTrial { study, trial: number, count })
    }

    /// Running trials: of this session, of other workers, or of a session that was killed.
    pub fn running(&self) -> impl Iterator<Item = &Trial> {
        self.trials().iter().filter(|t| t.state == TrialState::Running)
    }

    /// Enqueued trials in the order in which they begin.
    pub fn waiting(&self) -> impl Iterator<Item = &Trial> {
        self.trials().iter().filter(|t| t.state == TrialState::Waiting)
    }

    /// Options of the study.
    pub fn options(&self) -> &StudyOptions {
        &self.options
    }

    /// Name of the objective; empty where the study names none.
    pub fn metric_name(&self) -> &str {
        let names = self.record().system_attributes.get(METRIC_NAMES).and_then(Value::as_array);
        names.and_then(|names| names.first()?.as_str()).unwrap_or_default()
    }

    /// User attributes of the study.
    pub fn attributes(&self) -> &BTreeMap<String, Value> {
        &self.record().user_attributes
    }

    /// Identity of this writer: the `worker` of the trials that it begins.
    pub fn worker(&self) -> &str {
        self.journal.worker()
    }

    /// Numbers of the trials that a commit has created.
    fn created(&self, applied: &[Applied]) -> impl Iterator<Item = u32> {
        applied.iter().filter_map(|result| match result {
            Applied::Created(id) => self.journal.state().trial(*id).map(|trial| trial.number),
            _ => None,
        })
    }

    /// [`Journal::commit`] while the study is in the journal.
    ///
    /// # Errors
    /// [`StudyError::Gone`] if another program has deleted it: every reader ignores lines of a deleted study.
    fn commit(
        &mut self,
        mut decide: impl FnMut(&JournalState) -> Result<Vec<Operation>, StudyError>,
    ) -> Result<Vec<Applied>, StudyError> {
        let study = self.id;
        self.journal.commit(|journal| match journal.studies().get(study) {
            Some(record) if record.deleted => Err(StudyError::Gone(record.name.clone())),
            _ => decide(journal),
        })
    }

    fn record(&self) -> &StudyRecord {
        &self.journal.state().studies()[self.id]
    }
}

/// The operations that create a study.
fn creation(study: usize, options: &StudyOptions) -> Vec<Operation> {
    let create = Operation::CreateStudy { name: options.name.clone(), directions: vec![options.direction as u64] };
    let metric = vec![options.metric.clone()];
    let metric = Operation::study_attribute(study, AttributeKind::System, METRIC_NAMES, metric);
    [create, metric].into_iter().chain(study_attributes(study, &options.attributes)).collect()
}

fn study_attributes(study: usize, attributes: &[(String, Value)]) -> impl Iterator<Item = Operation> {
    let set = move |(key, value): &(String, Value)| {
        Operation::study_attribute(study, AttributeKind::User, key, value.clone())
    };
    attributes.iter().map(set)
}

fn user_attributes(trial: u64, attributes: &[(String, Value)]) -> impl Iterator<Item = Operation> {
    let set = move |(key, value): &(String, Value)| {
        Operation::trial_attribute(trial, AttributeKind::User, key, value.clone())
    };
    attributes.iter().map(set)
}
