//! The operator's changes of the open proposal, kept in the study until its trial begins: an undone verdict, a changed search
//! and the end of the program do not lose them.

use serde::Deserialize;

use super::changes::{CHANGED_PREFIX, Changes, KeptChanges};
use super::open_proposal::OpenProposal;
use super::plan::{RequestRefusal, not_now};
use super::{Experiment, ExperimentState};
use crate::optimize::study::StudyError;
use crate::optimize::trial::TrialState;

impl Experiment {
    /// Returns the number of the trial whose proposal the operator has changed and which has not begun; none without a change.
    pub fn changed_proposal(&self) -> Option<u32> {
        let begun = |trial: u32| self.study.trial(trial).is_ok_and(|trial| trial.state != TrialState::Waiting);
        self.kept_changes().map(|kept| kept.trial).filter(|trial| !begun(*trial))
    }

    pub(super) fn open_proposal(&self) -> Result<&OpenProposal, RequestRefusal> {
        match &self.state {
            ExperimentState::Proposed(open) => Ok(open),
            _ => not_now("there is no proposal to change"),
        }
    }

    /// Gives the open proposal these changes in place of those that it has. They are on disk before this returns.
    pub(super) fn change_open(&mut self, changes: Changes) -> Result<(), RequestRefusal> {
        let open = self.open_proposal()?;
        let (trial, queued) = (open.number(), open.is_queued());
        self.keep((changes != Changes::default()).then(|| KeptChanges { trial, queued, changes: changes.clone() }))?;
        let revision = self.next_revision();
        if let ExperimentState::Proposed(open) = &mut self.state {
            open.set_changes(changes, revision);
        }
        self.publish_proposal();
        Ok(())
    }

    /// Makes the kept changes in a new draft of the same trial, as far as its bounds allow. Those of another trial, which has
    /// begun or has lost its place, are forgotten.
    pub(super) fn restore_changes(&mut self, open: &mut OpenProposal) -> Result<(), StudyError> {
        let Some(kept) = self.kept_changes() else { return Ok(()) };
        if (kept.trial, kept.queued) != (open.number(), open.is_queued()) {
            return self.forget_changes();
        }
        let (parameters, gains) = (self.search.parameters(&self.plan), &self.plan.gains);
        let allowed = |name: &str, value| parameters.iter().chain(gains).any(|p| p.name == name && p.contains(value));
        open.inherit(&kept.changes, allowed);
        Ok(())
    }

    /// Keeps the changes of the open proposal for the number that its trial has now.
    pub(super) fn rename_kept_changes(&mut self, trial: u32) -> Result<(), StudyError> {
        self.keep(self.kept_changes().map(|kept| KeptChanges { trial, ..kept }))
    }

    pub(super) fn forget_changes(&mut self) -> Result<(), StudyError> {
        self.keep(None)
    }

    fn kept_changes(&self) -> Option<KeptChanges> {
        KeptChanges::deserialize(self.study.attributes().get(&self.changes_attribute())?).ok()
    }

    fn keep(&mut self, kept: Option<KeptChanges>) -> Result<(), StudyError> {
        if self.kept_changes() == kept {
            return Ok(());
        }
        let kept = serde_json::to_value(kept).expect("changes are structs with text keys");
        self.study.annotate_study(&[(self.changes_attribute(), kept)])
    }

    fn changes_attribute(&self) -> String {
        format!("{CHANGED_PREFIX}{}", self.plan.worker)
    }
}
