//! The state of a journal: the result of all its lines by Optuna's rules of acceptance (`docs/journal.md`).

use super::operation::{AttributeKind, Operation};
use crate::optimize::trial::{CHANGED_VERDICT, Distribution, Trial, TrialState};
use serde_json::Value;
use std::collections::BTreeMap;

/// A study of the journal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StudyRecord {
    /// Name.
    pub name: String,
    /// Per objective: 0 not set, 1 minimize, 2 maximize.
    pub directions: Vec<u64>,
    /// Whether it has been deleted; its id is not used again.
    pub deleted: bool,
    /// User attributes.
    pub user_attributes: BTreeMap<String, Value>,
    /// System attributes: metric names, notes.
    pub system_attributes: BTreeMap<String, Value>,
    /// Trials in the order of their numbers.
    pub trials: Vec<Trial>,
}

impl StudyRecord {
    /// Sets an attribute. One that changes the verdict of a finished trial changes that trial, too.
    fn set(&mut self, kind: AttributeKind, key: String, value: Value) {
        let number = key.strip_prefix(CHANGED_VERDICT).filter(|_| kind == AttributeKind::User);
        let trial = number.and_then(|number| self.trials.get_mut(number.parse::<usize>().ok()?));
        if let (Some(trial), Some(newest)) = (trial, value.as_array().and_then(|changes| changes.last()))
            && trial.state.is_finished()
        {
            trial.change_verdict(newest);
        }
        kind.of(&mut self.user_attributes, &mut self.system_attributes).insert(key, value);
    }
}

/// All studies of a journal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JournalState {
    studies: Vec<StudyRecord>,
    /// Trial id -> study and number.
    trials: Vec<(usize, usize)>,
}

/// Result of applying an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Applied {
    /// It took effect.
    Accepted,
    /// It created the trial with this id.
    Created(u64),
    /// No effect: its study or trial does not exist, is finished, or was begun by another worker.
    Ignored,
}

impl JournalState {
    /// All studies in the order of their ids, deleted ones included.
    pub fn studies(&self) -> &[StudyRecord] {
        &self.studies
    }

    /// The id of the study of that name, unless deleted.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.studies.iter().position(|s| !s.deleted && s.name == name)
    }

    /// The id of the next trial to be created.
    pub fn next_trial_id(&self) -> u64 {
        self.trials.len() as u64
    }

    /// The trial with an id, in any study.
    pub fn trial(&self, id: u64) -> Option<&Trial> {
        let (study, number) = *self.trials.get(usize::try_from(id).ok()?)?;
        self.studies[study].trials.get(number)
    }

    /// Applies one operation.
    pub fn apply(&mut self, operation: Operation, worker: &str) -> Applied {
        let accepted = match operation {
            Operation::CreateStudy { name, directions } => {
                let free = self.find(&name).is_none();
                if free {
                    self.studies.push(StudyRecord { name, directions, ..StudyRecord::default() });
                }
                free
            }
            Operation::DeleteStudy { study } => self.study(study).map(|s| s.deleted = true).is_some(),
            Operation::StudyAttribute { study, kind, key, value } => {
                let study = self.study(study);
                study.map(|s| s.set(kind, key, value)).is_some()
            }
            Operation::CreateTrial { study, started, template } => {
                let id = self.trials.len() as u64;
                let Some(record) = self.study(study) else { return Applied::Ignored };
                let (index, worker) = (record.trials.len(), worker.to_owned());
                let template = template.map_or_else(Trial::default, |template| *template);
                record.trials.push(Trial { number: index as u32, id, started, worker, ..template });
                self.trials.push((study, index));
                return Applied::Created(id);
            }
            Operation::SetParameter { trial, name, value, distribution } => {
                let fits = self.parameter_fits(trial, &name, &distribution);
                self.unfinished(trial).filter(|_| fits).map(|t| t.set(&name, value, distribution)).is_some()
            }
            Operation::SetState { trial, state, values, at } => match self.unfinished(trial) {
                // If several workers claim a waiting trial, the first line takes effect.
                Some(t) if !(state == TrialState::Running && t.state == TrialState::Running) => {
                    t.state = state;
                    if let Some(values) = values {
                        t.value = values.first().copied();
                    }
                    if state == TrialState::Running {
                        (t.started, t.worker) = (at, worker.to_owned());
                    } else if state.is_finished() {
                        t.completed = at;
                    }
                    true
                }
                _ => false,
            },
            Operation::SetIntermediate { trial, step, value } => {
                self.unfinished(trial).map(|t| t.intermediate.insert(step, value)).is_some()
            }
            Operation::TrialAttribute { trial, kind, key, value } => {
                let trial = self.unfinished(trial);
                trial.map(|t| kind.of(&mut t.user_attributes, &mut t.system_attributes).insert(key, value)).is_some()
            }
            Operation::Nothing => false,
        };
        if accepted { Applied::Accepted } else { Applied::Ignored }
    }

    fn study(&mut self, id: usize) -> Option<&mut StudyRecord> {
        self.studies.get_mut(id).filter(|s| !s.deleted)
    }

    /// The trial with an id, unless finished.
    fn unfinished(&mut self, id: u64) -> Option<&mut Trial> {
        let (study, number) = *self.trials.get(usize::try_from(id).ok()?)?;
        self.study(study)?.trials.get_mut(number).filter(|t| !t.state.is_finished())
    }

    /// Whether the distribution is of the same kind as in the first trial with this parameter. Bounds may differ.
    fn parameter_fits(&self, trial: u64, name: &str, distribution: &Distribution) -> bool {
        let Some((study, _)) = usize::try_from(trial).ok().and_then(|id| self.trials.get(id)) else { return false };
        let earlier = self.studies[*study].trials.iter().find_map(|t| t.distribution(name));
        match (earlier, distribution) {
            (None, _) => true,
            (Some(Distribution::Float(a)), Distribution::Float(b)) => a.log == b.log,
            (Some(Distribution::Foreign { kind: a, .. }), Distribution::Foreign { kind: b, .. }) => a == b,
            (Some(Distribution::Float(_)), Distribution::Foreign { kind, .. })
            | (Some(Distribution::Foreign { kind, .. }), Distribution::Float(_)) => kind == "FloatDistribution",
        }
    }
}
