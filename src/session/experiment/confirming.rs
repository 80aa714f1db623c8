//! "Confirm the best": the best points are repeated until one leads, or the repeats are used up. The rule is that of
//! [`crate::optimize::repeats`]; the repeats are proposals like any other and lie beyond the budget.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{attributes, not_now};
use crate::optimize::repeats::{Confirmation, LEAST_REPEATS, Point, confirm, contenders, points, standing};
use crate::optimize::study::{Study, StudyError};
use crate::optimize::trial::{Trial, TrialState};
use crate::recording::record::Record;
use crate::session::experiment::{Experiment, RequestRefusal};
use crate::trial::{PointRecord, ProposalSource};

/// Study attribute: what is being confirmed; null when it is over.
const CONFIRM: &str = "confirm";
/// Study attribute: what came of it.
const CONFIRMED: &str = "confirmed";

/// A confirmation that goes on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Confirming {
    /// The first trials of the points that are compared.
    trials: Vec<u32>,
    /// How many repeats there may be.
    repeats: u32,
    /// Number of the first trial that may be one of them.
    from: u32,
}

/// What came of a confirmation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Confirmed {
    /// The first trials of the points that were compared.
    trials: Vec<u32>,
    /// First trial of the point that leads.
    leader: u32,
    /// Confidence in it.
    confidence: f64,
    /// Whether that is enough.
    sure: bool,
}

/// What is to be done next.
pub(super) enum Next {
    /// Nothing is being confirmed.
    Nothing,
    /// Repeat the point of this first trial.
    Repeat(Box<Trial>),
    /// It is over.
    Over(Confirmed, String),
}

impl Experiment {
    /// Repeats the best points up to `repeats` times in all; 0 ends a confirmation that goes on. The last verdict is told
    /// by this and cannot be undone any more.
    ///
    /// # Errors
    /// When a trial is under way, there are fewer than two points to compare, or the study cannot be written.
    pub fn confirm_best(&mut self, repeats: u32) -> Result<Vec<u32>, RequestRefusal> {
        self.must_be_idle()?;
        self.study.refresh()?;
        if repeats == 0 {
            if confirming_of(&self.study).is_none() {
                return not_now("nothing is being confirmed");
            }
            self.tell_pending()?;
            self.study.annotate_study(&[(CONFIRM.to_owned(), Value::Null)])?;
            self.propose()?;
            return Ok(Vec::new());
        }
        let direction = self.study.options().direction;
        // As it will be when the last verdict is told: a wish that is refused tells nothing.
        let best = contenders(self.outlook()?.trials(), direction, self.plan.contenders as usize);
        let best: Vec<Point> = best.into_iter().filter(|point| point.stood > 0).collect();
        if best.len() < 2 {
            return not_now("there are not two points yet that the robot stood through: nothing to compare");
        }
        let trials: Vec<u32> = best.iter().map(|point| point.trials[0]).collect();
        self.tell_pending()?;
        let from = self.study.trials().len() as u32;
        let confirming = Confirming { trials: trials.clone(), repeats, from };
        self.study.annotate_study(&[(CONFIRM.to_owned(), json!(confirming)), (CONFIRMED.to_owned(), Value::Null)])?;
        self.confirmed = None;
        self.propose()?;
        Ok(trials)
    }

    /// How a confirmation goes on in the study `outlook`.
    pub(super) fn next_repeat(&self, outlook: &Study) -> Next {
        let Some(confirming) = confirming_of(outlook) else { return Next::Nothing };
        let direction = outlook.options().direction;
        let compared = compared(&confirming, outlook);
        let Some(first) = compared.first() else { return Next::Nothing };
        let over = |leader: usize, confidence: f64, words: String| {
            let (trials, leader) = (confirming.trials.clone(), compared[leader].trials[0]);
            let sure = confidence >= self.plan.confidence;
            Next::Over(Confirmed { trials, leader, confidence, sure }, words)
        };
        if compared.len() < 2 {
            let words = format!("only the point of trial {} is left to compare: nothing to confirm", first.trials[0]);
            return over(0, 0.0, words);
        }
        match confirm(&compared, direction, self.plan.confidence) {
            Confirmation::Leads(leader, confidence) => {
                over(leader, confidence, format!("confirmed: {}", leads(&compared[leader], confidence)))
            }
            Confirmation::Repeat(point) if left(&confirming, outlook.trials()) > 0 => {
                let number = compared[point].trials[0];
                match outlook.trial(number) {
                    Ok(first) => Next::Repeat(Box::new(first.clone())),
                    Err(_) => Next::Nothing,
                }
            }
            // Others run the last ones: what they come to is waited for.
            Confirmation::Repeat(_) if used(&confirming, outlook.trials(), |state| !state.is_finished()) > 0 => {
                Next::Nothing
            }
            Confirmation::Repeat(_) => {
                let standing = standing(&compared, direction);
                let words = format!(
                    "the {} repeats are used up: {}, short of {:.0} %",
                    confirming.repeats,
                    leads(&compared[standing.leader], standing.confidence),
                    100.0 * self.plan.confidence
                );
                over(standing.leader, standing.confidence, words)
            }
        }
    }

    /// Queues a repeat, unless other workers have begun or queued the last ones meanwhile. Returns its number.
    pub(super) fn queue_repeat(
        &mut self,
        parameters: &[(String, f64)],
        attributes: &[(String, Value)],
    ) -> Result<Option<u32>, StudyError> {
        let Some(confirming) = confirming_of(&self.study) else { return Ok(None) };
        self.study.enqueue_unless(parameters, attributes, |trials| left(&confirming, trials) == 0)
    }

    /// How many repeats are still to be completed to confirm the best; none while nothing is being confirmed.
    pub(super) fn repeats_left(&self, outlook: &Study) -> Option<u32> {
        let confirming = confirming_of(outlook).filter(|_| self.confirmed.is_none())?;
        let completed = used(&confirming, outlook.trials(), |state| state == TrialState::Complete);
        Some(confirming.repeats.saturating_sub(completed))
    }

    /// Writes what came of a confirmation, once nothing can be undone in it any more.
    pub(super) fn write_confirmed(&mut self) -> Result<(), StudyError> {
        let Some(confirmed) = self.confirmed.clone().filter(|_| confirming_of(&self.study).is_some()) else {
            return Ok(());
        };
        self.study.annotate_study(&[(CONFIRMED.to_owned(), json!(confirmed)), (CONFIRM.to_owned(), Value::Null)])
    }

    /// Shows what repeated points amount to, if that has changed.
    pub(super) fn show_points(&mut self, outlook: &Study) {
        let confirming = confirming_of(outlook);
        let kept = outlook.attributes().get(CONFIRMED).and_then(|kept| serde_json::from_value(kept.clone()).ok());
        let confirmed: Option<Confirmed> = self.confirmed.clone().or(kept);
        let trials = match (&confirming, &confirmed) {
            (Some(confirming), _) => confirming.trials.clone(),
            (None, Some(confirmed)) => confirmed.trials.clone(),
            (None, None) => Vec::new(),
        };
        let ahead = match (&confirmed, &confirming) {
            (Some(confirmed), _) => Some((confirmed.leader, confirmed.confidence)),
            (None, Some(confirming)) => {
                let compared = compared(confirming, outlook);
                // Before everyone has been repeated the spread says nothing.
                let told = compared.len() > 1 && compared.iter().all(|point| point.repeats() >= LEAST_REPEATS);
                told.then(|| standing(&compared, outlook.options().direction))
                    .map(|standing| (compared[standing.leader].trials[0], standing.confidence))
            }
            (None, None) => None,
        };
        let record = |point: Point| {
            let contender = trials.iter().any(|first| point.trials.contains(first));
            (point.repeats() > 1 || contender).then(|| PointRecord {
                stood: point.stood as u32,
                mean: point.mean(),
                deviation: point.deviation(),
                contender,
                confidence: ahead.filter(|(first, _)| point.trials.contains(first)).map(|(_, confidence)| confidence),
                parameters: point.parameters,
                trials: point.trials,
            })
        };
        let shown: Vec<PointRecord> = points(outlook.trials()).into_iter().filter_map(record).collect();
        if shown != self.said.points {
            self.said.points.clone_from(&shown);
            self.outbox.push(Record::Points(shown));
        }
    }
}

fn confirming_of(study: &Study) -> Option<Confirming> {
    serde_json::from_value(study.attributes().get(CONFIRM)?.clone()).ok()
}

/// The points that are compared, as they stand now; one whose trials do not count any more is left out.
fn compared(confirming: &Confirming, study: &Study) -> Vec<Point> {
    let points = points(study.trials());
    confirming
        .trials
        .iter()
        .filter_map(|first| points.iter().find(|point| point.trials.contains(first)).cloned())
        .collect()
}

/// How many repeats may still be queued; those that run or wait are taken already, void ones use up none.
fn left(confirming: &Confirming, trials: &[Trial]) -> u32 {
    let taken = used(confirming, trials, |state| !matches!(state, TrialState::Fail | TrialState::Pruned));
    confirming.repeats.saturating_sub(taken)
}

/// How many repeats are in one of the states `of`.
fn used(confirming: &Confirming, trials: &[Trial], of: impl Fn(TrialState) -> bool) -> u32 {
    let repeat = |trial: &&Trial| {
        trial.number >= confirming.from && of(trial.state) && attributes::source_of(trial) == ProposalSource::Confirm
    };
    trials.iter().filter(repeat).count() as u32
}

fn leads(point: &Point, confidence: f64) -> String {
    let spread = point.deviation().map(|deviation| format!(" +- {deviation:.3}")).unwrap_or_default();
    format!(
        "the point of trial {} leads with {:.1} % confidence: mean {:.3}{spread}, stood {} of {}",
        point.trials[0],
        100.0 * confidence,
        point.mean(),
        point.stood,
        point.repeats()
    )
}
