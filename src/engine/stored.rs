//! Studies as they lie on disk or on a server: ours, and those of other programs.

use std::path::{Path, PathBuf};

use super::EngineError;
use crate::config::Config;
use crate::optimize::journal::{Durability, StudyRecord};
use crate::optimize::sampler::{Direction, SamplerConfig};
use crate::optimize::space::{Range, Space};
use crate::optimize::study::{Storage, Study, StudyError, StudyOptions};
use crate::session::experiment::BUDGET;
use crate::trial::{ParameterInfo, Task};

/// A study of this program that is on disk, or on a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredStudy {
    /// Its task.
    pub task: Task,
    /// Its seed.
    pub seed: u32,
    /// The robot model that it was made with.
    pub robot: String,
    /// How many trials are to count; none where an older version made it.
    pub budget: Option<u32>,
}

/// The studies of this program that `storage` holds; a file that does not exist holds none.
///
/// # Errors
/// When it cannot be read.
pub fn stored_studies(storage: &Storage) -> Result<Vec<StoredStudy>, EngineError> {
    let journal = storage.journal(Durability::Synced).map_err(StudyError::from)?;
    let living = journal.replay().studies().iter().filter(|study| !study.deleted);
    Ok(living.filter_map(stored).collect())
}

/// What study `file` holds.
///
/// # Errors
/// When the file cannot be read or holds no study of this program.
pub fn stored_study(file: &Path) -> Result<StoredStudy, EngineError> {
    let studies = stored_studies(&Storage::File(file.to_owned()))?;
    studies.into_iter().next().ok_or_else(|| EngineError::NoStudy { file: file.to_owned() })
}

fn stored(study: &StudyRecord) -> Option<StoredStudy> {
    let attribute = |name: &str| study.user_attributes.get(name);
    let number = |name: &str| u32::try_from(attribute(name)?.as_u64()?).ok();
    Some(StoredStudy {
        task: Task::from_name(attribute("task")?.as_str()?)?,
        seed: number("seed")?,
        robot: attribute("robot")?.as_str()?.to_owned(),
        budget: number(BUDGET),
    })
}

/// A study that was opened to be looked at or added to, whichever program made it.
#[derive(Debug)]
pub struct Opened {
    /// The study.
    pub study: Study,
    /// What this program knows of it; none for a study of another program.
    pub ours: Option<StoredStudy>,
    /// Its parameters with their present bounds.
    pub parameters: Vec<ParameterInfo>,
}

impl Opened {
    /// Unit of the objective; empty where it is not known.
    pub fn unit(&self) -> &'static str {
        self.ours.as_ref().map_or("", |ours| ours.task.unit())
    }
}

/// Opens the study `name` of `storage`, or its only one. Bounds are those that the study was given in mid-study, or those
/// of `config` for its task; a study of another program has those of its newest trials.
///
/// # Errors
/// When there is no such study, or several and no name; when it has no parameter yet, several objectives, or cannot be
/// read.
pub fn open_stored(storage: &Storage, name: Option<&str>, config: &Config) -> Result<Opened, EngineError> {
    if let Storage::File(file) = storage
        && !file.is_file()
    {
        return Err(EngineError::NoJournal { file: file.clone() });
    }
    let journal = storage.journal(Durability::Synced).map_err(StudyError::from)?;
    let living: Vec<&StudyRecord> = journal.replay().studies().iter().filter(|study| !study.deleted).collect();
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
        None => seen(record),
    };
    if parameters.is_empty() || record.directions.len() != 1 {
        return Err(EngineError::Unusable { journal: journal_name(), name: record.name.clone() });
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
    Ok(Opened { study: Study::open(storage.clone(), options)?, ours, parameters })
}

/// Configured bounds, replaced by those that an operator gave the study.
fn narrowed(configured: Vec<ParameterInfo>, record: &StudyRecord) -> Vec<ParameterInfo> {
    let bound = |name: &str, i: usize| record.user_attributes.get("bounds")?.get(name)?.get(i)?.as_f64();
    let present = |parameter: ParameterInfo| match (bound(&parameter.name, 0), bound(&parameter.name, 1)) {
        (Some(low), Some(high)) if low < high => ParameterInfo { low, high, ..parameter },
        _ => parameter,
    };
    configured.into_iter().map(present).collect()
}

/// The float parameters of a study's trials, each with its newest bounds.
fn seen(record: &StudyRecord) -> Vec<ParameterInfo> {
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

/// The configuration that ran last in a study's folder, with its number: 1 for `config/`, N for `config-N/`; none where
/// none was kept.
pub fn newest_config(folder: &Path) -> Option<(u32, PathBuf)> {
    let numbered = |path: PathBuf| {
        let number = match path.file_name()?.to_str()? {
            "config" => 1,
            name => name.strip_prefix("config-")?.parse().ok()?,
        };
        path.is_dir().then_some((number, path))
    };
    let entries = std::fs::read_dir(folder).ok()?;
    entries.filter_map(|entry| numbered(entry.ok()?.path())).max_by_key(|(number, _)| *number)
}

/// The study files below `folder`, in the order of their names: `folder` itself if it is one, and the folders in it.
///
/// # Errors
/// When the folder cannot be read.
pub fn study_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let own = folder.join(super::STUDY_FILE);
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path().join(super::STUDY_FILE)))
        .chain([own])
        .filter(|file| file.is_file())
        .collect();
    files.sort();
    Ok(files)
}
