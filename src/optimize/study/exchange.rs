//! Order of the queue: two enqueued trials exchange their points, whole even if the program is killed meanwhile.
//!
//! The journal takes a line at a time. The first line of an exchange is an attribute of the study with both points; an
//! exchange that was cut off is completed by the next session that opens the study.

use serde_json::{Map, Value, json};

use super::{Study, StudyError};
use crate::optimize::journal::{AttributeKind, JournalState, Operation};
use crate::optimize::trial::{FIXED_PARAMS, Trial, TrialState};

/// System attribute of the study: the new points of two trials by their ids; null when they have them.
const EXCHANGE: &str = "queue_exchange";

impl Study {
    /// Exchanges the points of two enqueued trials with their user attributes. Returns whether both were still waiting;
    /// otherwise nothing is changed. An attribute that one of them lacks becomes null: the journal removes none.
    pub fn exchange_waiting(&mut self, one: u32, other: u32) -> Result<bool, StudyError> {
        let (one, other) = (self.trial(one)?.id, self.trial(other)?.id);
        let study = self.id;
        let applied = self.commit(|journal| {
            let waiting = |id| journal.trial(id).filter(|trial| trial.state == TrialState::Waiting);
            let (Some(first), Some(second)) = (waiting(one), waiting(other)) else {
                return Ok(Vec::new());
            };
            let points =
                json!({ one.to_string(): point_of(second, first), other.to_string(): point_of(first, second) });
            let announced = Operation::study_attribute(study, AttributeKind::System, EXCHANGE, points.clone());
            Ok([vec![announced], completion(journal, study, &points)].concat())
        })?;
        Ok(!applied.is_empty())
    }

    /// Completes an exchange that was cut off.
    pub(super) fn complete_exchange(&mut self) -> Result<(), StudyError> {
        let study = self.id;
        let pending = |journal: &JournalState| {
            let attributes = &journal.studies().get(study)?.system_attributes;
            attributes.get(EXCHANGE).filter(|points| points.is_object()).cloned()
        };
        if pending(self.journal.state()).is_some() {
            self.commit(|journal| {
                let points = pending(journal);
                Ok(points.map_or_else(Vec::new, |points| completion(journal, study, &points)))
            })?;
        }
        Ok(())
    }
}

/// Returns the point of `of` for a trial that has the attributes of `old`.
fn point_of(of: &Trial, old: &Trial) -> Value {
    let mut attributes: Map<String, Value> = old.user_attributes.keys().map(|key| (key.clone(), Value::Null)).collect();
    attributes.extend(of.user_attributes.iter().map(|(key, value)| (key.clone(), value.clone())));
    let point = of.system_attributes.get(FIXED_PARAMS).cloned().unwrap_or_else(|| json!({}));
    json!({ FIXED_PARAMS: point, "attributes": attributes })
}

/// Returns what is left of an exchange: the points of trials that still wait, unless one of the two has begun with its old
/// point, and the end of the announcement.
fn completion(journal: &JournalState, study: usize, points: &Value) -> Vec<Operation> {
    let trials: Vec<(&Trial, &Value)> = points
        .as_object()
        .into_iter()
        .flatten()
        .filter_map(|(id, point)| Some((journal.trial(id.parse().ok()?)?, point)))
        .collect();
    let waits = |trial: &Trial| trial.state == TrialState::Waiting;
    let has = |trial: &Trial, point: &Value| trial.system_attributes.get(FIXED_PARAMS) == point.get(FIXED_PARAMS);
    let mut operations = Vec::new();
    if trials.iter().all(|(trial, point)| waits(trial) || has(trial, point)) {
        for (trial, point) in trials.into_iter().filter(|(trial, _)| waits(trial)) {
            let given = point.get(FIXED_PARAMS).cloned().unwrap_or_else(|| json!({}));
            operations.push(Operation::trial_attribute(trial.id, AttributeKind::System, FIXED_PARAMS, given));
            let attributes = point.get("attributes").and_then(Value::as_object).into_iter().flatten();
            let changed = attributes.filter(|(key, value)| trial.user_attributes.get(*key) != Some(*value));
            operations.extend(
                changed
                    .map(|(key, value)| Operation::trial_attribute(trial.id, AttributeKind::User, key, value.clone())),
            );
        }
    }
    operations.push(Operation::study_attribute(study, AttributeKind::System, EXCHANGE, Value::Null));
    operations
}
