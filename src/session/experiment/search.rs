//! Bounds and fixed parameters that the operator sets during a study. They are attributes of the study, so that every
//! session and every worker searches the same space.

use std::collections::BTreeMap;

use serde::Serialize;

use super::attributes::{self, Attributes, TrialAttributes};
use super::plan::ExperimentPlan;
use super::study_attributes::{FixedFrom, StudyAttributes};
use crate::optimize::space::{Range, Space};
use crate::optimize::study::{Study, StudyError};
use crate::optimize::trial::{Trial, TrialState};
use crate::trial::{FixedParameter, ParameterInfo, SearchStatus, SearchedParameter, Verdict, six_digits};

impl FixedFrom {
    /// Returns the number of trials for which `name` is still fixed. A trial uses one up that has the fixed value, also
    /// one that was queued with it or whose other parameters the operator has changed, unless it is void or repeats a point to confirm
    /// the best.
    fn trials_left(&self, name: &str, trials: &[Trial]) -> u32 {
        let ran = |trial: &&Trial| {
            if trial.number < self.from || matches!(trial.state, TrialState::Fail | TrialState::Waiting) {
                return false;
            }
            // A void verdict that can be taken back is not reported yet.
            let TrialAttributes { fixed, verdict, .. } = TrialAttributes::of(trial);
            fixed.get(name) == Some(self.value) && verdict != Some(Verdict::Void)
        };
        self.trials.saturating_sub(trials.iter().filter(ran).count() as u32)
    }
}

/// Returns a sentence without its end for each parameter that the operator has fixed for some trials and not freed since.
pub fn fixed_in_words(study: &Study) -> Vec<String> {
    let fixed = StudyAttributes::of(study.attributes()).fixed.unwrap_or_default();
    let sentence = |(name, fixed): (&String, &FixedFrom)| {
        let FixedFrom { value, trials, from } = fixed;
        let (value, left) = (six_digits(*value), fixed.trials_left(name, study.trials()));
        let trials =
            if *trials == 1 { "1 trial that counts".to_owned() } else { format!("{trials} trials that count") };
        match left {
            0 => format!("{name} was fixed at {value} for {trials}, from trial {from}"),
            left => format!("{name} is fixed at {value} for {trials}, from trial {from}: {left} left"),
        }
    };
    fixed.iter().map(sentence).collect()
}

/// Differences of the search space from the configuration.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SearchSettings {
    bounds: BTreeMap<String, [f64; 2]>,
    fixed: BTreeMap<String, FixedFrom>,
}

impl SearchSettings {
    /// Reads the settings of the study; those outside the plan's widest bounds are left out.
    pub fn of(study: &Study, plan: &ExperimentPlan) -> SearchSettings {
        let StudyAttributes { bounds, fixed, .. } = StudyAttributes::of(study.attributes());
        let (mut bounds, mut fixed) = (bounds.unwrap_or_default(), fixed.unwrap_or_default());
        let widest = |name: &String| plan.widest.iter().find(|parameter| parameter.name == *name);
        bounds.retain(|name, [low, high]| {
            widest(name).is_some_and(|widest| low < high && *low >= widest.low && *high <= widest.high)
        });
        fixed.retain(|name, fixed| widest(name).is_some_and(|widest| widest.contains(fixed.value)));
        SearchSettings { bounds, fixed }
    }

    pub fn attributes(&self) -> Attributes {
        attributes::write(self)
    }

    /// Returns the parameters with their present bounds, in table order.
    pub fn parameters(&self, plan: &ExperimentPlan) -> Vec<ParameterInfo> {
        let present = |parameter: &ParameterInfo| match self.bounds.get(&parameter.name) {
            Some([low, high]) => ParameterInfo { low: *low, high: *high, ..parameter.clone() },
            None => parameter.clone(),
        };
        plan.parameters.iter().map(present).collect()
    }

    pub fn apply(&self, plan: &ExperimentPlan, study: &mut Study) -> Result<(), StudyError> {
        let present = self.parameters(plan);
        let mut space = Vec::new();
        for parameter in study.options().space.parameters() {
            let range = present.iter().find(|p| p.name == parameter.name).map(|p| Range::linear(p.low, p.high));
            space.push((parameter.name.clone(), range.unwrap_or(parameter.range)));
        }
        match Space::new(space) {
            Ok(space) => study.search(space),
            // The configured bounds hold: both the configuration and `of` refuse bounds that are no range.
            Err(_) => Ok(()),
        }
    }

    /// Returns the parameters that are fixed for the next trial, with the number of trials left. A void trial uses up
    /// none.
    pub fn fixed(&self, trials: &[Trial]) -> BTreeMap<String, FixedParameter> {
        let left = |(name, fixed): (&String, &FixedFrom)| {
            let left = FixedParameter { value: fixed.value, trials: fixed.trials_left(name, trials) };
            (left.trials > 0).then(|| (name.clone(), left))
        };
        self.fixed.iter().filter_map(left).collect()
    }

    /// Sets the bounds of a parameter; the configured bounds are no difference.
    pub fn set_bounds(&mut self, name: &str, low: f64, high: f64, plan: &ExperimentPlan) {
        let configured = plan.parameters.iter().any(|p| p.name == name && p.low == low && p.high == high);
        if configured {
            self.bounds.remove(name);
        } else {
            self.bounds.insert(name.to_owned(), [low, high]);
        }
    }

    pub fn fix(&mut self, name: &str, value: f64, trials: u32, from: u32) {
        self.fixed.insert(name.to_owned(), FixedFrom { value, trials, from });
    }

    /// Lets a parameter be searched again. Returns whether it was fixed.
    pub fn unfix(&mut self, name: &str) -> bool {
        self.fixed.remove(name).is_some()
    }

    pub fn status(
        &self,
        plan: &ExperimentPlan,
        counted: u32,
        trials: &[Trial],
        confirming: Option<u32>,
    ) -> SearchStatus {
        let fixed = self.fixed(trials);
        let searched = |parameter: ParameterInfo| {
            let widest = plan.widest.iter().find(|widest| widest.name == parameter.name).unwrap_or(&parameter);
            SearchedParameter {
                low: parameter.low,
                high: parameter.high,
                least: widest.low,
                most: widest.high,
                fixed: fixed.get(&parameter.name).copied(),
                name: parameter.name,
            }
        };
        let parameters = self.parameters(plan).into_iter().map(searched).collect();
        SearchStatus { budget: plan.budget, counted, parameters, confirming, hop_share: None, queue: Vec::new() }
    }
}
