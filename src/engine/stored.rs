//! Stored studies, on disk or on a server, of this program and of others.

use std::path::Path;

use super::EngineError;
use super::folder::{STUDY_FILE, is_file, study_files};
use crate::config::Config;
use crate::optimize::ask::{Direction, SamplerConfig};
use crate::optimize::journal::{Durability, JournalError, StudyRecord};
use crate::optimize::space::{Range, Space};
use crate::optimize::study::{ModelBest, Storage, Study, StudyError, StudyOptions};
use crate::optimize::trial::{Distribution, Trial};
use crate::session::experiment::study_attributes::StudyAttributes;
use crate::session::experiment::{best_of, confirmation_in_words, judged, rows_of};
use crate::trial::{ParameterInfo, Task, TrialRecord};

/// Description of a stored study of this program.
#[expect(missing_docs, reason = "the types say the rest")]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredStudy {
    /// Name in its journal, which another program may have changed; none for a study that is not made yet.
    pub name: Option<String>,
    pub task: Task,
    pub seed: u32,
    pub robot: String,
    /// Trials that are to count; none where an older version made it.
    pub budget: Option<u32>,
    /// Unit of the objective; none for that of the task.
    pub unit: Option<String>,
}

/// Returns whether there is a journal to read in `storage`: to open the journal of a missing file would make its folder.
///
/// # Errors
/// When it is a file and its place cannot be looked at.
pub fn has_journal(storage: &Storage) -> Result<bool, EngineError> {
    match storage {
        Storage::Memory => Ok(false),
        Storage::File(file) => is_file(file)
            .map_err(|source| StudyError::from(JournalError::Io { action: "open", path: file.clone(), source }).into()),
        Storage::Redis(_) => Ok(true),
    }
}

/// Returns the names of all studies in `storage`, each with its description if this program made it; none if the file does not exist.
pub fn named_studies(storage: &Storage) -> Result<Vec<(String, Option<StoredStudy>)>, EngineError> {
    let journal = storage.journal(Durability::Synced).map_err(StudyError::from)?;
    let living = journal.state().studies().iter().filter(|study| !study.deleted);
    Ok(living.map(|study| (study.name.clone(), stored(study))).collect())
}

/// Returns the studies of this program in `storage`; none if the file does not exist.
pub fn stored_studies(storage: &Storage) -> Result<Vec<StoredStudy>, EngineError> {
    Ok(named_studies(storage)?.into_iter().filter_map(|(_, ours)| ours).collect())
}

/// Returns the study in `file`.
pub fn stored_study(file: &Path) -> Result<StoredStudy, EngineError> {
    let studies = stored_studies(&Storage::File(file.to_owned()))?;
    studies.into_iter().next().ok_or_else(|| EngineError::NoStudy { file: file.to_owned() })
}

fn stored(study: &StudyRecord) -> Option<StoredStudy> {
    let StudyAttributes { task, seed, robot, budget, unit, .. } = StudyAttributes::of(&study.user_attributes);
    let name = Some(study.name.clone());
    Some(StoredStudy { name, task: task?, seed: seed?, robot: robot?, budget, unit })
}

/// A study of any program, opened for reading or adding trials.
#[derive(Debug)]
pub struct Opened {
    /// The study.
    pub study: Study,
    /// Its description; none for a study of another program.
    pub ours: Option<StoredStudy>,
    /// Its parameters with their present bounds.
    pub parameters: Vec<ParameterInfo>,
    /// Best trial by the sampler's model, a verdict that can still be taken back included.
    model_best: Option<ModelBest>,
    confirmation: Option<String>,
}

impl Opened {
    /// Returns the unit of the objective; empty where it is not known.
    pub fn unit(&self) -> &str {
        self.ours.as_ref().map_or("", |ours| ours.unit.as_deref().unwrap_or(ours.task.unit()))
    }

    /// Returns the trial table.
    pub fn rows(&self) -> Vec<TrialRecord> {
        rows_of(&self.study, &self.parameters)
    }

    /// Returns the state or the result of the newest confirmation of the best, when the study was opened, as a sentence without its
    /// end; none without one, and for a study of another program.
    pub fn confirmation_in_words(&self) -> Option<&str> {
        self.confirmation.as_deref()
    }

    /// Returns the best trial by the sampler's model when the study was opened; none if trials have finished since it was stored.
    pub fn model_best(&self) -> Option<ModelBest> {
        self.model_best
    }

    /// Returns the row of the best trial, as a session shows it ([`best_of`]).
    pub fn best<'a>(&self, rows: &'a [TrialRecord]) -> Option<&'a TrialRecord> {
        best_of(&self.study, rows.iter(), self.model_best)
    }
}

/// Opens the study `name` of `storage`, or its only one. Its bounds are those that the operator set during the study, or
/// those of `config` for its task; for a study of another program those of its newest trials.
///
/// # Errors
/// When there is no such study, or several and no name; when it has no parameter yet, several objectives, or cannot be
/// read.
pub fn open_stored(storage: &Storage, name: Option<&str>, config: &Config) -> Result<Opened, EngineError> {
    if let Storage::File(file) = storage
        && !has_journal(storage)?
    {
        let folder = file.parent().filter(|folder| file.ends_with(STUDY_FILE) && folder.is_dir());
        return Err(match folder {
            Some(folder) => {
                let below = study_files(folder).map_or(0, |files| files.len());
                EngineError::NoStudyInFolder { folder: folder.to_owned(), below }
            }
            None => EngineError::NoJournal { file: file.clone() },
        });
    }
    let journal = storage.journal(Durability::Synced).map_err(StudyError::from)?;
    let living: Vec<&StudyRecord> = journal.state().studies().iter().filter(|study| !study.deleted).collect();
    let names = || living.iter().map(|study| study.name.as_str()).collect::<Vec<_>>().join(", ");
    let journal_name = || storage.to_string();
    let record = match (name, living.as_slice()) {
        (Some(name), _) => living.iter().find(|study| study.name == name).copied(),
        (None, [only]) => Some(*only),
        (None, []) => None,
        (None, _) => return Err(EngineError::WhichStudy { journal: journal_name(), names: names() }),
    };
    let Some(record) = record else {
        return Err(EngineError::NoSuchStudy { journal: journal_name(), names: names() });
    };
    let ours = stored(record);
    let parameters = match &ours {
        Some(ours) => narrowed(config.parameters(ours.task), record),
        None => newest_bounds(record),
    };
    let reason = match (record.directions.len(), parameters.is_empty()) {
        (1, false) => None,
        (1, true) => Some(without_floats(record)),
        (objectives, _) => Some(format!("it has {objectives} objectives; this program reads studies of one")),
    };
    if let Some(reason) = reason {
        return Err(EngineError::Unusable { journal: journal_name(), name: record.name.clone(), reason });
    }
    let direction =
        if record.directions == [Direction::Minimize as u64] { Direction::Minimize } else { Direction::Maximize };
    let log = |name: &str| {
        let range = record.trials.iter().rev().find_map(|trial| trial.distribution(name)?.range());
        range.is_some_and(|range| range.log)
    };
    let range = |p: &ParameterInfo| (p.name.clone(), Range { low: p.low, high: p.high, log: log(&p.name) });
    let options = StudyOptions {
        name: record.name.clone(),
        direction,
        metric: String::new(),
        space: Space::new(parameters.iter().map(range))?,
        sampler: SamplerConfig::default(),
        attributes: Vec::new(),
        durability: Durability::Synced,
    };
    let study = Study::open(storage.clone(), options)?;
    let judged = judged(&study)?;
    let confirmation = ours.as_ref().and(confirmation_in_words(&judged, config.optimize.confirm.confidence));
    Ok(Opened { model_best: judged.model_best(), study, ours, parameters, confirmation })
}

/// Returns the reason for which a study without real-valued parameters is refused.
fn without_floats(record: &StudyRecord) -> String {
    let of_trial =
        |trial: &Trial| trial.parameters.iter().zip(&trial.distributions).next().map(|(p, d)| (p.0.clone(), d.clone()));
    match record.trials.iter().find_map(of_trial) {
        Some((name, Distribution::Foreign { kind, .. })) => {
            format!(
                "none of its parameters is a real number ({name} has a {kind}); this program reads studies with one"
            )
        }
        _ => "no trial of it has a parameter yet".to_owned(),
    }
}

/// Replaces configured bounds by those that the operator set.
fn narrowed(configured: Vec<ParameterInfo>, record: &StudyRecord) -> Vec<ParameterInfo> {
    let bounds = StudyAttributes::of(&record.user_attributes).bounds.unwrap_or_default();
    let present = |parameter: ParameterInfo| match bounds.get(&parameter.name) {
        Some(&[low, high]) if low < high => ParameterInfo { low, high, ..parameter },
        _ => parameter,
    };
    configured.into_iter().map(present).collect()
}

/// Returns the float parameters of a study's trials, each with its newest bounds.
fn newest_bounds(record: &StudyRecord) -> Vec<ParameterInfo> {
    let mut parameters: Vec<ParameterInfo> = Vec::new();
    for trial in &record.trials {
        for ((name, _), distribution) in trial.parameters.iter().zip(&trial.distributions) {
            let Some(Range { low, high, .. }) = distribution.range() else { continue };
            let info = ParameterInfo { name: name.clone(), unit: String::new(), low, high };
            match parameters.iter_mut().find(|parameter| parameter.name == *name) {
                Some(known) => *known = info,
                None => parameters.push(info),
            }
        }
    }
    parameters
}
