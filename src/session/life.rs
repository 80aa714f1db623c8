//! The life of a trial: proposed, approved, run, measured, judged. A state machine around the study; no thread, no clock,
//! no robot. The supervisor drives it from an operator's intents, `automatic` without a person.
//!
//! A verdict is on disk as soon as it is given, but the sampler is told only when the next trial begins: until then it can
//! be undone. What the operator sees next is drafted on a fork of the study in which the verdict is already told, and is
//! therefore what the study itself will propose.

mod attributes;
mod card;

use std::collections::BTreeMap;

use crate::control::settings::TaskControl;
use crate::optimize::study::{Outcome, Study, StudyError};
use crate::optimize::trial::TrialState;
use crate::realtime::command::{JumpParameters, Task, TrialSpec};
use crate::realtime::telemetry::{Tick, TrialEnd};
use crate::recording::record::{ParameterInfo, Proposal, Record, Stage, StageInfo, TrialRecord, Verdict};

use super::objective;
use attributes::Origin;
use card::Card;

/// Why a wish cannot be carried out, in words for the operator.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// It does not fit the present stage or the bounds.
    #[error("{0}")]
    NotNow(String),
    /// The study could not be read or written.
    #[error(transparent)]
    Study(#[from] StudyError),
}

fn not_now<T>(why: impl Into<String>) -> Result<T, Refusal> {
    Err(Refusal::NotNow(why.into()))
}

/// What the trials of one study have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
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
}

/// A verdict that can still be undone.
#[derive(Debug, Clone, PartialEq)]
struct Pending {
    trial: u32,
    outcome: Outcome,
    /// Queue the same parameters again.
    rerun: bool,
}

/// Trials of one study and where the present one stands.
pub struct Life {
    plan: Plan,
    study: Study,
    rows: BTreeMap<u32, TrialRecord>,
    stage: Stage,
    /// The trial that runs or is under review.
    current: u32,
    card: Option<Card>,
    /// How many cards and changes of cards there were: no approval of an earlier one fits a later one.
    revisions: u32,
    pending: Option<Pending>,
    outbox: Vec<Record>,
}

impl Life {
    /// Takes up a study, new or not. What a crash left running is told if it was judged; otherwise it is void and its
    /// parameters are queued again.
    ///
    /// # Errors
    /// When the study cannot be read or written.
    pub fn open(plan: Plan, study: Study) -> Result<Life, StudyError> {
        let mut life = Life {
            plan,
            study,
            rows: BTreeMap::new(),
            stage: Stage::Finished,
            current: 0,
            card: None,
            revisions: 0,
            pending: None,
            outbox: Vec::new(),
        };
        life.close_interrupted()?;
        for trial in life.study.trials() {
            if trial.state != TrialState::Waiting {
                let row = attributes::row_of(trial, life.study.note_of(trial.number), &life.plan.parameters);
                life.outbox.push(Record::Trial(row.clone()));
                life.rows.insert(trial.number, row);
            }
        }
        life.propose()?;
        Ok(life)
    }

    /// What happened since the last call, for the screen and the recording.
    pub fn take_records(&mut self) -> Vec<Record> {
        std::mem::take(&mut self.outbox)
    }

    /// Where the present trial stands.
    pub fn stage(&self) -> Stage {
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

    /// The accepted trial with the largest value, the earliest of equals.
    pub fn best(&self) -> Option<&TrialRecord> {
        let judged = self.rows.values().filter(|row| row.verdict == Some(Verdict::Accept));
        judged.fold(None, |best: Option<&TrialRecord>, row| match best {
            Some(best) if row.value <= best.value => Some(best),
            _ => Some(row),
        })
    }

    /// The card on the table.
    pub fn proposal(&self) -> Option<Proposal> {
        self.card.as_ref().map(Card::proposal)
    }

    /// How many trials count so far.
    pub fn counted(&self) -> u32 {
        let counts = |row: &&TrialRecord| matches!(row.verdict, Some(Verdict::Accept | Verdict::Fall));
        self.rows.values().filter(counts).count() as u32
    }

    /// Sets one parameter of the proposal.
    ///
    /// # Errors
    /// When there is no proposal, no such parameter, or the value is outside its bounds.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), Refusal> {
        let Some(card) = &mut self.card else { return not_now("there is no proposal to change") };
        let Some(parameter) = self.plan.parameters.iter().find(|parameter| parameter.name == name) else {
            let known: Vec<_> = self.plan.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
            return not_now(format!("there is no parameter {name}; the parameters are {}", known.join(", ")));
        };
        let ParameterInfo { unit, low, high, .. } = parameter;
        if !(value >= *low && value <= *high) {
            return not_now(format!("{name} = {value} {unit} is outside its bounds {low} to {high} {unit}"));
        }
        self.revisions += 1;
        card.set(name, value, self.revisions);
        self.show_card();
        Ok(())
    }

    /// Back to what was proposed.
    ///
    /// # Errors
    /// When there is no proposal.
    pub fn clear_overrides(&mut self) -> Result<(), Refusal> {
        let Some(card) = &mut self.card else { return not_now("there is no proposal to change") };
        self.revisions += 1;
        card.clear(self.revisions);
        self.show_card();
        Ok(())
    }

    /// Approves the card as it was seen: it becomes a running trial, on disk before this returns.
    ///
    /// # Errors
    /// When another card is on the table by now, or the study cannot be written.
    pub fn approve(&mut self, trial: u32, revision: u32) -> Result<TrialSpec, Refusal> {
        let Some(card) = &self.card else { return not_now("there is no proposal to approve") };
        if card.number() != trial || card.revision != revision {
            return not_now(format!(
                "you approved trial {trial} as it was before; look at the card again (trial {}) and approve that",
                card.number()
            ));
        }
        let number = self.begin()?;
        self.enter(Stage::Running, number);
        Ok(self.spec(number))
    }

    /// Refuses the proposal: the sampler is told nothing and proposes another.
    ///
    /// # Errors
    /// When there is no proposal, or the study cannot be written.
    pub fn skip(&mut self) -> Result<(), Refusal> {
        if self.card.is_none() {
            return not_now("there is no proposal to skip");
        }
        let number = self.begin()?;
        if let Some(row) = self.rows.get_mut(&number) {
            row.verdict = Some(Verdict::Void);
            row.cause = "skipped before the jump".to_owned();
        }
        self.write_judgement(number, false)?;
        self.study.tell(number, Outcome::Fail)?;
        self.show_row(number);
        self.propose()?;
        Ok(())
    }

    /// The running trial is over: it is measured and waits for its verdict.
    pub fn ended(&mut self, trial: u32, end: &TrialEnd, ticks: &[Tick]) {
        if self.stage != Stage::Running || self.current != trial {
            return;
        }
        let (mut suggested, mut cause) = objective::suggest(end);
        let missing = objective::missing(ticks);
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
        self.enter(Stage::Review, trial);
    }

    /// Judges the trial under review; with `rerun` its parameters are queued again.
    ///
    /// # Errors
    /// When nothing is under review, or an accepted trial has no value, or the study cannot be written.
    pub fn judge(&mut self, verdict: Verdict, rerun: bool) -> Result<(), Refusal> {
        if self.stage != Stage::Review {
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
        row.verdict = Some(verdict);
        row.value = value;
        self.write_judgement(trial, rerun)?;
        self.show_row(trial);
        self.pending = Some(Pending { trial, outcome, rerun });
        self.propose()?;
        Ok(())
    }

    /// Takes the last verdict back.
    ///
    /// # Errors
    /// When it was told already, or the study cannot be written.
    pub fn undo(&mut self) -> Result<(), Refusal> {
        if !matches!(self.stage, Stage::Proposed | Stage::Finished) || self.pending.is_none() {
            return not_now("there is no verdict to undo; the last one was told when the next trial began");
        }
        let Some(pending) = self.pending.take() else { return Ok(()) };
        if let Some(row) = self.rows.get_mut(&pending.trial) {
            row.verdict = None;
            row.value = row.suggested.and_then(|suggested| value_of(row, suggested, &self.plan));
        }
        self.write_judgement(pending.trial, false)?;
        self.card = None;
        self.show_row(pending.trial);
        self.enter(Stage::Review, pending.trial);
        Ok(())
    }

    /// Uses a value measured by hand for the trial under review; none goes back to the measured one.
    ///
    /// # Errors
    /// When nothing is under review or the value is not finite.
    pub fn set_hand_value(&mut self, value: Option<f64>) -> Result<(), Refusal> {
        if self.stage != Stage::Review {
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

    /// Queues the parameters of an earlier trial again.
    ///
    /// # Errors
    /// When there is no such trial, a trial is under way, or the study cannot be written.
    pub fn repeat(&mut self, trial: u32) -> Result<(), Refusal> {
        let Some(row) = self.rows.get(&trial) else { return not_now(format!("there is no trial {trial}")) };
        let parameters = row.parameters.clone();
        self.queue(&parameters, &Origin::rerun_of(trial))
    }

    /// Queues a point.
    ///
    /// # Errors
    /// When a value is outside its bounds, a trial is under way, or the study cannot be written.
    pub fn enqueue(&mut self, parameters: &[(String, f64)]) -> Result<(), Refusal> {
        for (name, value) in parameters {
            match self.plan.parameters.iter().find(|parameter| parameter.name == *name) {
                Some(p) if *value >= p.low && *value <= p.high => {}
                Some(p) => {
                    return not_now(format!(
                        "{name} = {value} is outside its bounds {} to {} {}",
                        p.low, p.high, p.unit
                    ));
                }
                None => return not_now(format!("there is no parameter {name}")),
            }
        }
        self.queue(parameters, &Origin::queued())
    }

    /// A note on a trial, also on one that was told long ago.
    ///
    /// # Errors
    /// When there is no such trial or the study cannot be written.
    pub fn note(&mut self, trial: u32, text: &str) -> Result<(), Refusal> {
        let Some(row) = self.rows.get_mut(&trial) else { return not_now(format!("there is no trial {trial}")) };
        row.note = text.to_owned();
        self.study.note(trial, text)?;
        self.show_row(trial);
        Ok(())
    }

    /// Raises the budget.
    ///
    /// # Errors
    /// When the study cannot be read.
    pub fn extend(&mut self, trials: u32) -> Result<(), Refusal> {
        self.plan.budget += trials;
        if self.stage == Stage::Finished {
            self.propose()?;
        }
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
        self.tell_pending()
    }

    fn queue(&mut self, parameters: &[(String, f64)], origin: &Origin) -> Result<(), Refusal> {
        if matches!(self.stage, Stage::Running | Stage::Review) {
            return not_now("finish the present trial first");
        }
        self.study.enqueue(parameters, &origin.attributes())?;
        self.propose()?;
        Ok(())
    }

    /// Puts the next card on the table, or finishes.
    fn propose(&mut self) -> Result<(), StudyError> {
        if self.counted() >= self.plan.budget {
            self.card = None;
            let last = self.rows.keys().next_back().copied().unwrap_or(0);
            self.enter(Stage::Finished, last);
            return Ok(());
        }
        self.study.refresh()?;
        let mut fork = self.study.fork();
        if let Some(pending) = &self.pending {
            fork.tell(pending.trial, pending.outcome)?;
            if pending.rerun {
                self.enqueue_rerun(&mut fork, pending.trial)?;
            }
        }
        self.revisions += 1;
        let card = Card::new(fork, self.revisions);
        let number = card.number();
        self.card = Some(card);
        self.show_card();
        self.enter(Stage::Proposed, number);
        Ok(())
    }

    /// The card becomes a running trial of the study.
    fn begin(&mut self) -> Result<u32, StudyError> {
        self.tell_pending()?;
        let Some(card) = &self.card else { unreachable!("callers have looked at the card") };
        let proposal = card.proposal();
        let origin = card.origin();
        let seed = origin.seed.unwrap_or_else(|| trial_seed(self.plan.seed, card.number()));
        let began = attributes::began(&proposal, seed, &self.plan.recording);
        let number = self.study.begin(&card.draft, &card.overrides(), &began)?;
        self.card = None;
        let row = TrialRecord {
            trial: number,
            source: proposal.source,
            parent: proposal.parent,
            parameters: proposal.parameters.iter().map(|p| (p.name.clone(), p.value)).collect(),
            measured: None,
            value: None,
            hand_value: None,
            suggested: None,
            cause: String::new(),
            verdict: None,
            note: String::new(),
            risk: proposal.risk,
        };
        self.rows.insert(number, row);
        self.show_row(number);
        Ok(number)
    }

    fn tell_pending(&mut self) -> Result<(), StudyError> {
        let Some(pending) = self.pending.clone() else { return Ok(()) };
        self.study.tell(pending.trial, pending.outcome)?;
        if pending.rerun {
            let (parameters, origin) = self.rerun_of(pending.trial);
            self.study.enqueue(&parameters, &origin.attributes())?;
        }
        // Only now: what could not be written is still to be told.
        self.pending = None;
        Ok(())
    }

    fn enqueue_rerun(&self, study: &mut Study, trial: u32) -> Result<(), StudyError> {
        let (parameters, origin) = self.rerun_of(trial);
        study.enqueue(&parameters, &origin.attributes()).map(|_| ())
    }

    fn rerun_of(&self, trial: u32) -> (Vec<(String, f64)>, Origin) {
        let parameters = self.rows.get(&trial).map(|row| row.parameters.clone()).unwrap_or_default();
        (parameters, Origin::rerun_of(trial))
    }

    /// What a crash left behind.
    fn close_interrupted(&mut self) -> Result<(), StudyError> {
        let running: Vec<_> = self.study.running().cloned().collect();
        for trial in running {
            match attributes::judgement_of(&trial) {
                Some(outcome) => {
                    self.study.tell(trial.number, outcome)?;
                    self.log(format!("trial {} was judged before the interruption: it counts", trial.number));
                }
                None => {
                    // Queued again below, or by the next session if this one is killed before it gets there.
                    let cause = "interrupted: the program ended before the verdict";
                    self.study.annotate(trial.number, &attributes::interrupted(cause))?;
                    self.study.tell(trial.number, Outcome::Fail)?;
                    self.log(format!("trial {} was interrupted: it is void and queued again", trial.number));
                }
            }
        }
        // A void trial whose parameters were to come again, and did not get to.
        let owed: Vec<_> = self.study.trials().iter().filter(|trial| attributes::is_owed(trial)).cloned().collect();
        for trial in owed {
            if !self.study.trials().iter().any(|other| Origin::of(&other.user_attributes).parent == Some(trial.number))
            {
                let origin = if attributes::was_interrupted(&trial) {
                    // The same seed as before: the study goes on as if nothing had happened.
                    Origin::interrupted(&trial)
                } else {
                    Origin::rerun_of(trial.number)
                };
                self.study.enqueue(&trial.parameters, &origin.attributes())?;
            }
        }
        Ok(())
    }

    fn write_judgement(&mut self, trial: u32, rerun: bool) -> Result<(), StudyError> {
        match self.rows.get(&trial) {
            Some(row) => self.study.annotate(trial, &attributes::judged(row, rerun)),
            None => Ok(()),
        }
    }

    fn enter(&mut self, stage: Stage, trial: u32) {
        self.stage = stage;
        self.current = trial;
        self.outbox.push(Record::Stage(StageInfo { stage, trial, can_undo: self.pending.is_some() }));
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
        self.outbox.push(Record::Log(crate::recording::record::LogRecord {
            level: crate::recording::record::Level::Info,
            source: "study".to_owned(),
            message,
        }));
    }

    /// What the control thread is given for the trial `number`.
    fn spec(&self, number: u32) -> TrialSpec {
        let row = &self.rows[&number];
        let control = &self.plan.control;
        let value = |name: &str| row.parameters.iter().find(|(n, _)| n == name).map_or(0.0, |(_, value)| *value);
        let has_f1 = self.plan.parameters.iter().any(|parameter| parameter.name == "f1");
        let seed = self.study.trials().iter().find(|trial| trial.number == number).and_then(attributes::seed_of);
        TrialSpec {
            trial: number,
            task: self.plan.task,
            jump: JumpParameters {
                f0_hz: value("f0"),
                f1_hz: if has_f1 { value("f1") } else { control.f1_hz },
                fx_n: value("Fx"),
                fy_n: value("Fy"),
                fz_n: value("Fz"),
            },
            gains: control.gains(),
            stance_leg: control.stance_leg(),
            vmc: control.vmc,
            jumps: control.jumps,
            seed: seed.unwrap_or_else(|| trial_seed(self.plan.seed, number)),
        }
    }
}

/// What a verdict makes of a row: 0 for a fall (paper, section II-D), nothing for a void, else the value measured by hand
/// or by the robot.
fn value_of(row: &TrialRecord, verdict: Verdict, plan: &Plan) -> Option<f64> {
    match verdict {
        Verdict::Fall => Some(0.0),
        Verdict::Void => None,
        Verdict::Accept => row.hand_value.or_else(|| {
            row.measured.as_ref().map(|measured| objective::value(plan.task, measured, plan.control.jumps))
        }),
    }
}

/// The seed of one trial's noise and terrain: the study's seed and the number, mixed (SplitMix64 finalizer, Steele et al. 2014).
fn trial_seed(study: u64, trial: u32) -> u64 {
    let mut z = study.wrapping_add(u64::from(trial).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
