//! Confirmation of the best: the best points are repeated until one leads with enough confidence, or the repeats are used
//! up. The rule is that of [`crate::optimize::repeats`]; the repeats are proposals like any other, beyond the budget.

use serde::Serialize;
use serde_json::Value;

use super::attributes;
use super::study_attributes::{Conclusion, RunningConfirmation, StudyAttributes};
use crate::optimize::ask::Direction;
use crate::optimize::repeats::{
    self, Confirmation, LEAST_REPEATS, RepeatedPoint, confirm, contenders, is_repeat, points, rank,
};
use crate::optimize::study::{Study, StudyError};
use crate::optimize::trial::{Trial, TrialState};
use crate::trial::PointRecord;

pub enum NextRepeat {
    /// No confirmation runs, or other workers run the last repeats.
    None,
    /// Repeat the point of this first trial.
    Repeat(Box<Trial>),
    /// The confirmation is over; with a line for the log.
    Over(Conclusion, String),
}

#[derive(Debug)]
pub struct BestConfirmation {
    contenders: u32,
    /// Confidence at which one of them is the best.
    confidence: f64,
    /// Conclusion that is not written yet, because the last verdict can still be undone.
    concluded: Option<Conclusion>,
    /// Conclusion that was reported last: each is reported once.
    reported: Option<Conclusion>,
    published: Vec<PointRecord>,
}

impl BestConfirmation {
    pub fn new(contenders: u32, confidence: f64) -> BestConfirmation {
        BestConfirmation { contenders, confidence, concluded: None, reported: None, published: Vec::new() }
    }

    /// Returns the first trials of the points that a confirmation in `study` would compare, that of the trial `best` among them.
    pub fn candidates(&self, study: &Study, best: Option<u32>) -> Vec<u32> {
        let compared = contenders(study.trials(), study.options().direction, self.contenders as usize, best);
        compared.iter().filter(|point| point.without_fall > 0).map(|point| point.trials[0]).collect()
    }

    /// Starts a confirmation of the points of `trials` with at most `repeats` repeats.
    pub fn start(&mut self, study: &mut Study, trials: Vec<u32>, repeats: u32) -> Result<(), StudyError> {
        #[derive(Serialize)]
        struct Started {
            confirm: RunningConfirmation,
            confirmed: Option<Conclusion>,
        }
        let confirm = RunningConfirmation { trials, repeats, from: study.trials().len() as u32 };
        study.annotate_study(&attributes::write(&Started { confirm, confirmed: None }))?;
        (self.concluded, self.reported) = (None, None);
        Ok(())
    }

    pub fn abort(&self, study: &mut Study) -> Result<(), StudyError> {
        #[derive(Serialize)]
        struct Aborted {
            confirm: Option<RunningConfirmation>,
        }
        study.annotate_study(&attributes::write(&Aborted { confirm: None }))
    }

    /// Drops a conclusion that is not written: the trials have changed.
    pub fn reopen(&mut self) {
        self.concluded = None;
    }

    /// Keeps a conclusion. Returns whether it is to be reported: it has not been yet.
    pub fn conclude(&mut self, conclusion: Conclusion) -> bool {
        let news = self.reported.as_ref() != Some(&conclusion);
        self.reported = Some(conclusion.clone());
        self.concluded = Some(conclusion);
        news
    }

    /// Lets the next conclusion be reported although it may be equal to the last one: the verdict that has ended the repeats was
    /// taken back.
    pub fn forget_report(&mut self) {
        self.reported = None;
    }

    /// Returns whether the repeats are over.
    pub fn is_over(&self) -> bool {
        self.concluded.is_some()
    }

    /// Writes the conclusion, once no verdict that it rests on can be undone any more.
    pub fn write_conclusion(&self, study: &mut Study) -> Result<(), StudyError> {
        #[derive(Serialize)]
        struct Concluded<'a> {
            confirmed: &'a Conclusion,
            confirm: Option<RunningConfirmation>,
        }
        let Some(confirmed) = self.concluded.as_ref().filter(|_| running(study).is_some()) else { return Ok(()) };
        study.annotate_study(&attributes::write(&Concluded { confirmed, confirm: None }))
    }

    pub fn next(&self, study: &Study) -> NextRepeat {
        let Some(running) = running(study) else { return NextRepeat::None };
        let direction = study.options().direction;
        let compared = compared(&running.trials, study);
        let unit = unit_of(study);
        let Some(first) = compared.first() else { return NextRepeat::None };
        let lead = lead(&compared, direction);
        let over = |sure: bool, message: String| {
            let Lead { point, confidence } = lead;
            let (trials, leader) = (running.trials.clone(), compared[point].trials[0]);
            let conclusion = Conclusion { trials, leader, confidence, sure, wanted: Some(self.confidence) };
            NextRepeat::Over(conclusion, message + &better_in_words(study, &compared, point))
        };
        if compared.len() < 2 {
            let message = format!("only the point of trial {} is left to compare: nothing to confirm", first.trials[0]);
            return over(false, message);
        }
        match confirm(&compared, direction, self.confidence) {
            Confirmation::Leads(..) => over(true, format!("confirmed: {}", lead_text(&compared, lead, unit))),
            Confirmation::Repeat(point) if running.left(study.trials()) > 0 => {
                match study.trial(compared[point].trials[0]) {
                    Ok(first) => NextRepeat::Repeat(Box::new(first.clone())),
                    Err(_) => NextRepeat::None,
                }
            }
            // Other workers run the last repeats.
            Confirmation::Repeat(_) if running.used(study.trials(), |state| !state.is_finished()) > 0 => {
                NextRepeat::None
            }
            Confirmation::Repeat(_) => {
                let short = match repeated(&compared) {
                    true => format!("short of {:.0} %", 100.0 * self.confidence),
                    false => too_few_jumps(),
                };
                let lead = lead_text(&compared, lead, unit);
                over(false, format!("the repeats are used up: {lead}; {short}"))
            }
        }
    }

    /// Returns the number of repeats that are still to be completed; none while no confirmation runs.
    pub fn repeats_left(&self, study: &Study) -> Option<u32> {
        let running = running(study).filter(|_| self.concluded.is_none())?;
        let completed = running.used(study.trials(), |state| state == TrialState::Complete);
        Some(running.repeats.saturating_sub(completed))
    }

    /// Returns all repeated and compared points of `study`, if they have changed since the last call.
    pub fn changed_points(&mut self, study: &Study) -> Option<Vec<PointRecord>> {
        let kept = StudyAttributes::of(study.attributes());
        let running = kept.confirm;
        let concluded = self.concluded.clone().or(kept.confirmed);
        let trials = running.map(|running| running.trials).or(concluded.map(|concluded| concluded.trials));
        let trials = trials.unwrap_or_default();
        let compared = compared(&trials, study);
        let lead = (!compared.is_empty()).then(|| lead(&compared, study.options().direction));
        let leader = lead
            .filter(|lead| lead.confidence > NO_CONFIDENCE)
            .map(|lead| (compared[lead.point].trials[0], lead.confidence));
        let record = |point: RepeatedPoint| {
            let contender = trials.iter().any(|first| is_of(&point, *first, study));
            (point.repeats() > 1 || contender).then(|| PointRecord {
                without_fall: point.without_fall as u32,
                mean: point.mean(),
                deviation: point.deviation(),
                contender,
                confidence: leader.filter(|(first, _)| point.trials.contains(first)).map(|(_, confidence)| confidence),
                parameters: point.parameters.into(),
                trials: point.trials,
            })
        };
        let points: Vec<PointRecord> = points(study.trials()).into_iter().filter_map(record).collect();
        if points == self.published {
            return None;
        }
        self.published.clone_from(&points);
        Some(points)
    }
}

/// Returns the state or the result of the newest confirmation of a study as a sentence without its end; none without one.
/// `confidence`: that at which a confirmation ends.
pub fn confirmation_in_words(study: &Study, confidence: f64) -> Option<String> {
    let kept = StudyAttributes::of(study.attributes());
    let concluded = match kept.confirm {
        Some(running) => match BestConfirmation::new(0, confidence).next(study) {
            // Its session writes it once the last verdict is final.
            NextRepeat::Over(concluded, _) => concluded,
            NextRepeat::Repeat(_) | NextRepeat::None => {
                let trials: Vec<String> = running.trials.iter().map(u32::to_string).collect();
                let more = match running.left(study.trials()) {
                    0 => " for the last time".to_owned(),
                    1 => ", at most once more".to_owned(),
                    left => format!(", at most {left} times more"),
                };
                return Some(format!("the points of trials {} are repeated{more}", trials.join(", ")));
            }
        },
        None => kept.confirmed?,
    };
    // The points as they are now: a verdict may have been changed, or one of them run again, since it was concluded.
    let points = compared(&concluded.trials, study);
    if points.is_empty() {
        return None;
    }
    let lead = lead(&points, study.options().direction);
    let short = match repeated(&points) {
        _ if points.len() < 2 => "; no other point was left to compare".to_owned(),
        false => format!("; {}", too_few_jumps()),
        true if varies(&points) && lead.confidence < concluded.wanted.unwrap_or(confidence) => {
            "; the confidence is below the wanted one".to_owned()
        }
        true => String::new(),
    };
    let text = lead_text(&points, lead, unit_of(study));
    Some(text + &short + &better_in_words(study, &points, lead.point))
}

/// Returns in words the best point that was not compared, if it is better than the leading one.
fn better_in_words(study: &Study, compared: &[RepeatedPoint], leader: usize) -> String {
    let direction = study.options().direction;
    let is_other = |point: &RepeatedPoint| point.without_fall > 0 && !compared.contains(point);
    let other = contenders(study.trials(), direction, usize::MAX, None).into_iter().find(is_other);
    match other.filter(|point| direction.best_first(point.mean(), compared[leader].mean()).is_lt()) {
        Some(point) => {
            let better = if direction == Direction::Maximize { "higher" } else { "lower" };
            let (trial, mean, unit) = (point.trials[0], point.mean(), unit_of(study));
            format!("; trial {trial}, not compared, is {better}: {mean:.3} {unit}").trim_end().to_owned()
        }
        None => String::new(),
    }
}

/// Returns the unit of the objective; empty for a study of another program.
fn unit_of(study: &Study) -> String {
    let kept = StudyAttributes::of(study.attributes());
    kept.unit.or(kept.task.map(|task| task.unit().to_owned())).unwrap_or_default()
}

/// Returns the reason for which points that ran too seldom cannot be compared.
fn too_few_jumps() -> String {
    format!("each point needs {LEAST_REPEATS} jumps to be compared")
}

/// Returns the number of repeats that the points of these first trials need at least to be compared.
pub fn least_repeats(first_trials: &[u32], study: &Study) -> u32 {
    repeats::least_repeats(&compared(first_trials, study)) as u32
}

pub fn running(study: &Study) -> Option<RunningConfirmation> {
    StudyAttributes::of(study.attributes()).confirm
}

/// Queues a repeat, unless other workers have begun or queued the last ones. Returns its number.
pub fn queue_repeat(
    study: &mut Study,
    parameters: &[(String, f64)],
    attributes: &[(String, Value)],
) -> Result<Option<u32>, StudyError> {
    let Some(running) = running(study) else { return Ok(None) };
    study.enqueue_unless(parameters, attributes, &|trials| running.left(trials) == 0)
}

impl RunningConfirmation {
    /// Returns the number of repeats that may still be queued. Repeats that run or wait are used, void ones are not.
    fn left(&self, trials: &[Trial]) -> u32 {
        let used = self.used(trials, |state| !matches!(state, TrialState::Fail | TrialState::Pruned));
        self.repeats.saturating_sub(used)
    }

    /// Returns the number of repeats in one of the states `of`.
    fn used(&self, trials: &[Trial], of: impl Fn(TrialState) -> bool) -> u32 {
        let repeat = |trial: &&Trial| trial.number >= self.from && of(trial.state) && attributes::confirms(trial);
        trials.iter().filter(repeat).count() as u32
    }
}

/// Returns the compared points; a point of which no trial counts any more is left out.
fn compared(first_trials: &[u32], study: &Study) -> Vec<RepeatedPoint> {
    let points = points(study.trials());
    let compared = first_trials.iter().filter_map(|first| points.iter().find(|point| is_of(point, *first, study)));
    compared.cloned().collect()
}

/// Whether `point` is that of the trial `first`, which may be void by now.
fn is_of(point: &RepeatedPoint, first: u32, study: &Study) -> bool {
    let trials = point.trials.first().map(|trial| (study.trial(*trial), study.trial(first)));
    matches!(trials, Some((Ok(of_point), Ok(first))) if is_repeat(of_point, first))
}

/// Confidence of a comparison that had too few jumps.
const NO_CONFIDENCE: f64 = 0.0;

/// Whether every point has been repeated: before, the spread is not known, and equal results would pass for certainty.
fn repeated(compared: &[RepeatedPoint]) -> bool {
    compared.iter().all(|point| point.repeats() >= LEAST_REPEATS)
}

/// Whether the repeats of any point differ. Those of a simulator without noise do not, and say nothing about the next jump of a robot.
fn varies(compared: &[RepeatedPoint]) -> bool {
    // The deviation of three times 0.4 is not zero: their mean is rounded.
    compared.iter().any(|point| point.values.windows(2).any(|pair| pair[0] != pair[1]))
}

/// The leading one of some compared points.
#[derive(Debug, Clone, Copy)]
struct Lead {
    /// Index of the point.
    point: usize,
    /// Confidence that it is the best; [`NO_CONFIDENCE`] where too few jumps say so, or equal ones.
    confidence: f64,
}

/// Returns the leading one of at least one compared point.
fn lead(compared: &[RepeatedPoint], direction: Direction) -> Lead {
    let rank = rank(compared, direction);
    let says = compared.len() > 1 && repeated(compared) && varies(compared);
    Lead { point: rank.leader, confidence: if says { rank.confidence } else { NO_CONFIDENCE } }
}

/// The leading point in words.
fn lead_text(compared: &[RepeatedPoint], Lead { point, confidence }: Lead, unit: String) -> String {
    let point = &compared[point];
    let spread = point.deviation().map(|deviation| format!(" +- {deviation:.3}")).unwrap_or_default();
    let sure = match confidence > NO_CONFIDENCE {
        true => format!("with {:.1} % confidence", 100.0 * confidence),
        false if repeated(compared) && !varies(compared) => {
            "without a confidence, because equal jumps give equal values here".to_owned()
        }
        false => "without a confidence".to_owned(),
    };
    let mean = format!("{:.3}{spread} {unit}", point.mean());
    format!(
        "the point of trial {} leads {sure}: mean {}, stood {} of {}",
        point.trials[0],
        mean.trim_end(),
        point.without_fall,
        point.repeats()
    )
}
