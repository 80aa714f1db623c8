//! A study without a person: every proposal is approved, and every suggested verdict is the verdict.
//!
//! On a shared study this is one worker of several, with one budget for all. A trial begins only while the trials that count
//! or run are fewer than the budget, checked under the journal's lock, so the budget is met exactly. A worker without room
//! waits until the trials of the others have ended, because one of them may be void.

use std::time::Duration;

use super::experiment::{Experiment, RequestRefusal};
use super::rollout::Rollout;
use crate::control::limit_key::{LimitKey, limit_key};
use crate::optimize::journal::LongWait;
use crate::recording::record::{Record, Transition};
use crate::robot::Robot;
use crate::telemetry::Tick;
use crate::trial::{ExperimentStage, TrialRecord, Verdict};

/// Void trials in a row after which the run ends: their cause does not depend on the parameters.
const VOIDS_IN_A_ROW: u32 = 10;
/// Trials in a row that end by the same limit after which the run warns.
const SAME_LIMIT_IN_A_ROW: u32 = 10;
/// Time between two reads of the study by a worker that waits.
const WAIT_PERIOD: Duration = Duration::from_millis(50);

/// A judged trial.
pub struct JudgedTrial<'a> {
    /// The experiment, which includes the trials of other workers.
    pub experiment: &'a Experiment,
    /// Its row.
    pub row: &'a TrialRecord,
    /// Ticks of its last rollout, countdown included. They may be exchanged for a vector that the next rollout fills.
    pub ticks: &'a mut Vec<Tick>,
    /// Changes of mode during these ticks, with their times on the ticks' clock, ns.
    pub transitions: &'a [(u64, Transition)],
    /// Records up to the begin of the rollout.
    pub before: &'a [Record],
    /// Records from the end of the rollout on, with the next proposal.
    pub after: &'a [Record],
    /// Reason of its end, with the key of the limit that ended it.
    pub cause: &'a str,
    /// Warning: the same limit has ended many trials in a row.
    pub warning: Option<&'a str>,
}

/// Trials in a row that ended by the same limit.
#[derive(Debug, Default)]
struct SameLimit {
    key: Option<LimitKey>,
    count: u32,
}

impl SameLimit {
    /// Counts a trial; returns the number of trials in a row when it is time to warn again.
    fn count(&mut self, key: Option<LimitKey>) -> Option<u32> {
        self.count = if key.is_some() && key == self.key { self.count + 1 } else { u32::from(key.is_some()) };
        self.key = key;
        (self.count > 0 && self.count.is_multiple_of(SAME_LIMIT_IN_A_ROW)).then_some(self.count)
    }

    /// Names the limit behind `cause`.
    fn explain(&self, cause: &str) -> String {
        match self.key {
            Some(key) => format!("{cause}; the limit is {key}"),
            None => cause.to_owned(),
        }
    }
}

/// Runs trials until the study has its budget; `each` receives every judged trial with its ticks.
///
/// # Errors
/// When the study cannot be read or written, or too many trials in a row are void: the error names the limit of the last one.
pub fn run<R: Robot>(
    experiment: &mut Experiment,
    rollout: &mut Rollout<R>,
    mut each: impl FnMut(&TrialRecord, &[Tick]),
) -> Result<(), RequestRefusal> {
    run_watched(experiment, rollout, |trial| each(trial.row, trial.ticks), || false)
}

/// [`run`] in which `each` also receives the experiment and a warning, and which ends after the present trial once `is_stopped`.
///
/// # Errors
/// As of [`run`].
pub fn run_watched<R: Robot>(
    experiment: &mut Experiment,
    rollout: &mut Rollout<R>,
    mut each: impl FnMut(JudgedTrial),
    is_stopped: impl Fn() -> bool,
) -> Result<(), RequestRefusal> {
    let mut voids = 0;
    let mut same = SameLimit::default();
    let mut waited: Option<LongWait> = None;
    // Whether a trial is to have a further rollout.
    let mut within_trial = false;
    // A session before this one has left it without a verdict.
    if let Some(trial) = experiment.under_review().map(|row| row.trial) {
        let Some(suggested) = experiment.verdict_without_person() else {
            let reason = format!("trial {trial} waits for the verdict of a person: continue its study in the console");
            return Err(RequestRefusal::NotNow(reason));
        };
        experiment.judge_by_rule(suggested)?;
    }
    loop {
        if is_stopped() && !within_trial {
            return Ok(experiment.close()?);
        }
        let Some(proposal) = experiment.proposal().filter(|_| experiment.stage() == ExperimentStage::Proposed) else {
            // The pending verdict must be reported before this worker waits: the others wait for it.
            experiment.close()?;
            if experiment.others_run() {
                waited.get_or_insert_with(LongWait::begin).announce(|| {
                    "waiting for the trials of other workers, which may end void; a worker that is silent for \
                     [workers] abandoned_s counts as ended; Ctrl-C ends the wait"
                        .to_owned()
                });
                std::thread::sleep(WAIT_PERIOD);
                experiment.refresh()?;
                continue;
            }
            // An abandoned trial of another worker may be queued again only now.
            experiment.refresh()?;
            if experiment.proposal().is_none() {
                return Ok(());
            }
            continue;
        };
        waited = None;
        if experiment.refusal().is_some() {
            // Another program has queued a point outside the limits: it is void with this cause.
            match experiment.skip(proposal.trial, proposal.revision) {
                Err(RequestRefusal::Overtaken(_)) => {}
                skipped => skipped?,
            }
            continue;
        }
        let spec = match experiment.approve(proposal.trial, proposal.revision) {
            Err(RequestRefusal::Overtaken(_)) => continue,
            approved => approved?,
        };
        let before = experiment.take_records();
        let settings = *rollout.settings();
        let (end, ticks) = rollout.run(&spec);
        experiment.ended(spec.trial, &end, ticks, ticks.len() as u64);
        let suggested = experiment.row(spec.trial).and_then(|row| row.suggested).unwrap_or(Verdict::Void);
        within_trial = false;
        match experiment.judge_by_rule(suggested) {
            Err(RequestRefusal::EndedElsewhere(_)) => continue,
            judged => judged?,
        }
        let after = experiment.take_records();
        voids = if suggested == Verdict::Void { voids + 1 } else { 0 };
        let repeated = same.count(limit_key(&end, &settings));
        if let Some(row) = experiment.row(spec.trial) {
            within_trial = row.verdict.is_none();
            let cause = same.explain(&row.cause);
            let warning = repeated.filter(|_| suggested != Verdict::Void).map(|count| {
                format!("{count} trials in a row ended by the same limit, the last because: {cause}. Change the limit, or the bounds in optimize.toml")
            });
            let (ticks, transitions) = rollout.recorded();
            // Between the rollouts of a trial its row has no verdict.
            each(JudgedTrial {
                experiment,
                row,
                ticks,
                transitions,
                before: &before,
                after: &after,
                cause: &cause,
                warning: warning.as_deref(),
            });
            if voids >= VOIDS_IN_A_ROW {
                experiment.close()?;
                return Err(RequestRefusal::NotNow(format!(
                    "{voids} trials in a row were void, the last because: {cause}"
                )));
            }
        }
    }
}
