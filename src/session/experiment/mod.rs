//! An experiment: the trials of one study, each proposed, approved, run, measured and judged. A state machine around the
//! study without thread, clock or robot. The supervisor drives it by an operator's requests, `automatic` without a person.
//!
//! A verdict is on disk as soon as it is given, but it is reported to the sampler only when the next trial begins: until
//! then it can be undone. The next proposal is drafted on a fork of the study in which the verdict is already reported,
//! and is therefore what the study itself will propose.

pub(crate) mod attributes;
mod between_repeats;
mod changes;
mod confirmation;
mod envelope;
mod judging;
mod kept_changes;
mod liveness;
mod open_proposal;
mod other_programs;
mod plan;
mod proposal_start;
mod queue;
mod queue_changes;
mod readers;
mod repeats;
mod search;
pub(crate) mod study_attributes;
mod trial_changes;
mod verdict_change;

pub use self::changes::CHANGED_PREFIX;
pub use self::confirmation::confirmation_in_words;
pub use self::plan::{ExperimentPlan, RequestRefusal};
pub use self::proposal_start::next_seed;
pub use self::readers::{best_of, judged, points_of_rows};
pub use self::search::fixed_in_words;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use self::attributes::TrialAttributes;
use self::between_repeats::BetweenRepeats;
use self::confirmation::BestConfirmation;
use self::open_proposal::OpenProposal;
use self::plan::not_now;
use self::queue::TrialQueue;
use self::search::SearchSettings;
use crate::optimize::exchange::TableTrial;
use crate::optimize::journal::JournalWait;
use crate::optimize::prior::PriorModel;
use crate::optimize::study::{ModelBest, Outcome, Study, StudyError};
use crate::optimize::trial::{Trial, TrialState};
use crate::recording::record::{LogLevel, LogRecord, Record, StageRecord};
use crate::telemetry::TrialSpec;
use crate::trial::{
    Backend, ExperimentStage, NOT_RUN, ParameterInfo, Proposal, SKIPPED, SearchStatus, TrialRecord, Verdict,
};

/// A verdict that can still be undone.
#[derive(Debug, Clone, PartialEq)]
struct PendingVerdict {
    /// The row before the verdict.
    suggestion: TrialRecord,
    outcome: Outcome,
    /// Queue the same parameters again, before every trial from this number on: those were queued after the verdict.
    rerun: Option<u32>,
}

/// State of the current trial.
enum ExperimentState {
    /// A proposal waits for approval.
    Proposed(Box<OpenProposal>),
    /// This trial runs.
    Running(u32),
    /// This trial waits for its verdict.
    Review(u32),
    /// The next rollout of this trial waits for approval.
    BetweenRepeats(BetweenRepeats),
    /// The budget is used up.
    Finished,
    /// The sampler has no prior yet: nothing is proposed.
    AwaitsPrior,
}

/// The trials of one study and the state of the current one.
pub struct Experiment {
    plan: ExperimentPlan,
    study: Study,
    state: ExperimentState,
    /// Rows of the trial table, by number.
    rows: BTreeMap<u32, TrialRecord>,
    /// Numbers of the rows of trials that other programs still ran when they were read.
    running_elsewhere: BTreeSet<u32>,
    /// Number of open proposals and of their changes: the newest revision.
    revisions: u32,
    pending_verdict: Option<PendingVerdict>,
    queue: TrialQueue,
    search: SearchSettings,
    confirmation: BestConfirmation,
    /// The result of a confirmation that has just ended, in words.
    concluded: Option<String>,
    outbox: Vec<Record>,
    published_search: Option<SearchStatus>,
    /// Share of the force bounds that the next trial may use.
    hop_share: Option<f64>,
    /// The best trial by the sampler's model, the pending verdict included.
    model_best: Option<ModelBest>,
}

impl Experiment {
    /// Opens a study, new or not. Of the trials that an earlier session left running one that was judged counts, one that was
    /// measured waits for its verdict again, and any other is void and its parameters are queued again.
    pub fn open(plan: ExperimentPlan, study: Study) -> Result<Experiment, StudyError> {
        let mut experiment = Experiment {
            queue: TrialQueue::new(plan.worker, plan.abandoned),
            confirmation: BestConfirmation::new(plan.contenders, plan.confidence),
            plan,
            study,
            state: ExperimentState::Finished,
            rows: BTreeMap::new(),
            running_elsewhere: BTreeSet::new(),
            revisions: 0,
            pending_verdict: None,
            search: SearchSettings::default(),
            concluded: None,
            outbox: Vec::new(),
            published_search: None,
            hop_share: None,
            model_best: None,
        };
        // The rollouts of a trial of several are kept one by one, see `repeats`.
        let unjudged = experiment.queue.unjudged(&experiment.study).filter(|_| experiment.plan.control.repeats <= 1);
        let log = experiment.queue.close_interrupted(&mut experiment.study, unjudged)?;
        experiment.log_all(log);
        match unjudged {
            Some(trial) => experiment.review_again(trial)?,
            None => experiment.propose()?,
        }
        Ok(experiment)
    }

    /// Gives the sampler its prior. An experiment that has waited for it makes its first proposal.
    ///
    /// # Errors
    /// When the study cannot be read or written.
    pub fn use_prior(&mut self, prior: Arc<PriorModel>) -> Result<(), StudyError> {
        self.study.use_prior(prior);
        self.plan.needs_prior = false;
        if matches!(self.state, ExperimentState::AwaitsPrior) { self.propose() } else { Ok(()) }
    }

    /// Takes the records since the last call, for the console and the recording.
    pub fn take_records(&mut self) -> Vec<Record> {
        std::mem::take(&mut self.outbox)
    }

    /// Takes the result of a confirmation of the best that has ended since the last call, in words.
    pub fn take_conclusion(&mut self) -> Option<String> {
        self.concluded.take()
    }

    /// Returns the stage of the current trial.
    pub fn stage(&self) -> ExperimentStage {
        match self.state {
            ExperimentState::Proposed(_) | ExperimentState::BetweenRepeats(_) | ExperimentState::AwaitsPrior => {
                ExperimentStage::Proposed
            }
            ExperimentState::Running(_) => ExperimentStage::Running,
            ExperimentState::Review(_) => ExperimentStage::Review,
            ExperimentState::Finished => ExperimentStage::Finished,
        }
    }

    /// Returns the rows of the trial table, by number.
    pub fn rows(&self) -> impl Iterator<Item = &TrialRecord> {
        self.rows.values()
    }

    /// Returns the row of `trial`.
    pub fn row(&self, trial: u32) -> Option<&TrialRecord> {
        self.rows.get(&trial)
    }

    /// Returns the row of the trial under review. It need not be the newest: another program may have added trials.
    pub fn under_review(&self) -> Option<&TrialRecord> {
        match self.state {
            ExperimentState::Review(trial) => self.row(trial),
            _ => None,
        }
    }

    /// Returns the suggested verdict of the trial under review; none where a person has to judge: over a value by hand, and over a jump
    /// of another backend.
    pub fn verdict_without_person(&self) -> Option<Verdict> {
        let row = self.under_review().filter(|row| row.hand_value.is_none())?;
        let attributes = TrialAttributes::of(self.study.trials().get(row.trial as usize)?);
        let measured_on = attributes.backend.as_deref().unwrap_or(Backend::Simulator.name());
        row.suggested.filter(|_| measured_on == self.plan.backend.name())
    }

    /// Returns the best trial by the sampler's model and what that says of it; none for a sampler without a model.
    pub fn model_best(&self) -> Option<ModelBest> {
        self.model_best
    }

    /// Returns the best trial ([`best_of`]).
    pub fn best(&self) -> Option<&TrialRecord> {
        best_of(&self.study, self.rows.values(), self.model_best)
    }

    /// Returns the proposal that waits for approval.
    pub fn proposal(&self) -> Option<Proposal> {
        match &self.state {
            ExperimentState::Proposed(open) => Some(self.first_proposal(open)),
            ExperimentState::BetweenRepeats(between) => self.repeat_proposal(between),
            _ => None,
        }
    }

    /// Returns the number of trials that count so far.
    pub fn counted(&self) -> u32 {
        self.rows.values().filter(|row| row.counts()).count() as u32
    }

    /// Returns the unit of the objective.
    pub fn unit(&self) -> &'static str {
        self.plan.control.unit(self.plan.task)
    }

    /// Returns the number of trials that are to count.
    pub fn budget(&self) -> u32 {
        self.plan.budget
    }

    /// Returns whether other workers run trials: until they end it is open whether the study is finished. An abandoned
    /// trial does not count.
    pub fn others_run(&self) -> bool {
        self.queue.others_run(&self.study)
    }

    /// Approves the proposal as it was seen: it becomes a running trial, on disk before this returns.
    /// Refused when there is another proposal by now or its values are outside the limits.
    pub fn approve(&mut self, trial: u32, revision: u32) -> Result<TrialSpec, RequestRefusal> {
        if matches!(self.state, ExperimentState::BetweenRepeats(_)) {
            return self.approve_repeat(trial, revision);
        }
        self.see_the_queue(trial, revision)?;
        let ExperimentState::Proposed(open) = &self.state else { return not_now("there is no proposal to approve") };
        open.must_be(trial, revision)?;
        if let Some(refusal) = self.refusal() {
            return not_now(format!("{refusal}; change it, or skip the proposal"));
        }
        let approved = open.approved();
        let number = self.begin(approved, None)?;
        self.enter(ExperimentState::Running(number), number);
        Ok(self.spec(number))
    }

    /// Refuses the proposal as it was seen: it becomes a void trial, which the sampler does not see.
    /// Refused when there is another proposal by now, or none.
    pub fn skip(&mut self, trial: u32, revision: u32) -> Result<(), RequestRefusal> {
        if let ExperimentState::BetweenRepeats(between) = &self.state {
            between.must_be(trial, revision)?;
            return self.give_up(trial);
        }
        self.see_the_queue(trial, revision)?;
        let ExperimentState::Proposed(open) = &self.state else { return not_now("there is no proposal to skip") };
        open.must_be(trial, revision)?;
        let cause = match self.refusal() {
            Some(refusal) => format!("{NOT_RUN}{refusal}"),
            None => SKIPPED.to_owned(),
        };
        let approved = open.approved();
        self.begin(approved, Some(cause))?;
        self.propose()?;
        Ok(())
    }

    /// Returns the wait of this experiment for the lock of its study.
    pub fn journal_wait(&self) -> JournalWait {
        self.study.journal_wait()
    }

    /// Voids a trial that was approved and not run, for `cause`, and queues its parameters again.
    pub fn withdraw(&mut self, trial: u32, cause: &str) -> Result<(), RequestRefusal> {
        if !matches!(self.state, ExperimentState::Running(running) if running == trial) {
            return Ok(());
        }
        let log = self.queue.close(&mut self.study, trial, cause)?;
        self.log_all(log);
        if let Some(row) = self.rows.get_mut(&trial) {
            row.verdict = Some(Verdict::Void);
            row.cause = cause.to_owned();
        }
        self.publish_row(trial);
        self.state = ExperimentState::Finished;
        Ok(self.propose()?)
    }

    /// Reports the pending verdict: the session ends.
    pub fn close(&mut self) -> Result<(), StudyError> {
        self.report_verdict().map(drop)
    }

    /// Returns the trial whose verdict can be taken back.
    pub fn undoable(&self) -> Option<u32> {
        self.pending_verdict.as_ref().map(|pending| pending.suggestion.trial)
    }

    fn is_idle(&self) -> bool {
        matches!(self.state, ExperimentState::Proposed(_) | ExperimentState::Finished)
    }

    fn enter(&mut self, state: ExperimentState, trial: u32) {
        self.state = state;
        self.publish_stage(trial);
    }

    fn publish_stage(&mut self, trial: u32) {
        let between = matches!(self.state, ExperimentState::BetweenRepeats(_));
        let (stage, can_undo) = (self.stage(), between || self.pending_verdict.is_some());
        let jumps = if stage == ExperimentStage::Running { self.spec(trial).jumps } else { 0 };
        self.outbox.push(Record::Stage(StageRecord { stage, trial, can_undo, jumps }));
    }

    fn publish_proposal(&mut self) {
        self.outbox.extend(self.proposal().map(Record::Proposal));
    }

    fn publish_row(&mut self, trial: u32) {
        self.outbox.extend(self.rows.get(&trial).cloned().map(Record::Trial));
    }

    /// Says something that the operator is to see.
    pub(crate) fn warn(&mut self, message: String) {
        self.log_at(LogLevel::Warning, message);
    }

    fn log(&mut self, message: String) {
        self.log_at(LogLevel::Info, message);
    }

    fn log_at(&mut self, level: LogLevel, message: String) {
        self.outbox.push(Record::Log(LogRecord { level, source: "study".to_owned(), message }));
    }

    fn log_all(&mut self, messages: Vec<String>) {
        for message in messages {
            self.log(message);
        }
    }
}

/// Whether a trial was measured and waits for the verdict of a person.
pub fn waits_for_verdict(trial: &Trial) -> bool {
    trial.state == TrialState::Running && TrialAttributes::of(trial).is_unjudged()
}

/// Whether a running trial is of the session in its study's folder, not of a worker that has joined the study or of another program.
pub fn is_of_folders_session(trial: &Trial) -> bool {
    attributes::worker_of(trial) == Some(0)
}

/// Returns the name of the sampler with which a stored study was made or continued last.
pub fn last_sampler(study: &Study) -> Option<String> {
    Some(study.attributes().get("sampler")?.get("kind")?.as_str()?.to_owned())
}

/// Returns how many trials each sampler has proposed and from which trial on, `12 by tpe (from trial 0), 8 by gp (from trial 12)`; none
/// where the last sampler has proposed all.
pub fn samplers_in_words(study: &Study) -> Option<String> {
    let mut samplers: Vec<(String, u32, u32)> = Vec::new();
    for trial in study.trials() {
        let Some(name) = TrialAttributes::of(trial).sampler else { continue };
        match samplers.iter_mut().find(|(known, ..)| *known == name) {
            Some((_, count, _)) => *count += 1,
            None => samplers.push((name, 1, trial.number)),
        }
    }
    let words = samplers.iter().map(|(name, count, first)| format!("{count} by {name} (from trial {first})"));
    let last = last_sampler(study);
    let others = samplers.iter().any(|(name, ..)| last.as_ref() != Some(name));
    others.then(|| words.collect::<Vec<_>>().join(", "))
}

/// Returns the trial table of a stored study: every trial but those that wait.
pub fn rows_of(study: &Study, order: &[ParameterInfo]) -> Vec<TrialRecord> {
    let begun = study.trials().iter().filter(|trial| trial.state != TrialState::Waiting);
    begun.map(|trial| attributes::row_of(trial, study.note_of(trial.number), order)).collect()
}

/// Adds finished trials of another study. Re-runs that are still to be queued there are not queued here.
pub fn import(study: &mut Study, trials: Vec<TableTrial>) -> Result<Vec<u32>, StudyError> {
    let trials: Vec<TableTrial> = trials
        .into_iter()
        .map(|trial| TableTrial { attributes: attributes::elsewhere(trial.attributes), ..trial })
        .collect();
    study.import(&trials)
}
