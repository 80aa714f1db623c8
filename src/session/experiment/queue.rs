//! Trials that wait or must be run again: re-runs, and trials that a program left unfinished.
//!
//! The session that has the study's folder (worker 0) closes at its start the trials that worker 0 began, because it is
//! the only one. A trial of a joined worker is closed by any session that has seen it run for longer than any simulated
//! trial takes (`[workers] abandoned_s`). Trials of other programs are left to those programs. A closed trial with a
//! verdict counts; one without is void, and its parameters are queued again. Not closed is the trial that was measured and
//! waited for its verdict: the session that continues the study judges it.

use std::time::Duration;

use super::attributes::{self, Attributes, InterruptedAttributes, Origin, TrialAttributes};
use super::liveness::Liveness;
use crate::optimize::study::{Outcome, Study, StudyError, TellOutcome};
use crate::optimize::trial::{Trial, TrialState};
use crate::trial::{JudgedBy, NOT_RUN, ParameterValues, Verdict};

#[derive(Debug)]
pub struct TrialQueue {
    worker: u32,
    liveness: Liveness,
}

impl TrialQueue {
    /// The queue of worker number `worker`; see [`Liveness`] for `abandoned`.
    pub fn new(worker: u32, abandoned: Duration) -> TrialQueue {
        TrialQueue { worker, liveness: Liveness::new(abandoned) }
    }

    /// The newest trial that an earlier session of the folder has measured and left without a verdict.
    pub fn unjudged(&self, study: &Study) -> Option<u32> {
        let unjudged = |trial: &&Trial| TrialAttributes::of(trial).is_unjudged();
        self.left(study).filter(unjudged).last().map(|trial| trial.number)
    }

    /// Closes the trials that an earlier session of the folder left running, except `kept`. Returns lines for the log.
    pub fn close_interrupted(&self, study: &mut Study, kept: Option<u32>) -> Result<Vec<String>, StudyError> {
        let running: Vec<Trial> = self.left(study).filter(|trial| Some(trial.number) != kept).cloned().collect();
        let log = close_all(study, &running, "interrupted: the program ended before the verdict")?;
        queue_owed(study)?;
        Ok(log)
    }

    /// Closes the trials that joined workers have abandoned. Returns lines for the log.
    pub fn close_abandoned(&mut self, study: &mut Study) -> Result<Vec<String>, StudyError> {
        self.liveness.update(study.trials());
        let joined = |trial: &&Trial| attributes::worker_of(trial).is_some_and(|worker| worker > 0);
        let abandoned = |trial: &&Trial| joined(trial) && !self.is_own(study, trial) && !self.liveness.is_alive(trial);
        let abandoned: Vec<Trial> = study.running().filter(abandoned).cloned().collect();
        if abandoned.is_empty() {
            return Ok(Vec::new());
        }
        let log = close_all(study, &abandoned, "interrupted: its worker has not ended it in time")?;
        queue_owed(study)?;
        Ok(log)
    }

    /// Closes one trial as void for `cause` and queues its parameters again. Returns lines for the log.
    pub fn close(&self, study: &mut Study, trial: u32, cause: &str) -> Result<Vec<String>, StudyError> {
        let Some(trial) = study.running().find(|running| running.number == trial).cloned() else {
            return Ok(Vec::new());
        };
        let log = close_all(study, &[trial], cause)?;
        queue_owed(study)?;
        Ok(log)
    }

    /// The trials that an earlier session of the folder left running.
    fn left<'a>(&'a self, study: &'a Study) -> impl Iterator<Item = &'a Trial> {
        study.running().filter(|trial| self.worker == 0 && attributes::worker_of(trial) == Some(0))
    }

    pub fn others_run(&self, study: &Study) -> bool {
        study.running().any(|trial| !self.is_own(study, trial) && self.liveness.is_alive(trial))
    }

    /// Returns the number of trials that take a place of the budget: those that count, and those that run and may count.
    pub fn occupied(&self, trials: &[Trial]) -> u32 {
        let takes = |trial: &&Trial| match trial.state {
            TrialState::Complete => true,
            // A person may take any time to judge; the session that has the folder closes its own trials.
            TrialState::Running => attributes::worker_of(trial) == Some(0) || self.liveness.is_alive(trial),
            _ => false,
        };
        trials.iter().filter(takes).filter(|trial| !attributes::confirms(trial)).count() as u32
    }

    /// Returns whether this session runs the trial, or has judged it and not reported it yet.
    fn is_own(&self, study: &Study, trial: &Trial) -> bool {
        attributes::worker_of(trial) == Some(self.worker) && trial.worker == study.worker()
    }
}

fn close_all(study: &mut Study, trials: &[Trial], cause: &str) -> Result<Vec<String>, StudyError> {
    let mut log = Vec::new();
    for trial in trials {
        let left = TrialAttributes::of(trial);
        // A measured trial keeps its own reason, for example STOP, before that of the closing.
        let other = |before: &&str| left.suggested.is_some() && !before.is_empty() && *before != cause;
        let cause = match left.cause.as_deref().filter(other) {
            Some(before) => &format!("{before}; {cause}"),
            None => cause,
        };
        let (outcome, last, result) = match left.outcome() {
            Some(outcome) => (outcome, Attributes::new(), "judged before the interruption: it counts"),
            // Queued again by the caller, or by the next session if this program is killed before.
            None => {
                let last = attributes::write(&InterruptedAttributes {
                    verdict: Verdict::Void,
                    judged_by: (!cause.starts_with(NOT_RUN)).then_some(JudgedBy::Rule),
                    cause,
                    rerun: true,
                    interrupted: true,
                });
                (Outcome::Fail, last, "interrupted: it is void and queued again")
            }
        };
        // A trial that was judged since it was read is not abandoned.
        let unchanged = |now: &Trial| now.user_attributes == trial.user_attributes;
        if study.tell_if(trial.number, outcome, &last, &unchanged)? == TellOutcome::Recorded {
            log.push(format!("trial {} was {result}", trial.number));
        }
    }
    Ok(log)
}

/// Queues the void trials whose parameters are to be run again and were not queued yet.
fn queue_owed(study: &mut Study) -> Result<(), StudyError> {
    let is_owed = |trial: &&Trial| trial.state == TrialState::Fail && TrialAttributes::of(trial).rerun == Some(true);
    let owed: Vec<Trial> = study.trials().iter().filter(is_owed).cloned().collect();
    for trial in owed {
        let interrupted = TrialAttributes::of(&trial).interrupted == Some(true);
        let origin = if interrupted { Origin::interrupted(&trial) } else { rerun_of(&trial).1 };
        queue_again(study, trial.number, &trial.parameters, &origin)?;
    }
    Ok(())
}

pub fn rerun_of(trial: &Trial) -> (ParameterValues, Origin) {
    let Origin { source, gains, .. } = Origin::of_trial(trial);
    (trial.parameters.clone().into(), Origin::rerun_of(trial.number, source, gains))
}

/// Moves a queued trial before those that were queued from number `first_after` on; their points move back by one. Returns the new
/// number of its point.
pub fn move_ahead(study: &mut Study, queued: u32, first_after: u32) -> Result<u32, StudyError> {
    let passed = study.waiting().map(|trial| trial.number).filter(|number| (first_after..queued).contains(number));
    let passed: Vec<u32> = passed.collect();
    let mut number = queued;
    for earlier in passed.into_iter().rev() {
        // One that has just begun elsewhere stays before it.
        if !study.exchange_waiting(number, earlier)? {
            break;
        }
        number = earlier;
    }
    Ok(number)
}

/// Queues the repetition of trial `parent` once; another program may have queued it before. Returns its number.
pub fn queue_again(
    study: &mut Study,
    parent: u32,
    parameters: &[(String, f64)],
    origin: &Origin,
) -> Result<Option<u32>, StudyError> {
    let repeats = |other: &Trial| Origin::of_trial(other).parent == Some(parent);
    let queued = study.enqueue_unless(parameters, &origin.attributes(), &|trials| trials.iter().any(repeats))?;
    Ok(queued.or_else(|| study.trials().iter().find(|trial| repeats(trial)).map(|trial| trial.number)))
}
