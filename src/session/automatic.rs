//! A study without a person: every proposal is approved, every suggested verdict is the verdict.

use super::life::{Life, Refusal};
use super::rollout::Rollout;
use crate::realtime::telemetry::Tick;
use crate::recording::record::{Stage, TrialRecord, Verdict};
use crate::robot::Robot;

/// Runs trials until the study has its budget; `each` is given every judged trial with its ticks.
///
/// # Errors
/// When the study cannot be read or written.
pub fn run<R: Robot>(
    life: &mut Life,
    rollout: &mut Rollout<R>,
    mut each: impl FnMut(&TrialRecord, &[Tick]),
) -> Result<(), Refusal> {
    while life.stage() == Stage::Proposed {
        let Some(card) = life.proposal() else { break };
        let spec = life.approve(card.trial, card.revision)?;
        let (end, ticks) = rollout.run(&spec);
        life.ended(spec.trial, &end, ticks);
        let suggested = life.row(spec.trial).and_then(|row| row.suggested).unwrap_or(Verdict::Void);
        life.judge(suggested, false)?;
        if let Some(row) = life.row(spec.trial) {
            each(row, ticks);
        }
    }
    Ok(life.close()?)
}
