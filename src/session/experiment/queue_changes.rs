//! Changes of the queue by the operator: the order of queued points, and their removal.

use super::Experiment;
use super::attributes::{self, Origin, RemovedAttributes};
use super::confirmation;
use super::plan::{RequestRefusal, not_now};
use crate::optimize::study::{Outcome, Study, StudyError, TellOutcome};
use crate::optimize::trial::{Trial, TrialState};
use crate::trial::{ParameterValues, QueuedPoint, REMOVED, Verdict};

/// A queued point and its place in the queue, 1 for the next one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct QueuePlace {
    /// The point.
    pub point: QueuedPoint,
    /// Its place.
    pub place: u32,
    /// Number of queued points.
    pub of: u32,
}

impl Experiment {
    /// Removes a queued point: its trial becomes void, which the sampler does not see, and it never runs.
    /// Refused during a trial, for a trial that is not queued, and for a repeat of a running confirmation of the best.
    pub fn remove_queued(&mut self, trial: u32) -> Result<(), RequestRefusal> {
        must_be_queued(&self.queue_with_rerun()?, trial)?;
        self.queue_rerun()?;
        let proposed = self.is_next(trial);
        let removed = self.end_queued(trial)?;
        // Also after a refusal: the re-run of the last verdict is in the study now.
        self.propose_after_change(removed && proposed)?;
        if removed { Ok(()) } else { not_now(format!("trial {trial} has just begun elsewhere")) }
    }

    /// Removes the queued repeats that confirm the best. One that has just begun elsewhere runs.
    pub(super) fn remove_repeats(&mut self) -> Result<(), StudyError> {
        let repeats: Vec<u32> =
            self.study.waiting().filter(|trial| attributes::confirms(trial)).map(|trial| trial.number).collect();
        for trial in repeats {
            self.end_queued(trial)?;
        }
        Ok(())
    }

    /// Ends a queued trial as removed. Returns whether it was still queued.
    fn end_queued(&mut self, trial: u32) -> Result<bool, StudyError> {
        // Another program may have queued it, without an origin.
        let mut removed = Origin::of_trial(self.study.trial(trial)?).attributes();
        removed.extend(attributes::write(&RemovedAttributes { verdict: Verdict::Void, cause: REMOVED }));
        let waits = |trial: &Trial| trial.state == TrialState::Waiting;
        Ok(self.study.tell_if(trial, Outcome::Fail, &removed, &waits)? == TellOutcome::Recorded)
    }

    /// Exchanges a queued point with the one before it, or after it. Trials run in the order of their numbers: the points
    /// change places, the numbers stay. Returns the new place of the point.
    /// Refused during a trial, for a trial that is not queued, at the ends of the queue, and for a repeat of a running
    /// confirmation of the best.
    pub fn move_queued(&mut self, trial: u32, earlier: bool) -> Result<QueuePlace, RequestRefusal> {
        let study = self.queue_with_rerun()?;
        must_be_queued(&study, trial)?;
        let waiting: Vec<u32> = study.waiting().map(|trial| trial.number).collect();
        let place = waiting.iter().position(|number| *number == trial);
        let other = place.and_then(|place| if earlier { place.checked_sub(1) } else { Some(place + 1) });
        let Some(&other) = other.and_then(|other| waiting.get(other)) else {
            return not_now(format!("trial {trial} is the {} of the queue", if earlier { "first" } else { "last" }));
        };
        must_be_queued(&study, other)?;
        self.queue_rerun()?;
        let proposed = self.is_next(trial) || self.is_next(other);
        let moved = self.study.exchange_waiting(trial, other)?;
        self.propose_after_change(moved && proposed)?;
        if !moved {
            return not_now(format!("trial {trial} or {other} has just begun elsewhere"));
        }
        let queue = queued_points(&self.study);
        let place = queue.iter().position(|point| point.trial == other).unwrap_or(0);
        let point = queue.get(place).cloned().unwrap_or_default();
        Ok(QueuePlace { point, place: place as u32 + 1, of: queue.len() as u32 })
    }

    /// Whether `trial` is the next one of the queue: the open proposal.
    fn is_next(&self, trial: u32) -> bool {
        self.study.waiting().next().is_some_and(|next| next.number == trial)
    }

    /// Makes a new proposal. The operator's changes of the open one stay, unless another point is `proposed` now.
    fn propose_after_change(&mut self, proposed: bool) -> Result<(), RequestRefusal> {
        if proposed {
            self.forget_changes()?;
        }
        Ok(self.propose()?)
    }

    /// Returns the number of the waiting trial that runs next; none if the study has none yet, as for a re-run whose verdict can still
    /// be taken back.
    pub(super) fn next_in_study(&self) -> Option<u32> {
        let next = self.study.waiting().next().map(|trial| trial.number);
        next.filter(|_| next != self.first_after_rerun())
    }

    /// Returns the number of the first waiting trial that was queued after the re-run of the last verdict; none without one.
    pub(super) fn first_after_rerun(&self) -> Option<u32> {
        let first_after = self.pending_verdict.as_ref()?.rerun?;
        self.study.waiting().map(|trial| trial.number).find(|number| *number >= first_after)
    }

    /// Queues the re-run of the last verdict, which is final then: what changes the queue must see it in its place. Called when no
    /// refusal of the request is left; a new proposal must follow.
    pub(super) fn queue_rerun(&mut self) -> Result<(), RequestRefusal> {
        if self.pending_verdict.as_ref().is_some_and(|pending| pending.rerun.is_some()) {
            self.report_verdict()?;
        }
        Ok(())
    }

    /// Returns a copy of the study in whose queue the re-run of the last verdict has its place. The verdict can still be undone.
    /// Refused during a trial.
    fn queue_with_rerun(&mut self) -> Result<Study, RequestRefusal> {
        self.must_be_idle()?;
        self.study.refresh()?;
        Ok(self.study_with_verdict()?)
    }
}

/// Refuses a trial that does not wait in `study`, and a repeat of a running confirmation of the best.
fn must_be_queued(study: &Study, trial: u32) -> Result<(), RequestRefusal> {
    let Some(queued) = study.waiting().find(|waiting| waiting.number == trial) else {
        return not_now(format!("trial {trial} is not in the queue"));
    };
    if attributes::confirms(queued) && confirmation::running(study).is_some() {
        return not_now(format!("trial {trial} confirms the best; end the repeats instead"));
    }
    Ok(())
}

/// Returns the queue of `study`, the next point first.
pub fn queued_points(study: &Study) -> Vec<QueuedPoint> {
    let point = |trial: &Trial| {
        let Origin { source, parent, gains, .. } = Origin::of_trial(trial);
        // In table order: the journal has them by name.
        let given = ParameterValues::from(trial.fixed());
        let space = study.options().space.parameters();
        let parameters = space.iter().filter_map(|p| Some((p.name.clone(), given.get(&p.name)?))).collect();
        QueuedPoint { trial: trial.number, source, parent, parameters, gains }
    };
    study.waiting().map(point).collect()
}
