//! The session as its records have reported it.

use quadfrog::optimize::repeats::LEAST_REPEATS;
use quadfrog::recording::record::{ArmingCheckRecord, SessionInfo, StageRecord};
use quadfrog::session::objective;
use quadfrog::trial::{
    Approval, ExperimentStage, ObjectiveRule, Overrides, ParameterInfo, ParameterInsight, ParameterValues, PointRecord,
    Proposal, ProposalInsight, ProposedParameter, QueuedPoint, SearchStatus, SearchedParameter, SimulatorComparison,
    TrialRecord, Verdict,
};

use super::log::SessionLog;
use super::trials::Trials;

/// State of the session, from its records. A replay that jumps resets it whole.
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct SessionModel {
    pub info: SessionInfo,
    /// Stage of the present trial; none before the session has begun.
    pub stage: Option<StageRecord>,
    /// The newest proposal; its trial may run already.
    pub proposal: Option<Proposal>,
    /// Values that the operator has set in place of proposed ones in this session.
    pub overrides: Overrides,
    /// The newest arming checks; empty before the robot was disarmed for the first time.
    pub arming_checks: Vec<ArmingCheckRecord>,
    /// Time of the newest arming checks, ns since the engine started.
    pub arming_checked_ns: u64,
    /// Present bounds, fixed parameters and budget.
    pub search: Option<SearchStatus>,
    /// Densities and importances behind the sampler's newest proposal.
    pub insight: Option<ProposalInsight>,
    pub trials: Trials,
    pub log: SessionLog,
    /// The trial that was judged last, or a repeat of it: the one whose verdict the session takes back while it can.
    pub last_judged: Option<u32>,
    /// Whether the session has taken control of a real robot or calls a silent one: it may send commands.
    pub control_taken: bool,
    /// Cause of the newest DAMPED or FAULT.
    pub stopped_because: String,
    /// Cause for which the robot sat down without a request; empty once the operator has made one.
    pub sat_down_because: String,
}

impl SessionModel {
    /// The robot beside the simulated robots of the sampler's prior; none for a sampler without one.
    pub fn simulator(&self) -> Option<&SimulatorComparison> {
        self.insight.as_ref()?.simulator.as_ref()
    }

    pub(crate) fn stage_is(&self, stage: ExperimentStage) -> bool {
        self.stage.is_some_and(|info| info.stage == stage)
    }

    /// The trial of the present stage, if that is `stage`.
    pub fn trial_in(&self, stage: ExperimentStage) -> Option<u32> {
        self.stage.filter(|info| info.stage == stage).map(|info| info.trial)
    }

    /// The trial that waits for its verdict.
    pub fn under_review(&self) -> Option<&TrialRecord> {
        self.trials.records.get(&self.trial_in(ExperimentStage::Review)?)
    }

    /// The trial that waits for its verdict, if another one than accept is suggested.
    pub fn not_to_accept(&self) -> Option<&TrialRecord> {
        self.under_review().filter(|trial| trial.suggested.is_some_and(|verdict| verdict != Verdict::Accept))
    }

    /// The trial that waits for its verdict, if another one than fall is suggested.
    pub fn not_to_fall(&self) -> Option<&TrialRecord> {
        self.under_review().filter(|trial| trial.suggested.is_some_and(|verdict| verdict != Verdict::Fall))
    }

    /// The trial whose verdict can be taken back.
    pub fn undoable(&self) -> Option<u32> {
        self.last_judged.filter(|_| self.stage.is_some_and(|info| info.can_undo))
    }

    /// The proposal that waits for approval.
    pub fn open_proposal(&self) -> Option<&Proposal> {
        let trial = self.trial_in(ExperimentStage::Proposed)?;
        self.proposal.as_ref().filter(|proposal| proposal.trial == trial)
    }

    /// The value with which the trial of the sampler's reasons runs or ran in place of the one that the sampler has proposed.
    pub fn override_of(&self, sampled: &ParameterInsight) -> Option<f64> {
        let trial = self.insight.as_ref()?.trial;
        let open = self.open_proposal().filter(|proposal| proposal.trial == trial);
        let value = match open {
            Some(proposal) => proposal.parameters.iter().find(|p| p.name == sampled.name)?.value,
            None => self.trials.records.get(&trial)?.parameters.get(&sampled.name)?,
        };
        Some(value).filter(|value| *value != sampled.proposed)
    }

    /// The open proposal, or that of the running trial.
    pub fn shown_proposal(&self) -> Option<&Proposal> {
        let running = self.trial_in(ExperimentStage::Running);
        let runs = || self.proposal.as_ref().filter(|proposal| Some(proposal.trial) == running);
        self.open_proposal().or_else(runs)
    }

    /// The trial of the present stage for the header; when the study is finished, the last one that ran.
    pub fn shown_trial(&self) -> Option<u32> {
        let stage = self.stage?;
        let ran = self.trials.records.values().rev().find(|trial| !trial.was_not_run()).map(|trial| trial.trial);
        Some(ran.filter(|_| stage.stage == ExperimentStage::Finished).unwrap_or(stage.trial))
    }

    /// Most jumps in a row of the running trial; 0 while none runs.
    pub fn jumps_in_a_row(&self) -> u32 {
        self.stage.map_or(0, |info| info.jumps)
    }

    /// Whether a robot that stands jumps without an approval by the operator: on the simulator alone.
    pub fn jumps_without_question(&self) -> bool {
        self.info.approve != Approval::Each && !self.info.is_hardware()
    }

    /// The number of arming checks that forbid arming.
    pub fn failing_checks(&self) -> usize {
        self.arming_checks.iter().filter(|item| !item.state.allows()).count()
    }

    /// The letters that arm the robot, typed in order: on hardware several, against a single accidental press.
    pub fn arming_confirmation(&self) -> &'static str {
        if self.info.is_hardware() { "stand" } else { "y" }
    }

    /// The parameter of that name with its present bounds.
    pub fn parameter(&self, name: &str) -> Option<ParameterInfo> {
        let info = self.info.parameters.iter().find(|parameter| parameter.name == name)?;
        Some(match self.searched(name) {
            Some(searched) => ParameterInfo { low: searched.low, high: searched.high, ..info.clone() },
            None => info.clone(),
        })
    }

    /// The parameter of that row with its present bounds.
    pub fn present_parameter(&self, row: usize) -> Option<ParameterInfo> {
        self.parameter(&self.info.parameters.get(row)?.name)
    }

    /// The gain of that name with its allowed range.
    pub fn gain(&self, name: &str) -> Option<&ParameterInfo> {
        self.info.gains.iter().find(|gain| gain.name == name)
    }

    /// Returns the gains of the best trial that differ from the configured ones. Those that the study searches are parameters.
    pub fn changed_gains_of_best(&self) -> Vec<ProposedParameter> {
        let Some(best) = self.trials.best() else { return Vec::new() };
        let own = |(name, proposed): &(String, f64)| {
            Some(ProposedParameter { name: name.clone(), value: best.gains.get(name)?, proposed: *proposed })
        };
        let searched = |gain: &ProposedParameter| best.parameters.get(&gain.name).is_some();
        let configured = self.configured_gains();
        let gains = configured.iter().filter_map(own);
        gains.filter(|gain| gain.value != gain.proposed && !searched(gain)).collect()
    }

    /// Returns the gains of the session's configuration: in an older recording as the last proposal has them.
    pub fn configured_gains(&self) -> ParameterValues {
        if !self.info.configured_gains.is_empty() {
            return self.info.configured_gains.clone();
        }
        let gains = self.proposal.iter().flat_map(|proposal| &proposal.gains);
        gains.map(|gain| (gain.name.clone(), gain.proposed)).collect()
    }

    /// Returns the rows of the panel of the trial: its heading, parameters and gains, what is expected, the repeats.
    pub fn trial_rows(&self) -> u16 {
        let parameters = self.info.parameters.len().max(3) as u16;
        let changed = |proposal: &Proposal| proposal.changed_gains().count();
        let gains = match self.stage_is(ExperimentStage::Finished) {
            true => self.changed_gains_of_best().len(),
            false => self.open_proposal().map_or(0, changed),
        } as u16;
        // Repeats are shown while the best is being confirmed and when the study is finished.
        let confirming = self.confirming().is_some();
        let repeats = match confirming || self.stage_is(ExperimentStage::Finished) {
            true => self.trials.points.len().min(4) as u16 + u16::from(confirming),
            false => 0,
        };
        let expected = match self.under_review() {
            Some(trial) => u16::from(trial.expected.is_some()),
            None => self.open_proposal().and_then(|proposal| proposal.expected).map_or(0, |expected| {
                1 + u16::from(expected.simulated_least.is_some()) + 2 * u16::from(expected.advises_to_stop)
            }),
        };
        let model_best = u16::from(self.stage_is(ExperimentStage::Finished) && self.trials.model_best.is_some());
        let queued = u16::from(self.queued_beside() > 0);
        parameters + 4 + gains + repeats + expected + queued + model_best
    }

    /// The number of queued points without the proposal.
    pub fn queued_beside(&self) -> usize {
        let proposed = self.proposal.as_ref().map(|proposal| proposal.trial);
        self.queue().iter().filter(|point| Some(point.trial) != proposed).count()
    }

    /// Returns the queued points, the next one first.
    pub fn queue(&self) -> &[QueuedPoint] {
        self.search.as_ref().map_or(&[], |search| &search.queue)
    }

    /// Returns the row of the queue with a selected trial; of one that has left the queue the row of the next one.
    pub fn queue_row(&self, selected: Option<u32>) -> usize {
        let queue = self.queue();
        let selected = selected.unwrap_or(0);
        queue.iter().position(|point| point.trial >= selected).unwrap_or(queue.len().saturating_sub(1))
    }

    /// Whether a trial is in the queue.
    pub fn is_queued(&self, trial: u32) -> bool {
        self.queue().iter().any(|point| point.trial == trial)
    }

    /// A parameter with the range that panels over it show: the study's own bounds, so that past trials stay where they were when
    /// the search is narrowed, as far as the present bounds, a trial or the proposal do not lie outside of them.
    pub fn with_shown_range(&self, info: &ParameterInfo) -> ParameterInfo {
        let searched = self.searched(&info.name).into_iter().flat_map(|searched| [searched.low, searched.high]);
        let ran = self.trials.records.values().filter_map(|trial| trial.parameters.get(&info.name));
        let proposed = self.open_proposal().and_then(|p| p.parameters.iter().find(|p| p.name == info.name));
        let values = searched.chain(ran).chain(proposed.map(|proposed| proposed.value));
        let (low, high) = values.fold((info.low, info.high), |(low, high), value| (low.min(value), high.max(value)));
        ParameterInfo { low, high, ..info.clone() }
    }

    /// The parameter of that name as the search treats it at present.
    pub fn searched(&self, name: &str) -> Option<&SearchedParameter> {
        self.search.as_ref()?.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// Repeats left to confirm the best; none while nothing is being confirmed.
    pub fn confirming(&self) -> Option<u32> {
        self.search.as_ref()?.confirming
    }

    /// The number of trials that count for the budget.
    pub fn counted(&self) -> usize {
        match &self.search {
            Some(search) => search.counted as usize,
            None => self.trials.records.values().filter(|row| row.counts()).count(),
        }
    }

    /// Whether another verdict of a trial lets a finished study run one more.
    pub fn makes_room(&self, trial: u32, verdict: Verdict) -> bool {
        let counts = self.trials.records.get(&trial).is_some_and(TrialRecord::counts);
        let full = self.counted() == self.budget() as usize;
        self.stage_is(ExperimentStage::Finished) && verdict == Verdict::Void && counts && full
    }

    /// The leading point of a confirmation of the best: with its confidence while it runs, afterwards without one, too.
    pub fn leading_point(&self) -> Option<&PointRecord> {
        let points = &self.trials.points;
        let contenders = || points.iter().filter(|point| point.contender).rev();
        points.iter().find(|point| point.confidence.is_some()).or_else(|| {
            let ended = self.confirming().is_none();
            // The earliest of equals.
            contenders().filter(|_| ended).max_by(|a, b| a.mean.total_cmp(&b.mean))
        })
    }

    /// Result of the confirmation of the best; none while it runs and without one.
    pub fn confirmation(&self) -> Option<String> {
        let point = self.leading_point().filter(|_| self.confirming().is_none())?;
        let spread = point.deviation.map(|deviation| format!(" +- {deviation:.3}")).unwrap_or_default();
        // The deviation of equal values is that of the rounding of their mean.
        let is_known_equal = |point: &PointRecord| {
            point.trials.len() >= LEAST_REPEATS && point.deviation.is_some_and(|deviation| deviation < 1e-9)
        };
        let sure = match point.confidence {
            Some(confidence) => format!("with {:.1} % confidence", 100.0 * confidence),
            None if self.trials.points.iter().filter(|point| point.contender).all(is_known_equal) => {
                "without a confidence, because equal jumps give equal values here".to_owned()
            }
            None => "without a confidence".to_owned(),
        };
        let unit = &self.info.unit;
        let (first, mean, stood, of) = (point.trials.first()?, point.mean, point.without_fall, point.trials.len());
        let lead =
            format!("the point of trial {first} leads {sure}: mean {mean:.3}{spread} {unit}, stood {stood} of {of}");
        let is_compared =
            |trial: u32| self.trials.points.iter().any(|point| point.contender && point.trials.contains(&trial));
        let other = self.trials.best_so_far().last().filter(|best| !is_compared(best.trial));
        let other = other.and_then(|best| best.value.map(|value| (best.trial, value)));
        match other.filter(|(_, value)| *value > mean) {
            Some((trial, value)) => Some(format!("{lead}; trial {trial}, not compared, is higher: {value:.3} {unit}")),
            None => Some(lead),
        }
    }

    /// The trial that is proposed before any has jumped, in words.
    pub fn no_trial_yet(&self) -> String {
        match self.open_proposal() {
            Some(proposal) => format!("trial #{} has not jumped yet", proposal.trial),
            None => "there is no trial yet".to_owned(),
        }
    }

    pub(crate) fn budget(&self) -> u32 {
        self.search.as_ref().map_or(self.info.budget, |search| search.budget)
    }

    /// The value that a trial reports if it is accepted: by hand, or else as measured; none without either.
    pub fn value_if_accepted(&self, trial: &TrialRecord) -> Option<f64> {
        trial.hand_value.or_else(|| self.measured_objective(trial))
    }

    /// The measured objective of a trial, before any verdict.
    pub fn measured_objective(&self, trial: &TrialRecord) -> Option<f64> {
        let measured = trial.measured.as_ref()?;
        // A recording of an older version holds the displacement alone.
        let of_one_jump = || Some(objective::value(&ObjectiveRule::single(self.info.task?), measured));
        measured.measured_value.or_else(of_one_jump)
    }

    /// The measured objective of the trial with that number, before any verdict.
    pub fn measured_objective_of(&self, trial: u32) -> Option<f64> {
        self.measured_objective(self.trials.records.get(&trial)?)
    }
}
