//! What an operator may change of the card, of the search and of the queue. Each wish is checked; a refusal says what
//! would do. Nothing runs before it is approved.

use serde_json::json;

use super::attributes::Origin;
use super::not_now;
use crate::session::experiment::{Experiment, RequestRefusal};
use crate::trial::{ExperimentStage, ParameterInfo};

/// Study attribute: how many trials are to count. Workers that join and sessions that continue know it from here.
pub const BUDGET: &str = "budget";

impl Experiment {
    /// Sets one parameter of the proposal.
    ///
    /// # Errors
    /// When there is no proposal, no such parameter, or the value is outside its bounds.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), RequestRefusal> {
        let bounds = self.searched.parameters(&self.plan);
        let Some(card) = &mut self.card else { return not_now("there is no proposal to change") };
        must_be_within(&bounds, "parameter", name, value)?;
        self.revisions += 1;
        card.set(name, value, self.revisions);
        self.show_card();
        Ok(())
    }

    /// Sets one of the controller's gains for the proposed trial.
    ///
    /// # Errors
    /// When there is no proposal, no such gain, or the value is outside its safe range.
    pub fn set_gain(&mut self, name: &str, value: f64) -> Result<(), RequestRefusal> {
        let Some(card) = &mut self.card else { return not_now("there is no proposal to change") };
        must_be_within(&self.plan.gains, "gain", name, value)?;
        self.revisions += 1;
        card.set_gain(name, value, self.revisions);
        self.show_card();
        Ok(())
    }

    /// Back to what was proposed, gains too.
    ///
    /// # Errors
    /// When there is no proposal.
    pub fn clear_overrides(&mut self) -> Result<(), RequestRefusal> {
        let Some(card) = &mut self.card else { return not_now("there is no proposal to change") };
        self.revisions += 1;
        card.clear(self.revisions);
        self.show_card();
        Ok(())
    }

    /// Fixes a parameter for the next `trials` trials that count; the others are still proposed, for that value. What is
    /// queued with a value of its own keeps it. Replaces an earlier fix of the same parameter.
    ///
    /// # Errors
    /// When a trial is under way, there is no such parameter, the value is outside its bounds, nothing would be left to
    /// search, or the study cannot be written.
    pub fn fix(&mut self, name: &str, value: f64, trials: u32) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        let bounds = self.searched.parameters(&self.plan);
        must_be_within(&bounds, "parameter", name, value)?;
        if trials == 0 {
            return not_now("fix it for one trial at least");
        }
        let others = self.searched.fixed(self.study.trials());
        let free = bounds.iter().any(|p| p.name != name && p.low < p.high && !others.contains_key(&p.name));
        if !free {
            return not_now(format!("with {name} fixed nothing would be left to search; queue the point instead"));
        }
        let from =
            self.pending.as_ref().map_or(self.study.trials().len() as u32, |pending| pending.suggestion.trial + 1);
        self.searched.fix(name, value, trials, from);
        self.keep_search()
    }

    /// Lets a fixed parameter be searched again.
    ///
    /// # Errors
    /// When a trial is under way, the parameter is not fixed, or the study cannot be written.
    pub fn unfix(&mut self, name: &str) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        if !self.searched.unfix(name) {
            return not_now(format!("{name} is not fixed"));
        }
        self.keep_search()
    }

    /// Searches a parameter between `low` and `high` from now on. As in Optuna, it is then sampled by itself until no
    /// finished trial has other bounds; trials outside stay in the history. The configured bounds undo it.
    ///
    /// # Errors
    /// When a trial is under way, there is no such parameter, the bounds are no range or wider than `safety.toml` allows,
    /// the parameter is fixed outside them, or the study cannot be written.
    pub fn narrow_bounds(&mut self, name: &str, low: f64, high: f64) -> Result<(), RequestRefusal> {
        self.must_be_idle()?;
        let widest = known(&self.plan.widest, "parameter", name)?;
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
        if let Some(fixed) = self.searched.fixed(self.study.trials()).get(name)
            && !(fixed.value >= low && fixed.value <= high)
        {
            return not_now(format!(
                "{name} is fixed at {}, outside these bounds; let it be searched first",
                fixed.value
            ));
        }
        self.searched.set_bounds(name, low, high, &self.plan);
        self.keep_search()
    }

    /// Writes bounds and fixed parameters, and proposes what is next with them.
    fn keep_search(&mut self) -> Result<(), RequestRefusal> {
        self.study.annotate_study(&self.searched.attributes())?;
        Ok(self.repropose()?)
    }

    /// Queues the parameters of an earlier trial again, with its gains.
    ///
    /// # Errors
    /// When there is no such trial, a trial is under way, or the study cannot be written.
    pub fn repeat(&mut self, trial: u32) -> Result<(), RequestRefusal> {
        let Some(row) = self.rows.get(&trial) else { return not_now(format!("there is no trial {trial}")) };
        let (parameters, origin) = (row.parameters.clone(), Origin::rerun_of(row));
        self.queue(&parameters, &origin)
    }

    /// Queues a point, gains of its own among the parameters; what it lacks is proposed when it is its turn.
    ///
    /// # Errors
    /// When a value is outside its bounds, a trial is under way, or the study cannot be written.
    pub fn enqueue(&mut self, point: &[(String, f64)]) -> Result<(), RequestRefusal> {
        let bounds = self.searched.parameters(&self.plan);
        let is_gain = |(name, _): &(String, f64)| self.plan.gains.iter().any(|gain| gain.name == *name);
        let (gains, parameters): (Vec<_>, Vec<_>) = point.iter().cloned().partition(is_gain);
        for (name, value) in &parameters {
            must_be_within(&bounds, "parameter", name, *value)?;
        }
        for (name, value) in &gains {
            must_be_within(&self.plan.gains, "gain", name, *value)?;
        }
        self.queue(&parameters, &Origin { gains, ..Origin::queued() })
    }

    /// A note on a trial, also on one that was told long ago.
    ///
    /// # Errors
    /// When there is no such trial or the study cannot be written.
    pub fn note(&mut self, trial: u32, text: &str) -> Result<(), RequestRefusal> {
        let Some(row) = self.rows.get_mut(&trial) else { return not_now(format!("there is no trial {trial}")) };
        row.note = text.to_owned();
        self.study.note(trial, text)?;
        self.show_row(trial);
        Ok(())
    }

    /// Raises the budget, for those too who continue the study or join it later.
    ///
    /// # Errors
    /// When the study cannot be read or written.
    pub fn extend(&mut self, trials: u32) -> Result<(), RequestRefusal> {
        let budget = self.plan.budget.saturating_add(trials);
        self.study.annotate_study(&[(BUDGET.to_owned(), json!(budget))])?;
        self.plan.budget = budget;
        if self.stage == ExperimentStage::Finished {
            self.propose()?;
        } else {
            let fork = self.study.fork();
            self.show_search(&fork);
        }
        Ok(())
    }
}

fn known<'a>(all: &'a [ParameterInfo], what: &str, name: &str) -> Result<&'a ParameterInfo, RequestRefusal> {
    match all.iter().find(|parameter| parameter.name == name) {
        Some(parameter) => Ok(parameter),
        None => {
            let known: Vec<_> = all.iter().map(|parameter| parameter.name.as_str()).collect();
            not_now(format!("there is no {what} {name}; the {what}s are {}", known.join(", ")))
        }
    }
}

pub(super) fn must_be_within(all: &[ParameterInfo], what: &str, name: &str, value: f64) -> Result<(), RequestRefusal> {
    let ParameterInfo { unit, low, high, .. } = known(all, what, name)?;
    if value >= *low && value <= *high {
        Ok(())
    } else {
        not_now(format!("{name} = {value} {unit} is outside its bounds {low} to {high} {unit}"))
    }
}
