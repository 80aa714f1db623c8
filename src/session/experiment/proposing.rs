//! What comes next: the draft on the table, and how it becomes a running trial.

use super::attributes::{self, Began, Origin};
use super::card::Card;
use super::confirming::Next;
use super::searching::Searched;
use super::wishes::must_be_within;
use super::{gains, not_now, recovery};
use crate::optimize::insight;
use crate::optimize::sampler::SamplerKind;
use crate::optimize::study::{Study, StudyError, Told};
use crate::optimize::trial::Trial;
use crate::recording::record::Record;
use crate::session::experiment::{Experiment, RequestRefusal};
use crate::telemetry::TrialSpec;
use crate::trial::{
    ExperimentStage, JumpParameters, ParameterInfo, ParameterInsight, ProposalInsight, ProposalSource,
    ProposedParameter, TrialRecord,
};

/// Values at which the densities are shown: a chart of the terminal is hardly wider.
const INSIGHT_POINTS: usize = 41;

impl Experiment {
    /// Puts the next card on the table, or finishes.
    pub(super) fn propose(&mut self) -> Result<(), StudyError> {
        self.study.refresh()?;
        self.close_abandoned()?;
        self.take_rows();
        self.searched = Searched::of(&self.study, &self.plan);
        self.searched.apply(&self.plan, &mut self.study)?;
        self.confirmed = None;
        let mut outlook = self.outlook()?;
        if outlook.waiting().next().is_none() {
            match self.next_repeat(&outlook) {
                Next::Repeat(first) => {
                    outlook.enqueue(&first.parameters, &Origin::confirming(&first).attributes())?;
                }
                Next::Over(confirmed, words) => {
                    self.log(words);
                    self.confirmed = Some(confirmed);
                }
                Next::Nothing => {}
            }
        }
        if self.pending.is_none() {
            self.write_confirmed()?;
        }
        self.show_points(&outlook);
        let confirms =
            outlook.waiting().next().is_some_and(|trial| attributes::source_of(trial) == ProposalSource::Confirm);
        if !confirms && recovery::occupied(outlook.trials(), &self.watch) >= self.plan.budget {
            self.show_search(&outlook);
            self.card = None;
            let last = self.rows.keys().next_back().copied().unwrap_or(0);
            self.enter(ExperimentStage::Finished, last);
            return Ok(());
        }
        self.revisions += 1;
        let fixed: Vec<_> =
            self.searched.fixed(outlook.trials()).into_iter().map(|(n, fixed)| (n, fixed.value)).collect();
        self.show_search(&outlook);
        let in_study = self.study.waiting().next().is_some();
        let card = Card::new(outlook, in_study, &fixed, &self.plan.control.gains(), self.revisions);
        self.show_insight(&card);
        let number = card.number();
        self.card = Some(card);
        self.show_card();
        self.enter(ExperimentStage::Proposed, number);
        if let Some(objection) = self.objection() {
            self.log(format!("trial {number} cannot run as it was queued: {objection}"));
        }
        Ok(())
    }

    /// Why the card cannot run, whoever chose its values: other programs queue what they like, and bounds may have become
    /// narrower since. None if it can.
    pub fn objection(&self) -> Option<String> {
        let proposal = self.proposal()?;
        let beyond = |list: &[ProposedParameter], ranges: &[ParameterInfo], what| {
            list.iter().find_map(|p| must_be_within(ranges, what, &p.name, p.value).err())
        };
        beyond(&proposal.parameters, &self.plan.widest, "parameter")
            .or_else(|| beyond(&proposal.gains, &self.plan.gains, "gain"))
            .map(|refusal| refusal.to_string())
    }

    /// Proposes anew because the search has changed; what the operator had set on the card stays, where it still may.
    pub(super) fn repropose(&mut self) -> Result<(), StudyError> {
        let before = self.card.take();
        self.propose()?;
        let bounds = self.searched.parameters(&self.plan);
        let within =
            |name: &str, value: f64| bounds.iter().any(|p| p.name == name && value >= p.low && value <= p.high);
        if let (Some(card), Some(before)) = (&mut self.card, before.filter(Card::is_changed)) {
            self.revisions += 1;
            card.revision = self.revisions;
            card.inherit(&before, within);
            self.show_card();
        }
        Ok(())
    }

    /// The study as it will be when the next trial begins: what can still be undone is told in it.
    pub(super) fn outlook(&self) -> Result<Study, StudyError> {
        let mut fork = self.study.fork();
        if let Some(pending) = &self.pending {
            fork.tell(pending.suggestion.trial, pending.outcome)?;
            if pending.rerun {
                let (parameters, origin) = self.rerun_of(pending.suggestion.trial)?;
                fork.enqueue(&parameters, &origin.attributes())?;
            }
        }
        Ok(fork)
    }

    /// The card becomes a running trial of the study.
    pub(super) fn begin(&mut self) -> Result<u32, RequestRefusal> {
        let Some(card) = &self.card else { unreachable!("callers have looked at the card") };
        let proposal = card.proposal();
        let origin = card.origin();
        let (overrides, held, mut draft) = (card.overrides(), card.held(), card.draft.clone());
        let in_outlook_alone = card.in_outlook_alone;
        let mut queued = self.tell_pending()?;
        if in_outlook_alone {
            // Queued in the outlook alone so far: now in the study, where another program may have taken its number.
            if queued.is_none() {
                let given: Vec<_> = draft.parameters.iter().map(|p| (p.name.clone(), p.value)).collect();
                queued = self.queue_repeat(&given, &origin.attributes())?;
                if queued.is_none() {
                    self.propose()?;
                    return Err(RequestRefusal::Overtaken(draft.number));
                }
            }
            if let Some(number) = queued {
                draft = self.study.redirected(&draft, number)?;
            }
        }
        let seed = origin.seed.unwrap_or_else(|| trial_seed(self.plan.seed, self.plan.worker, draft.number));
        let began = Began { seed, worker: self.plan.worker, recording: &self.plan.recording, fixed: &held };
        let attributes = attributes::began(&proposal, &began);
        let beyond_budget = proposal.source == ProposalSource::Confirm || origin.source == ProposalSource::Confirm;
        let watch = &self.watch;
        let budget = self.plan.budget;
        let room = |trials: &[Trial]| beyond_budget || recovery::occupied(trials, watch) < budget;
        let number = match self.study.begin_if(&draft, &overrides, &attributes, room) {
            Ok(number) => number,
            Err(StudyError::StaleDraft { .. } | StudyError::Full) => {
                self.propose()?;
                return Err(RequestRefusal::Overtaken(draft.number));
            }
            Err(error) => return Err(error.into()),
        };
        self.card = None;
        let gains: Vec<_> = proposal.gains.iter().map(|gain| (gain.name.clone(), gain.value)).collect();
        let foreign = gains::difference(&gains, &self.plan.control.gains());
        let note = if foreign.is_empty() { String::new() } else { format!("other gains: {foreign}") };
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
            note,
            risk: proposal.risk,
            gains,
        };
        if !row.note.is_empty() {
            // The sampler learns from it like from any other; whoever reads the table must see that it was another robot.
            self.study.note(number, &row.note)?;
        }
        self.rows.insert(number, row);
        self.show_row(number);
        Ok(number)
    }

    /// Tells the verdict that could be undone until now; the number of the re-run that it asked for, if it did.
    pub(super) fn tell_pending(&mut self) -> Result<Option<u32>, StudyError> {
        let Some(pending) = self.pending.clone() else {
            self.write_confirmed()?;
            return Ok(None);
        };
        let trial = pending.suggestion.trial;
        if self.study.tell(trial, pending.outcome)? == Told::AlreadyFinished {
            // It is read again with the next proposal.
            self.log(format!("trial {trial} was ended by somebody else meanwhile: what they say stands"));
            self.rows.remove(&trial);
        }
        let mut queued = None;
        if pending.rerun {
            let (parameters, origin) = self.rerun_of(trial)?;
            queued = self.queue_again(trial, &parameters, &origin)?;
        }
        // Only now: what could not be written is still to be told.
        self.pending = None;
        self.write_confirmed()?;
        Ok(queued)
    }

    pub(super) fn rerun_of(&self, trial: u32) -> Result<(Vec<(String, f64)>, Origin), StudyError> {
        let trial = self.study.trial(trial)?;
        let row = attributes::row_of(trial, String::new(), &self.plan.parameters);
        Ok((trial.parameters.clone(), Origin::rerun_of(&row)))
    }

    /// Queues a point, and proposes what is next then.
    pub(super) fn queue(&mut self, parameters: &[(String, f64)], origin: &Origin) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        self.study.enqueue(parameters, &origin.attributes())?;
        Ok(self.propose()?)
    }

    /// Whether no trial runs or is under review.
    pub(super) fn is_idle(&self) -> bool {
        matches!(self.stage, ExperimentStage::Proposed | ExperimentStage::Finished)
    }

    pub(super) fn must_be_idle(&self) -> Result<(), RequestRefusal> {
        if self.is_idle() { Ok(()) } else { not_now("finish the present trial first") }
    }

    pub(super) fn show_search(&mut self, outlook: &Study) {
        let confirming = self.repeats_left(outlook);
        let search = self.searched.record(&self.plan, self.counted(), outlook.trials(), confirming);
        if self.said.search.as_ref() != Some(&search) {
            self.said.search = Some(search.clone());
            self.outbox.push(Record::Search(search));
        }
    }

    /// Why the card says what it says.
    fn show_insight(&mut self, card: &Card) {
        let study = card.outlook();
        let (trials, options) = (study.trials(), study.options());
        let densities = match options.sampler.kind {
            SamplerKind::Tpe => {
                insight::densities(&options.sampler, trials, &options.space, options.direction, INSIGHT_POINTS)
            }
            _ => Vec::new(),
        };
        let importances = insight::importances(trials, &options.space, options.direction);
        let parameter = |(name, proposed): (String, f64)| {
            let density = densities.iter().find(|density| density.name == name);
            ParameterInsight {
                proposed,
                importance: importances.iter().find(|(n, _)| *n == name).map(|(_, share)| *share),
                at: density.map(|density| density.at.clone()).unwrap_or_default(),
                good: density.map(|density| density.good.clone()).unwrap_or_default(),
                bad: density.map(|density| density.bad.clone()).unwrap_or_default(),
                name,
            }
        };
        let parameters = card.draft.parameters.iter().map(|p| (p.name.clone(), p.value)).map(parameter).collect();
        self.outbox.push(Record::Insight(ProposalInsight { trial: card.number(), parameters }));
    }

    /// What the control thread is given for the trial `number`.
    pub(super) fn spec(&self, number: u32) -> TrialSpec {
        let row = &self.rows[&number];
        let control = &self.plan.control;
        let value = |name: &str| row.parameters.iter().find(|(n, _)| n == name).map_or(0.0, |(_, value)| *value);
        let has_f1 = self.plan.parameters.iter().any(|parameter| parameter.name == "f1");
        let seed = self.study.trials().iter().find(|trial| trial.number == number).and_then(attributes::seed_of);
        let jump = JumpParameters {
            f0_hz: value("f0"),
            f1_hz: if has_f1 { value("f1") } else { control.f1_hz },
            fx_n: value("Fx"),
            fy_n: value("Fy"),
            fz_n: value("Fz"),
        };
        TrialSpec {
            trial: number,
            gains: gains::of_list(&row.gains, &control.gains()),
            seed: seed.unwrap_or_else(|| trial_seed(self.plan.seed, self.plan.worker, number)),
            ..control.trial(self.plan.task, jump)
        }
    }
}

/// The seed of one trial's noise and terrain: the study's seed, the worker and the number, mixed (SplitMix64 finalizer,
/// Steele et al. 2014). No two trials of a study have the same unless one repeats the other.
fn trial_seed(study: u64, worker: u32, trial: u32) -> u64 {
    let place = (u64::from(worker) << 32) + u64::from(trial) + 1;
    let mut z = study.wrapping_add(place.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
