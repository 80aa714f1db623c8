//! The next proposal, and its start as a running trial.

use std::collections::BTreeMap;

use serde_json::Value;

use super::attributes::{self, BeganAttributes, JudgedAttributes, Origin};
use super::confirmation::{self, NextRepeat};
use super::envelope;
use super::judging::value_of;
use super::open_proposal::{ApprovedProposal, OpenProposal, WaitsIn, model_insight};
use super::plan::{RequestRefusal, not_now};
use super::queue_changes::queued_points;
use super::search::SearchSettings;
use super::trial_changes::must_be_within;
use super::{Experiment, ExperimentState, queue};
use crate::optimize::study::{Study, StudyError, TellOutcome};
use crate::optimize::trial::{Trial, TrialState};
use crate::recording::record::Record;
use crate::telemetry::TrialSpec;
use crate::trial::{
    JumpParameters, ParameterInfo, ParameterValues, ProposalInsight, ProposalSource, ProposedParameter, SearchStatus,
    TrialRecord, Verdict, other_gains,
};

impl Experiment {
    /// Makes the next proposal, or finishes. What the operator has changed in an earlier draft of the same trial stays where it is
    /// within the bounds.
    pub fn propose(&mut self) -> Result<(), StudyError> {
        self.read_study()?;
        if self.plan.needs_prior {
            self.enter(ExperimentState::AwaitsPrior, self.study.trials().len() as u32);
            return Ok(());
        }
        let mut study = self.study_with_verdict()?;
        // A point that was queued runs before a repeat, but does not delay the result of the last one.
        let waits = study.waiting().next().is_some();
        let mut waits_in = if self.next_in_study().is_some() { WaitsIn::Study } else { WaitsIn::Verdict };
        if !study.waiting().any(attributes::confirms) {
            match self.confirmation.next(&study) {
                NextRepeat::Repeat(first) if !waits => {
                    study.enqueue(&first.parameters, &Origin::confirming(&first).attributes())?;
                    waits_in = WaitsIn::Confirmation;
                }
                NextRepeat::Over(conclusion, message) => {
                    if self.confirmation.conclude(conclusion) {
                        self.log(message.clone());
                        self.concluded = Some(message);
                    }
                }
                NextRepeat::Repeat(_) | NextRepeat::None => {}
            }
        }
        if self.pending_verdict.is_none() {
            self.confirmation.write_conclusion(&mut self.study)?;
        }
        let model = study.predict();
        self.model_best = model.best;
        self.hop_share = envelope::share(&self.plan, study.trials());
        self.draw_inside_envelope(&mut study);
        self.outbox.extend(self.confirmation.changed_points(&study).map(Record::Points));
        self.publish_search(&study);
        let confirms = study.waiting().next().is_some_and(attributes::confirms);
        if !confirms && self.queue.occupied(study.trials()) >= self.plan.budget {
            let last = self.rows.keys().next_back().copied().unwrap_or(0);
            self.outbox.push(Record::Insight(ProposalInsight { trial: last, ..model_insight(&model) }));
            self.enter(ExperimentState::Finished, last);
            return Ok(());
        }
        let fixed: Vec<_> = self.search.fixed(study.trials()).into_iter().map(|(n, fixed)| (n, fixed.value)).collect();
        let revision = self.next_revision();
        let mut open = OpenProposal::new(study, waits_in, &fixed, &self.plan.control.gains(), revision);
        self.restore_changes(&mut open)?;
        let number = open.number();
        if open.lacks_prior() {
            let message = format!("trial {number} is proposed as by gp: the model of sim cannot be fitted");
            self.warn(message);
        }
        self.outbox.push(Record::Insight(open.insight(&model)));
        self.outbox.push(Record::Proposal(self.first_proposal(&open)));
        let (returns, changed) = (!matches!(self.state, ExperimentState::Proposed(_)), open.is_changed());
        self.enter(ExperimentState::Proposed(Box::new(open)), number);
        if returns && changed {
            self.log(format!("kept from before: {}", self.overrides_in_words()));
        }
        if let Some(ignored) = self.study.trial(number).ok().and_then(|trial| self.given_without_number(trial)) {
            self.warn(format!(
                "trial {number} was queued with {ignored}, which is no finite number: the sampler proposes it"
            ));
        }
        if let Some(refusal) = self.refusal() {
            self.log(format!("trial {number} cannot run as it was queued: {refusal}"));
        }
        Ok(())
    }

    /// Returns the values of a waiting trial that are no finite numbers, in words; none without one.
    fn given_without_number(&self, trial: &Trial) -> Option<String> {
        let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let given: BTreeMap<&str, &Value> = trial.given_without_number().collect();
        let names = self.plan.parameters.iter().map(|parameter| parameter.name.as_str());
        let words = names.filter_map(|name| Some(format!("{name} = {}", text(given.get(name)?))));
        let words: Vec<String> = words.collect();
        (trial.state == TrialState::Waiting && !words.is_empty()).then(|| words.join(", "))
    }

    /// Has `study` draw its points where the next trial may jump.
    pub(super) fn draw_inside_envelope(&self, study: &mut Study) {
        let inside = self.hop_share.and_then(|share| envelope::inside(&study.options().space, &self.plan, share));
        if let Some(inside) = inside {
            study.draw_inside(inside);
        }
    }

    /// Reads the trials and the search of the study.
    fn read_study(&mut self) -> Result<(), StudyError> {
        self.study.refresh()?;
        let log = self.queue.close_abandoned(&mut self.study)?;
        self.log_all(log);
        self.take_rows();
        self.search = SearchSettings::of(&self.study, &self.plan);
        self.search.apply(&self.plan, &mut self.study)?;
        self.confirmation.reopen();
        Ok(())
    }

    /// Puts a trial under review that an earlier session has measured and left without a verdict.
    pub(super) fn review_again(&mut self, trial: u32) -> Result<(), StudyError> {
        self.read_study()?;
        if let Some(row) = self.rows.get_mut(&trial) {
            row.value = row.suggested.and_then(|suggested| value_of(row, suggested, &self.plan));
        }
        self.publish_row(trial);
        self.outbox.extend(self.confirmation.changed_points(&self.study).map(Record::Points));
        self.enter(ExperimentState::Review(trial), trial);
        // Without its prior the sampler knows nothing to show.
        match self.plan.needs_prior {
            true => self.publish_search(&self.study.fork()),
            false => self.publish_model(trial),
        }
        let message = format!(
            "trial {trial} had no verdict at the end of the last session: it was measured, its jump is in that session's recording"
        );
        self.warn(message);
        Ok(())
    }

    /// Returns the reason for which the proposal cannot run, or none. Other programs may queue any values, and bounds may have
    /// become narrower since; a re-run is held to the present ones.
    pub fn refusal(&self) -> Option<String> {
        let proposal = self.proposal()?;
        let beyond = |list: &[ProposedParameter], ranges: &[ParameterInfo], what| {
            list.iter().find_map(|p| must_be_within(ranges, what, &p.name, p.value).err())
        };
        beyond(&proposal.parameters, &self.plan.widest, "parameter")
            .or_else(|| beyond(&proposal.gains, &self.plan.gains, "gain"))
            .or_else(|| {
                let rerun = proposal.source == ProposalSource::Rerun;
                rerun.then(|| beyond(&proposal.parameters, &self.search.parameters(&self.plan), "parameter"))?
            })
            .or_else(|| {
                let inside =
                    |p: &ProposedParameter| envelope::must_be_inside(&self.plan, self.hop_share, &p.name, p.value);
                proposal.parameters.iter().find_map(|p| inside(p).err())
            })
            .map(|refusal| refusal.to_string())
    }

    /// Returns the study at the time at which the next trial begins: the pending verdict is reported in it.
    pub fn study_with_verdict(&self) -> Result<Study, StudyError> {
        let mut fork = self.study.fork();
        if let Some(verdict) = &self.pending_verdict {
            let trial = verdict.suggestion.trial;
            fork.tell(trial, verdict.outcome)?;
            if let Some(first_after) = verdict.rerun {
                let (parameters, origin) = queue::rerun_of(self.study.trial(trial)?);
                let rerun = fork.enqueue(&parameters, &origin.attributes())?;
                queue::move_ahead(&mut fork, rerun, first_after)?;
            }
        }
        Ok(fork)
    }

    /// Makes the approved proposal a running trial of the study; with a cause in `skipped` one that has ended void, in the same
    /// commit. Returns its number.
    pub fn begin(&mut self, approved: ApprovedProposal, skipped: Option<String>) -> Result<u32, RequestRefusal> {
        let beyond_budget = approved.is_beyond_budget();
        let ApprovedProposal { proposal, origin, mut draft, overrides, fixed, waits_in } = approved;
        let mut queued = self.report_verdict()?;
        if draft.enqueued && waits_in != WaitsIn::Study {
            // The study does not have the queued trial yet, and another program may have taken its number.
            if queued.is_none() && waits_in == WaitsIn::Confirmation {
                queued = confirmation::queue_repeat(&mut self.study, &draft.point(), &origin.attributes())?;
            }
            let Some(number) = queued else {
                self.propose()?;
                return Err(RequestRefusal::Overtaken(draft.number));
            };
            draft = self.study.redirected(&draft, number)?;
        }
        let seed = origin.seed().unwrap_or_else(|| self.trial_seed(draft.number));
        let sampler = (!draft.enqueued).then_some(self.study.options().sampler.kind);
        let began = BeganAttributes::new(&proposal, seed, origin.repeats.clone(), &self.plan, fixed, sampler);
        let (queue, budget) = (&self.queue, self.plan.budget);
        let room = |trials: &[Trial]| beyond_budget || queue.occupied(trials) < budget;
        let verdict = skipped.is_some().then_some(Verdict::Void);
        let judged = TrialRecord { verdict, cause: skipped.unwrap_or_default(), ..TrialRecord::default() };
        let mut attributes = attributes::write(&began);
        let state = match verdict {
            Some(_) => {
                attributes.extend(attributes::write(&JudgedAttributes::of(&judged, false)));
                TrialState::Fail
            }
            None => TrialState::Running,
        };
        let begun = self.study.begin_if(&draft, &overrides, &attributes, state, &room);
        let number = match begun {
            Ok(number) => number,
            Err(StudyError::StaleDraft { .. } | StudyError::Full) => {
                self.propose()?;
                return Err(RequestRefusal::Overtaken(draft.number));
            }
            Err(error) => return Err(error.into()),
        };
        let gains: ParameterValues = proposal.gains.iter().map(|gain| (gain.name.clone(), gain.value)).collect();
        let row = TrialRecord {
            trial: number,
            source: proposal.source,
            parent: proposal.parent,
            parameters: proposal.parameters.iter().map(|p| (p.name.clone(), p.value)).collect(),
            note: other_gains(&gains, ("configured", &self.plan.control.gains().values()), |name| {
                self.plan.optimizes(name)
            }),
            risk: proposal.risk,
            expected: proposal.expected,
            gains,
            repeats: origin.repeats,
            seed: Some(seed),
            ranges: self.study.trial(number).map(attributes::ranges_of).unwrap_or_default(),
            proposed: proposal.replaced(),
            ..judged
        };
        if !row.note.is_empty() {
            // The sampler learns from this trial like from any other; the note shows that the controller differed.
            // Without it the trial has begun all the same: it must run.
            if let Err(error) = self.study.note(number, &row.note) {
                self.log(format!("the note of trial {number} could not be written: {error}"));
            }
        }
        self.rows.insert(number, row);
        self.publish_row(number);
        Ok(number)
    }

    /// Reports the pending verdict to the study. Returns the number of the re-run that was asked for with it.
    pub fn report_verdict(&mut self) -> Result<Option<u32>, StudyError> {
        let mut queued = None;
        if let Some(verdict) = self.pending_verdict.clone() {
            let trial = verdict.suggestion.trial;
            if self.study.tell(trial, verdict.outcome)? == TellOutcome::AlreadyFinished {
                // The row is read again with the next proposal.
                self.log(RequestRefusal::EndedElsewhere(trial).to_string());
                self.rows.remove(&trial);
            }
            if let Some(first_after) = verdict.rerun {
                let (parameters, origin) = queue::rerun_of(self.study.trial(trial)?);
                let rerun = queue::queue_again(&mut self.study, trial, &parameters, &origin)?;
                queued = rerun.map(|rerun| queue::move_ahead(&mut self.study, rerun, first_after)).transpose()?;
            }
            // Only now: after an error above it is still to be reported.
            self.pending_verdict = None;
        }
        self.store_model_best()?;
        self.confirmation.write_conclusion(&mut self.study)?;
        Ok(queued)
    }

    /// Stores the best trial by the sampler's model for the readers of the study, who count a verdict that can still be taken back.
    pub(super) fn store_model_best(&mut self) -> Result<(), StudyError> {
        self.model_best.map_or(Ok(()), |best| self.study.store_best(best))
    }

    /// Refuses while a trial runs or is under review.
    pub fn must_be_idle(&self) -> Result<(), RequestRefusal> {
        if matches!(self.state, ExperimentState::AwaitsPrior) {
            return not_now("the sampler has no prior yet; wait until its robots are simulated");
        }
        if self.is_idle() { Ok(()) } else { not_now("finish the present trial first") }
    }

    /// Publishes the search if it has changed.
    pub fn publish_search(&mut self, study: &Study) {
        let confirming = self.confirmation.repeats_left(study);
        let search = SearchStatus {
            hop_share: self.hop_share,
            queue: queued_points(study),
            ..self.search.status(&self.plan, self.counted(), study.trials(), confirming)
        };
        if self.published_search.as_ref() != Some(&search) {
            self.published_search = Some(search.clone());
            self.outbox.push(Record::Search(search));
        }
    }

    /// Publishes search, points and the model's predictions without a verdict that was taken back; `trial` waits for another.
    pub fn publish_model(&mut self, trial: u32) {
        let study = self.study.fork();
        let model = study.predict();
        self.model_best = model.best;
        self.hop_share = envelope::share(&self.plan, study.trials());
        self.outbox.extend(self.confirmation.changed_points(&study).map(Record::Points));
        self.publish_search(&study);
        self.outbox.push(Record::Insight(ProposalInsight { trial, ..model_insight(&model) }));
    }

    /// Returns a revision that no proposal had.
    pub fn next_revision(&mut self) -> u32 {
        self.revisions += 1;
        self.revisions
    }

    /// Returns the seed of the noise and terrain of new trial `number`. Repetitions of interrupted trials, which run with the
    /// seeds of those, are not counted: an interrupted and an unbroken study run the same trials with the same seeds.
    fn trial_seed(&self, number: u32) -> u64 {
        let trials = self.study.trials();
        let seed_of = |number: u32| trials.get(number as usize).and_then(|trial| Origin::of_trial(trial).seed());
        let repeats = |trial: &&Trial| {
            let origin = Origin::of_trial(trial);
            origin.seed().is_some() && origin.seed() == origin.parent.and_then(seed_of)
        };
        let repeated = trials.iter().take(number as usize).filter(repeats).count() as u32;
        trial_seed(self.plan.seed, self.plan.worker, number - repeated)
    }

    /// Returns the command data of the trial `number` for the control thread.
    pub fn spec(&self, number: u32) -> TrialSpec {
        let row = &self.rows[&number];
        let control = &self.plan.control;
        let seed = self.study.trial(number).ok().and_then(|trial| Origin::of_trial(trial).seed());
        let seed = seed.unwrap_or_else(|| self.trial_seed(number));
        TrialSpec {
            trial: number,
            gains: control.gains().with(&row.gains).with(&row.parameters),
            seed: repeat_seed(seed, row.repeats.len() as u64),
            ..control.trial(self.plan.task, JumpParameters::from_values(&row.parameters, control.f1_hz))
        }
    }
}

/// Returns the seed of one trial's noise and terrain: the study's seed, the worker and the trial's place in the order of
/// proposals, mixed. No two trials of a study have the same unless one repeats the
/// other.
fn trial_seed(study: u64, worker: u32, trial: u32) -> u64 {
    mixed(study, (u64::from(worker) << 32) + u64::from(trial) + 1)
}

/// Returns the seed of the rollout of a trial that begins next or runs; none for a trial of another program.
pub fn next_seed(row: &TrialRecord) -> Option<u64> {
    Some(repeat_seed(row.seed?, row.repeats.len() as u64))
}

/// Returns the seed of a trial's rollout after `before` judged ones, void ones included: that of the trial for the first.
fn repeat_seed(trial: u64, before: u64) -> u64 {
    if before == 0 { trial } else { mixed(trial, before) }
}

/// SplitMix64 (Steele et al. 2014): output number `place` of the generator with this seed.
fn mixed(seed: u64, place: u64) -> u64 {
    let mut z = seed.wrapping_add(place.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
