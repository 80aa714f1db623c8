//! A study without a person: every proposal is approved, every suggested verdict is the verdict.
//!
//! On a shared study this is one worker of several. The budget is that of all together: a trial begins only while those
//! that count and those that run are fewer, seen under the journal's lock, so it is met to the trial; a worker that finds
//! no room waits until the others' trials have ended, for one of them may come to nothing.

use std::time::Duration;

use super::experiment::{Experiment, RequestRefusal};
use super::rollout::Rollout;
use crate::robot::Robot;
use crate::telemetry::Tick;
use crate::trial::{ExperimentStage, TrialRecord, Verdict};

/// After this many void trials in a row nothing will come of the study: something is wrong that no parameter mends.
const VOIDS_IN_A_ROW: u32 = 10;
/// How often a worker without work looks whether there is some.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Runs trials until the study has its budget; `each` is given every judged trial with its ticks.
///
/// # Errors
/// When the study cannot be read or written, or one trial after the other is void.
pub fn run<R: Robot>(
    life: &mut Experiment,
    rollout: &mut Rollout<R>,
    mut each: impl FnMut(&TrialRecord, &[Tick]),
) -> Result<(), RequestRefusal> {
    run_watched(life, rollout, |_, row, ticks| each(row, ticks))
}

/// [`run`] in which `each` is also given the study as it stands then, other workers' trials among it.
///
/// # Errors
/// As [`run`].
pub fn run_watched<R: Robot>(
    life: &mut Experiment,
    rollout: &mut Rollout<R>,
    mut each: impl FnMut(&Experiment, &TrialRecord, &[Tick]),
) -> Result<(), RequestRefusal> {
    let mut voids = 0;
    loop {
        // Nobody looks at them.
        life.take_records();
        let Some(card) = life.proposal().filter(|_| life.stage() == ExperimentStage::Proposed) else {
            // What is judged must be told before it is waited for others, or they wait for us.
            life.close()?;
            if life.others_run() {
                std::thread::sleep(LOOK_PERIOD);
                life.refresh()?;
                continue;
            }
            // What was waited for may have been given up only now: then it comes again, and somebody must run it.
            life.refresh()?;
            if life.proposal().is_none() {
                return Ok(());
            }
            continue;
        };
        if life.objection().is_some() {
            // Another program has queued what no robot may run: it is void, and its cause says why.
            life.skip()?;
            continue;
        }
        let spec = match life.approve(card.trial, card.revision) {
            Err(RequestRefusal::Overtaken(_)) => continue,
            approved => approved?,
        };
        let (end, ticks) = rollout.run(&spec);
        life.ended(spec.trial, &end, ticks, ticks.len() as u64);
        let suggested = life.row(spec.trial).and_then(|row| row.suggested).unwrap_or(Verdict::Void);
        match life.judge(suggested, false) {
            Err(RequestRefusal::EndedElsewhere(_)) => continue,
            judged => judged?,
        }
        voids = if suggested == Verdict::Void { voids + 1 } else { 0 };
        if let Some(row) = life.row(spec.trial) {
            each(life, row, ticks);
            if voids >= VOIDS_IN_A_ROW {
                let cause = row.cause.clone();
                life.close()?;
                return Err(RequestRefusal::NotNow(format!(
                    "{voids} trials in a row were void, the last because: {cause}"
                )));
            }
        }
    }
}
