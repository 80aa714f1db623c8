//! Bounds and fixed parameters as the operator has set them in mid-study. They are attributes of the study itself, so that
//! every session and every worker searches the same.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::attributes;
use crate::optimize::space::{Range, Space};
use crate::optimize::study::{Study, StudyError};
use crate::optimize::trial::{Trial, TrialState};
use crate::session::experiment::ExperimentPlan;
use crate::trial::{FixedParameter, ParameterInfo, SearchStatus, SearchedParameter};

/// Study attribute: changed bounds, `{"Fx": [40, 110]}`.
const BOUNDS: &str = "bounds";
/// Study attribute: fixed parameters, `{"Fx": {"value": 60, "trials": 5, "from": 12}}`.
const FIXED: &str = "fixed";

/// What differs from the configuration.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Searched {
    bounds: BTreeMap<String, [f64; 2]>,
    fixed: BTreeMap<String, Hold>,
}

/// A parameter that is not searched for some trials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Hold {
    value: f64,
    /// For how many trials.
    trials: u32,
    /// Number of the first trial that it applied to.
    from: u32,
}

impl Searched {
    /// As kept with the study; what the plan does not allow (any more) is left out.
    pub fn of(study: &Study, plan: &ExperimentPlan) -> Searched {
        let kept = |key: &str| study.attributes().get(key).cloned().unwrap_or(Value::Null);
        let mut searched = Searched {
            bounds: serde_json::from_value(kept(BOUNDS)).unwrap_or_default(),
            fixed: serde_json::from_value(kept(FIXED)).unwrap_or_default(),
        };
        let widest = |name: &String| plan.widest.iter().find(|parameter| parameter.name == *name);
        searched.bounds.retain(|name, [low, high]| {
            widest(name).is_some_and(|widest| low < high && *low >= widest.low && *high <= widest.high)
        });
        searched.fixed.retain(|name, hold| {
            widest(name).is_some_and(|widest| hold.value >= widest.low && hold.value <= widest.high)
        });
        searched
    }

    /// To be kept with the study.
    pub fn attributes(&self) -> Vec<(String, Value)> {
        vec![(BOUNDS.to_owned(), json!(self.bounds)), (FIXED.to_owned(), json!(self.fixed))]
    }

    /// The parameters with their present bounds, in table order.
    pub fn parameters(&self, plan: &ExperimentPlan) -> Vec<ParameterInfo> {
        let present = |parameter: &ParameterInfo| match self.bounds.get(&parameter.name) {
            Some([low, high]) => ParameterInfo { low: *low, high: *high, ..parameter.clone() },
            None => parameter.clone(),
        };
        plan.parameters.iter().map(present).collect()
    }

    /// Makes the study search within the present bounds.
    pub fn apply(&self, plan: &ExperimentPlan, study: &mut Study) -> Result<(), StudyError> {
        let present = self.parameters(plan);
        let mut space = Vec::new();
        for parameter in study.options().space.parameters() {
            let range = present.iter().find(|p| p.name == parameter.name).map(|p| Range::linear(p.low, p.high));
            space.push((parameter.name.clone(), range.unwrap_or(parameter.range)));
        }
        match Space::new(space) {
            Ok(space) => study.search(space),
            Err(_) => unreachable!("bounds were checked when they were taken up"),
        }
    }

    /// The parameters that are fixed for the next trial, with their values and for how many trials more. Void trials do
    /// not use up any.
    pub fn fixed(&self, trials: &[Trial]) -> BTreeMap<String, FixedParameter> {
        let left = |(name, hold): (&String, &Hold)| {
            let ran = |trial: &&Trial| {
                trial.number >= hold.from
                    && !matches!(trial.state, TrialState::Fail | TrialState::Waiting)
                    && attributes::was_fixed(trial, name, hold.value)
            };
            let ran = trials.iter().filter(ran).count() as u32;
            (ran < hold.trials).then(|| (name.clone(), FixedParameter { value: hold.value, trials: hold.trials - ran }))
        };
        self.fixed.iter().filter_map(left).collect()
    }

    /// Sets the bounds of a parameter; those of the configuration are no change.
    pub fn set_bounds(&mut self, name: &str, low: f64, high: f64, plan: &ExperimentPlan) {
        let configured = plan.parameters.iter().any(|p| p.name == name && p.low == low && p.high == high);
        if configured {
            self.bounds.remove(name);
        } else {
            self.bounds.insert(name.to_owned(), [low, high]);
        }
    }

    /// Fixes a parameter for `trials` trials from number `from` on.
    pub fn fix(&mut self, name: &str, value: f64, trials: u32, from: u32) {
        self.fixed.insert(name.to_owned(), Hold { value, trials, from });
    }

    /// Lets a parameter be searched again; whether it was fixed.
    pub fn unfix(&mut self, name: &str) -> bool {
        self.fixed.remove(name).is_some()
    }

    /// For the screen.
    pub fn record(
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
        SearchStatus { budget: plan.budget, counted, parameters, confirming }
    }
}
