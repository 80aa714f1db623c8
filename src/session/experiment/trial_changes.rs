//! Changes of the proposal, the search and the queue by the operator. Each request is checked; a refusal names the limit.
//! Nothing runs before it is approved.

use std::collections::BTreeMap;

use super::attributes::{self, Origin};
use super::changes::Changes;
use super::plan::{RequestRefusal, not_now};
use super::queue_changes::queued_points;
use super::study_attributes::BudgetAttribute;
use super::{Experiment, ExperimentState, confirmation, envelope};
use crate::trial::{FixedParameter, ParameterInfo, ParameterValues, ProposalSource, QueuedPoint, six_digits};

/// A point that the operator has queued.
#[derive(Debug, Clone, PartialEq)]
pub struct EnqueuedPoint {
    /// The trial of the same point that waits already, if there is one: two are run all the same.
    pub same: Option<u32>,
    /// Number of the point if it is the open proposal now, in place of the sampler's.
    pub proposed: Option<u32>,
    /// Parameters that are fixed for the sampler at another value, with that value.
    pub not_fixed: Vec<(String, f64)>,
}

impl Experiment {
    /// Sets one parameter of the proposal.
    /// Refused when there is no proposal, no such parameter, or the value is outside its bounds.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), RequestRefusal> {
        self.open_proposal()?;
        must_be_within(&self.search.parameters(&self.plan), "parameter", name, value)?;
        envelope::must_be_inside(&self.plan, self.hop_share, name, value)?;
        let changes = self.open_proposal()?.with_parameter(name, value);
        self.change_open(changes)
    }

    /// Sets one of the controller's gains for the proposed trial.
    /// Refused when there is no proposal, no such gain, the gain is a parameter of the study, or the value is outside its safe range.
    pub fn set_gain(&mut self, name: &str, value: f64) -> Result<(), RequestRefusal> {
        self.open_proposal()?;
        if self.plan.optimizes(name) {
            return not_now(format!("{name} is a parameter of this study; set it as a parameter"));
        }
        must_be_within(&self.plan.gains, "gain", name, value)?;
        let changes = self.open_proposal()?.with_gain(name, value);
        self.change_open(changes)
    }

    /// Takes all changes of the proposal back, also those of gains.
    pub fn clear_overrides(&mut self) -> Result<(), RequestRefusal> {
        self.change_open(Changes::default())
    }

    /// Returns the parameters that are fixed for the next trial, with the number of trials left.
    pub fn fixed(&self) -> BTreeMap<String, FixedParameter> {
        self.search.fixed(self.study.trials())
    }

    /// Returns the values of a queued point in words, with units.
    pub fn in_words(&self, point: &QueuedPoint) -> String {
        point.in_words(self.plan.parameters.iter().chain(&self.plan.gains))
    }

    /// Returns in words what the operator has changed in the proposal, with units.
    pub fn overrides_in_words(&self) -> String {
        let Some(proposal) = self.proposal() else { return String::new() };
        let units: Vec<&ParameterInfo> = self.plan.parameters.iter().chain(&self.plan.gains).collect();
        let words: Vec<String> = proposal
            .changed()
            .map(|p| {
                let unit = units.iter().find(|info| info.name == p.name).map_or("", |info| &info.unit);
                format!("{} {} {unit}", p.name, six_digits(p.value)).trim_end().to_owned()
            })
            .collect();
        match words.is_empty() {
            true => "as it was proposed".to_owned(),
            false => format!("trial {} will run with {}", proposal.trial, words.join(", ")),
        }
    }

    /// Fixes a parameter for the next `trials` trials that count; the other parameters are proposed for that value, and may be
    /// changed by the operator. A point that was queued with another value keeps it and uses up none of them, and so does a
    /// proposal in which the operator has changed this parameter. Replaces an earlier fix of the same parameter.
    /// Refused when a trial is under way, there is no such parameter, the value is outside its bounds, nothing would be
    /// left to search.
    pub fn fix(&mut self, name: &str, value: f64, trials: u32) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        let bounds = self.search.parameters(&self.plan);
        must_be_within(&bounds, "parameter", name, value)?;
        envelope::must_be_inside(&self.plan, self.hop_share, name, value)?;
        if trials == 0 {
            return not_now("fix it for one trial at least");
        }
        let others = self.fixed();
        let free = bounds.iter().any(|p| p.name != name && p.low < p.high && !others.contains_key(&p.name));
        if !free {
            return not_now(format!("with {name} fixed nothing would be left to search; queue the point instead"));
        }
        let after_verdict = self.pending_verdict.as_ref().map(|pending| pending.suggestion.trial + 1);
        // A point that waits is fixed, too, if it was not queued with another value.
        let queued = self.study.waiting().next().map(|trial| trial.number);
        let next = self.study.trials().len() as u32;
        let from = after_verdict.unwrap_or(next).min(queued.unwrap_or(next));
        self.search.fix(name, value, trials, from);
        self.write_search()
    }

    /// Lets a fixed parameter be searched again.
    /// Refused when a trial is under way or the parameter is not fixed.
    pub fn unfix(&mut self, name: &str) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        if !self.search.unfix(name) {
            return not_now(format!("{name} is not fixed"));
        }
        self.write_search()
    }

    /// Searches a parameter between `low` and `high` from now on. As in Optuna, it is then sampled by itself until no
    /// finished trial has other bounds; trials outside stay in the history. The configured bounds undo it.
    /// Refused when a trial is under way, there is no such parameter, the bounds are no range or wider than
    /// `safety.toml` allows, all of them is beyond the hop envelope, or the parameter is fixed outside them.
    pub fn narrow_bounds(&mut self, name: &str, low: f64, high: f64) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        let widest = named(&self.plan.widest, "parameter", name)?;
        if low >= high || low.is_nan() || high.is_nan() {
            return not_now(format!(
                "{name}: {low} to {high} is no range; the lower bound must be below the upper one"
            ));
        }
        if !(low >= widest.low && high <= widest.high) {
            let ParameterInfo { unit, low: least, high: most, .. } = widest;
            return not_now(format!(
                "{name} from {low} to {high} {unit} is wider than safety.toml allows: {least} to {most} {unit}"
            ));
        }
        if let Some(fixed) = self.fixed().get(name)
            && !(fixed.value >= low && fixed.value <= high)
        {
            return not_now(format!(
                "{name} is fixed at {}, outside these bounds; let it be searched first",
                fixed.value
            ));
        }
        // The weakest force of these bounds; beyond the envelope nothing of them could be jumped.
        envelope::must_be_inside(&self.plan, self.hop_share, name, 0.0_f64.clamp(low, high))?;
        self.search.set_bounds(name, low, high, &self.plan);
        self.write_search()
    }

    /// Writes bounds and fixed parameters, and makes a new proposal with them.
    fn write_search(&mut self) -> Result<(), RequestRefusal> {
        self.study.annotate_study(&self.search.attributes())?;
        Ok(self.propose()?)
    }

    /// Queues the parameters of an earlier trial again, with its gains. Returns the number of the point if it is the open proposal
    /// now, in place of the sampler's.
    /// Refused when there is no such trial, a value is outside its present bounds, or a trial is under way.
    pub fn repeat(&mut self, trial: u32) -> Result<Option<u32>, RequestRefusal> {
        let Some(row) = self.rows.get(&trial) else { return not_now(format!("there is no trial {trial}")) };
        let parameters = row.parameters.clone();
        let origin = Origin::rerun_of(trial, row.source, row.gains.clone());
        self.must_be_allowed(&parameters, &origin.gains)?;
        self.queue(&parameters, &origin)
    }

    /// Queues a point, which may hold gains, too; the parameters that it lacks are proposed when it is its turn.
    /// Refused when a value is outside its bounds or a trial is under way.
    pub fn enqueue(&mut self, point: &[(String, f64)]) -> Result<EnqueuedPoint, RequestRefusal> {
        let is_gain = |(name, _): &(String, f64)| {
            !self.plan.optimizes(name) && self.plan.gains.iter().any(|gain| gain.name == *name)
        };
        let (gains, parameters): (Vec<_>, Vec<_>) = point.iter().cloned().partition(is_gain);
        self.must_be_allowed(&parameters, &gains)?;
        let (parameters, gains) = (ParameterValues::from(parameters), ParameterValues::from(gains));
        let twin = |queued: &QueuedPoint| queued.parameters == parameters && queued.gains == gains;
        let same = queued_points(&self.study).into_iter().find(twin).map(|queued| queued.trial);
        let fixed = self.fixed();
        let differs = |name: &str, fixed: f64| parameters.get(name).is_some_and(|value| value != fixed);
        let not_fixed = fixed.into_iter().map(|(name, fixed)| (name, fixed.value));
        let not_fixed = not_fixed.filter(|(name, fixed)| differs(name, *fixed)).collect();
        let proposed = self.queue(&parameters, &Origin { gains, ..Origin::new(ProposalSource::Queued) })?;
        Ok(EnqueuedPoint { same, proposed, not_fixed })
    }

    /// Refuses a point with a value outside its present bounds.
    fn must_be_allowed(&self, parameters: &[(String, f64)], gains: &[(String, f64)]) -> Result<(), RequestRefusal> {
        let bounds = self.search.parameters(&self.plan);
        for (name, value) in parameters {
            must_be_within(&bounds, "parameter", name, *value)?;
            envelope::must_be_inside(&self.plan, self.hop_share, name, *value)?;
        }
        for (name, value) in gains {
            must_be_within(&self.plan.gains, "gain", name, *value)?;
        }
        Ok(())
    }

    /// Queues a point. Returns its number if it is the open proposal now.
    fn queue(&mut self, parameters: &[(String, f64)], origin: &Origin) -> Result<Option<u32>, RequestRefusal> {
        self.must_be_idle()?;
        self.queue_rerun()?;
        let queued = self.study.enqueue(parameters, &origin.attributes());
        // Also after an error: the re-run of the last verdict is in the study now.
        self.propose()?;
        queued?;
        let last = self.study.waiting().last().map(|trial| trial.number);
        Ok(self.proposal().map(|proposal| proposal.trial).filter(|trial| Some(*trial) == last))
    }

    /// Repeats the best points up to `repeats` times in all; 0 ends the confirmation. Makes the last verdict final. Returns
    /// the first trials of the compared points.
    /// Refused when a trial is under way or there are fewer than two points to compare.
    pub fn confirm_best(&mut self, repeats: u32) -> Result<Vec<u32>, RequestRefusal> {
        self.must_be_idle()?;
        self.study.refresh()?;
        if repeats == 0 {
            if confirmation::running(&self.study).is_none() {
                return not_now("no confirmation of the best is running");
            }
            // With the last verdict, which may be a re-run of a repeat.
            self.report_verdict()?;
            self.remove_repeats()?;
            self.confirmation.abort(&mut self.study)?;
            self.propose()?;
            return Ok(Vec::new());
        }
        // In the study with the pending verdict: a refused request does not make the last verdict final.
        let trials = self.confirmation.candidates(&self.study_with_verdict()?, self.best().map(|best| best.trial));
        if trials.len() < 2 {
            return not_now("fewer than two points ended without a fall: nothing to compare");
        }
        self.report_verdict()?;
        self.confirmation.start(&mut self.study, trials.clone(), repeats)?;
        self.propose()?;
        Ok(trials)
    }

    /// Returns the number of repeats that the running confirmation needs at least to compare its points; 0 while none runs.
    pub fn least_repeats(&self) -> u32 {
        let running = confirmation::running(&self.study);
        running.map_or(0, |running| confirmation::least_repeats(&running.trials, &self.study))
    }

    /// Sets the note of a trial.
    /// Refused when there is no such trial.
    pub fn note(&mut self, trial: u32, text: &str) -> Result<(), RequestRefusal> {
        if !self.rows.contains_key(&trial) {
            return not_now(format!("there is no trial {trial}"));
        }
        self.study.note(trial, text)?;
        if let Some(row) = self.rows.get_mut(&trial) {
            row.note = text.to_owned();
        }
        self.publish_row(trial);
        Ok(())
    }

    /// Raises the budget, also for sessions that continue the study or join it later.
    pub fn extend(&mut self, trials: u32) -> Result<(), RequestRefusal> {
        // More trials may count already than a session with a smaller `--trials` wants.
        let budget = self.plan.budget.max(self.counted()).saturating_add(trials);
        self.study.annotate_study(&attributes::write(&BudgetAttribute { budget }))?;
        self.plan.budget = budget;
        match self.state {
            ExperimentState::Finished => self.propose()?,
            _ => self.publish_search(&self.study_with_verdict()?),
        }
        Ok(())
    }
}

fn named<'a>(all: &'a [ParameterInfo], what: &str, name: &str) -> Result<&'a ParameterInfo, RequestRefusal> {
    match all.iter().find(|parameter| parameter.name == name) {
        Some(parameter) => Ok(parameter),
        None => {
            let known: Vec<_> = all.iter().map(|parameter| parameter.name.as_str()).collect();
            not_now(format!("there is no {what} {name}; the {what}s are {}", known.join(", ")))
        }
    }
}

/// Refuses a value outside the bounds of its parameter, or a name that is not in the list.
pub fn must_be_within(all: &[ParameterInfo], what: &str, name: &str, value: f64) -> Result<(), RequestRefusal> {
    let ParameterInfo { unit, low, high, .. } = named(all, what, name)?;
    if value >= *low && value <= *high {
        Ok(())
    } else {
        let value = six_digits(value);
        not_now(format!("{name} = {value} {unit} is outside its bounds {low} to {high} {unit}"))
    }
}
