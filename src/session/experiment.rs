//! The life of a trial: proposed, approved, run, measured, judged. A state machine around the study; no thread, no clock,
//! no robot. The supervisor drives it from an operator's intents, `automatic` without a person.
//!
//! A verdict is on disk as soon as it is given, but the sampler is told only when the next trial begins: until then it can
//! be undone. What the operator sees next is drafted on a fork of the study in which the verdict is already told, and is
//! therefore what the study itself will propose.

mod attributes;
mod card;
mod confirming;
mod gains;
mod proposing;
mod recovery;
mod searching;
mod watch;
mod wishes;

pub use wishes::BUDGET;

use std::collections::BTreeMap;
use std::time::Duration;

use crate::control::settings::TaskControl;
use crate::optimize::exchange::TableTrial;
use crate::optimize::repeats::{Point, points};
use crate::optimize::study::{Outcome, Study, StudyError};
use crate::optimize::trial::TrialState;
use crate::recording::record::{LogLevel, LogRecord, Record, StageRecord};
use crate::telemetry::{Tick, TrialEnd, TrialSpec};
use crate::trial::{
    ExperimentStage, ParameterInfo, PointRecord, Proposal, ProposalSource, SearchStatus, Task, TrialRecord, Verdict,
};

use super::objective;
use card::Card;
use confirming::Confirmed;
use searching::Searched;
use watch::Watch;

/// Why a wish cannot be carried out, in words for the operator.
#[derive(Debug, thiserror::Error)]
pub enum RequestRefusal {
    /// It does not fit the present stage or the bounds.
    #[error("{0}")]
    NotNow(String),
    /// Another worker was faster; the next proposal is on the table.
    #[error("another worker was faster: the proposal for trial {0} does not hold any more; look at the new one")]
    Overtaken(u32),
    /// The trial under review was ended by another program; the next proposal is on the table.
    #[error("trial {0} was ended by somebody else meanwhile: what they say stands")]
    EndedElsewhere(u32),
    /// The study could not be read or written.
    #[error(transparent)]
    Study(#[from] StudyError),
}

fn not_now<T>(why: impl Into<String>) -> Result<T, RequestRefusal> {
    Err(RequestRefusal::NotNow(why.into()))
}

/// What the trials of one study have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentPlan {
    /// The task.
    pub task: Task,
    /// What the controller runs with.
    pub control: TaskControl,
    /// Parameters with their bounds, in table order.
    pub parameters: Vec<ParameterInfo>,
    /// Seed of the study.
    pub seed: u64,
    /// How many trials are to count.
    pub budget: u32,
    /// Name of the recording that the trials go into; empty without one.
    pub recording: String,
    /// The same parameters with the widest bounds that they may be given.
    pub widest: Vec<ParameterInfo>,
    /// The controller's gains with the ranges in which they may be set.
    pub gains: Vec<ParameterInfo>,
    /// How many of the best points are repeated to confirm the best.
    pub contenders: u32,
    /// Confidence at which one of them is the best.
    pub confidence: f64,
    /// Who this is among the workers on the study: 0 has the study's folder, and with it what a crash left behind.
    pub worker: u32,
    /// After how long without news a running trial of another worker counts as dead.
    pub abandoned: Duration,
}

/// A verdict that can still be undone.
#[derive(Debug, Clone, PartialEq)]
struct Pending {
    /// The row as it was before the verdict.
    suggestion: TrialRecord,
    outcome: Outcome,
    /// Queue the same parameters again.
    rerun: bool,
}

/// Trials of one study and where the present one stands.
pub struct Experiment {
    plan: ExperimentPlan,
    study: Study,
    watch: Watch,
    rows: BTreeMap<u32, TrialRecord>,
    stage: ExperimentStage,
    /// The trial that runs or is under review.
    current: u32,
    card: Option<Card>,
    /// How many cards and changes of cards there were: no approval of an earlier one fits a later one.
    revisions: u32,
    pending: Option<Pending>,
    searched: Searched,
    confirmed: Option<Confirmed>,
    outbox: Vec<Record>,
    /// What was said last of search and points: said again only if it has changed.
    said: Said,
}

/// What the screen knows already.
#[derive(Default)]
struct Said {
    search: Option<SearchStatus>,
    points: Vec<PointRecord>,
}

impl Experiment {
    /// Takes up a study, new or not. What a crash left running is told if it was judged; otherwise it is void and its
    /// parameters are queued again.
    ///
    /// # Errors
    /// When the study cannot be read or written.
    pub fn open(plan: ExperimentPlan, study: Study) -> Result<Experiment, StudyError> {
        let mut life = Experiment {
            watch: Watch::new(plan.abandoned),
            plan,
            study,
            rows: BTreeMap::new(),
            stage: ExperimentStage::Finished,
            current: 0,
            card: None,
            revisions: 0,
            pending: None,
            searched: Searched::default(),
            confirmed: None,
            outbox: Vec::new(),
            said: Said::default(),
        };
        life.close_interrupted()?;
        life.propose()?;
        Ok(life)
    }

    /// What happened since the last call, for the screen and the recording.
    pub fn take_records(&mut self) -> Vec<Record> {
        std::mem::take(&mut self.outbox)
    }

    /// Where the present trial stands.
    pub fn stage(&self) -> ExperimentStage {
        self.stage
    }

    /// The rows of the trial table, by number.
    pub fn rows(&self) -> impl Iterator<Item = &TrialRecord> {
        self.rows.values()
    }

    /// The row of `trial`.
    pub fn row(&self, trial: u32) -> Option<&TrialRecord> {
        self.rows.get(&trial)
    }

    /// The row of the trial under review. It need not be the newest: another program may have added trials meanwhile.
    pub fn under_review(&self) -> Option<&TrialRecord> {
        if self.stage == ExperimentStage::Review { self.row(self.current) } else { None }
    }

    /// The accepted trial whose point is worth most, the earliest of equals: a repeated point is worth the mean of its
    /// repeats ([`crate::optimize::repeats`]).
    pub fn best(&self) -> Option<&TrialRecord> {
        let points = points(self.study.trials());
        let worth = |row: &TrialRecord| {
            points.iter().find(|point| point.trials.contains(&row.trial)).map(Point::mean).or(row.value)
        };
        let judged = self.rows.values().filter(|row| row.verdict == Some(Verdict::Accept));
        let worths = judged.map(|row| (worth(row), row));
        worths
            .fold(None, |best: Option<(_, &TrialRecord)>, row| best.filter(|best| row.0 <= best.0).or(Some(row)))
            .map(|(_, row)| row)
    }

    /// The card on the table.
    pub fn proposal(&self) -> Option<Proposal> {
        self.card.as_ref().map(Card::proposal)
    }

    /// How many trials count so far; repeats that confirm the best are beyond the budget.
    pub fn counted(&self) -> u32 {
        let counts = |row: &&TrialRecord| {
            matches!(row.verdict, Some(Verdict::Accept | Verdict::Fall)) && row.source != ProposalSource::Confirm
        };
        self.rows.values().filter(counts).count() as u32
    }

    /// Approves the card as it was seen: it becomes a running trial, on disk before this returns.
    ///
    /// # Errors
    /// When another card is on the table by now, its values are outside the limits, or the study cannot be written.
    pub fn approve(&mut self, trial: u32, revision: u32) -> Result<TrialSpec, RequestRefusal> {
        let Some(card) = &self.card else { return not_now("there is no proposal to approve") };
        if card.number() != trial || card.revision != revision {
            return not_now(format!(
                "you approved trial {trial} as it was before; look at the card again (trial {}) and approve that",
                card.number()
            ));
        }
        if let Some(objection) = self.objection() {
            return not_now(format!("{objection}; change it, or refuse the proposal"));
        }
        let number = self.begin()?;
        self.enter(ExperimentStage::Running, number);
        Ok(self.spec(number))
    }

    /// Refuses the proposal: the sampler is told nothing and proposes another.
    ///
    /// # Errors
    /// When there is no proposal, or the study cannot be written.
    pub fn skip(&mut self) -> Result<(), RequestRefusal> {
        if self.card.is_none() {
            return not_now("there is no proposal to skip");
        }
        let cause = match self.objection() {
            Some(objection) => format!("not run: {objection}"),
            None => "skipped before the jump".to_owned(),
        };
        let number = self.begin()?;
        if let Some(row) = self.rows.get_mut(&number) {
            row.verdict = Some(Verdict::Void);
            row.cause = cause;
        }
        self.write_judgement(number, false)?;
        self.study.tell(number, Outcome::Fail)?;
        self.show_row(number);
        self.propose()?;
        Ok(())
    }

    /// The running trial is over: it is measured and waits for its verdict. `whole` is how many ticks it has: where some of them
    /// were lost on the way, nothing is measured.
    pub fn ended(&mut self, trial: u32, end: &TrialEnd, ticks: &[Tick], whole: u64) {
        if self.stage != ExperimentStage::Running || self.current != trial {
            return;
        }
        let (mut suggested, mut cause) = objective::suggest(end);
        let missing = whole.saturating_sub(ticks.len() as u64);
        if missing > 0 {
            (suggested, cause) = (Verdict::Void, format!("{missing} ticks of it were not recorded: not measured"));
        }
        if let Some(row) = self.rows.get_mut(&trial) {
            row.measured = if missing == 0 { objective::measure(ticks) } else { None };
            row.suggested = Some(suggested);
            row.cause = cause;
            row.value = value_of(row, suggested, &self.plan);
        }
        self.show_row(trial);
        self.enter(ExperimentStage::Review, trial);
    }

    /// Judges the trial under review; with `rerun` its parameters are queued again.
    ///
    /// # Errors
    /// When nothing is under review, or an accepted trial has no value, or the study cannot be written.
    pub fn judge(&mut self, verdict: Verdict, rerun: bool) -> Result<(), RequestRefusal> {
        if self.stage != ExperimentStage::Review {
            return not_now("no trial is under review");
        }
        let trial = self.current;
        let Some(row) = self.rows.get_mut(&trial) else { return not_now("no trial is under review") };
        let value = value_of(row, verdict, &self.plan);
        let outcome = match (verdict, value) {
            (Verdict::Void, _) => Outcome::Fail,
            (_, Some(value)) => Outcome::Complete(value),
            (_, None) => {
                return not_now("nothing was measured in this trial; enter a value measured by hand, or mark it void");
            }
        };
        let suggestion = row.clone();
        row.verdict = Some(verdict);
        row.value = value;
        if let Some(suggested) = row.suggested.filter(|suggested| *suggested != verdict) {
            row.cause = format!("by the operator; looked like {}: {}", suggested.name(), row.cause);
        }
        match self.write_judgement(trial, rerun) {
            // It took so long that another worker has closed it and queued it again, or somebody has ended it by hand.
            Err(StudyError::State { .. }) => {
                self.rows.remove(&trial);
                self.stage = ExperimentStage::Finished;
                self.propose()?;
                return Err(RequestRefusal::EndedElsewhere(trial));
            }
            Err(error) => {
                self.rows.insert(trial, suggestion);
                return Err(error.into());
            }
            Ok(()) => {}
        }
        self.show_row(trial);
        self.pending = Some(Pending { suggestion, outcome, rerun });
        self.propose()?;
        Ok(())
    }

    /// Takes the last verdict back.
    ///
    /// # Errors
    /// When it was told already, or the study cannot be written.
    pub fn undo(&mut self) -> Result<(), RequestRefusal> {
        if !matches!(self.stage, ExperimentStage::Proposed | ExperimentStage::Finished) || self.pending.is_none() {
            return not_now("there is no verdict to undo; the last one was told when the next trial began");
        }
        let Some(pending) = &self.pending else { return Ok(()) };
        let mut row = pending.suggestion.clone();
        let trial = row.trial;
        if let Some(judged) = self.rows.get(&trial) {
            row.note.clone_from(&judged.note);
        }
        // Only what is written is taken back: a verdict that still stands on the disk must still be told.
        self.study.annotate(trial, &attributes::judged(&row, false))?;
        self.pending = None;
        self.rows.insert(trial, row);
        self.card = None;
        self.show_row(trial);
        self.enter(ExperimentStage::Review, trial);
        Ok(())
    }

    /// Uses a value measured by hand for the trial under review; none goes back to the measured one.
    ///
    /// # Errors
    /// When nothing is under review or the value is not finite.
    pub fn set_hand_value(&mut self, value: Option<f64>) -> Result<(), RequestRefusal> {
        if self.stage != ExperimentStage::Review {
            return not_now("no trial is under review");
        }
        if value.is_some_and(|value| !value.is_finite()) {
            return not_now("a measured value must be a finite number");
        }
        let trial = self.current;
        if let Some(row) = self.rows.get_mut(&trial) {
            row.hand_value = value;
            row.value = row.suggested.and_then(|suggested| value_of(row, suggested, &self.plan));
        }
        self.show_row(trial);
        Ok(())
    }

    /// How many trials are to count.
    pub fn budget(&self) -> u32 {
        self.plan.budget
    }

    /// Tells what is pending: the session ends.
    ///
    /// # Errors
    /// When the study cannot be written.
    pub fn close(&mut self) -> Result<(), StudyError> {
        self.tell_pending().map(drop)
    }

    fn write_judgement(&mut self, trial: u32, rerun: bool) -> Result<(), StudyError> {
        match self.rows.get(&trial) {
            Some(row) => self.study.annotate(trial, &attributes::judged(row, rerun)),
            None => Ok(()),
        }
    }

    fn enter(&mut self, stage: ExperimentStage, trial: u32) {
        self.stage = stage;
        self.current = trial;
        self.outbox.push(Record::Stage(StageRecord { stage, trial, can_undo: self.pending.is_some() }));
    }

    fn show_card(&mut self) {
        if let Some(proposal) = self.proposal() {
            self.outbox.push(Record::Proposal(proposal));
        }
    }

    fn show_row(&mut self, trial: u32) {
        if let Some(row) = self.rows.get(&trial) {
            self.outbox.push(Record::Trial(row.clone()));
        }
    }

    fn log(&mut self, message: String) {
        self.outbox.push(Record::Log(LogRecord { level: LogLevel::Info, source: "study".to_owned(), message }));
    }
}

/// The trial table of a study that is only looked at: every trial but those that wait.
pub fn rows_of(study: &Study, order: &[ParameterInfo]) -> Vec<TrialRecord> {
    let begun = study.trials().iter().filter(|trial| trial.state != TrialState::Waiting);
    begun.map(|trial| attributes::row_of(trial, study.note_of(trial.number), order)).collect()
}

/// Adds finished trials of another study: what an operator of that study still wanted is not owed here.
///
/// # Errors
/// As [`Study::import`].
pub fn import(study: &mut Study, trials: Vec<TableTrial>) -> Result<Vec<u32>, StudyError> {
    let trials: Vec<TableTrial> = trials
        .into_iter()
        .map(|trial| TableTrial { attributes: attributes::elsewhere(trial.attributes), ..trial })
        .collect();
    study.import(&trials)
}

/// What a verdict makes of a row: 0 for a fall (paper, section II-D), nothing for a void, else the value measured by hand
/// or by the robot.
fn value_of(row: &TrialRecord, verdict: Verdict, plan: &ExperimentPlan) -> Option<f64> {
    match verdict {
        Verdict::Fall => Some(0.0),
        Verdict::Void => None,
        Verdict::Accept => row.hand_value.or_else(|| {
            row.measured.as_ref().map(|measured| objective::value(plan.task, measured, plan.control.jumps))
        }),
    }
}
