//! A trial as the samplers see it and the journal tells it.

use super::space::Range;
use serde_json::Value;
use std::collections::BTreeMap;

/// Where a trial stands; the discriminants are the journal's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialState {
    /// Begun, no value yet.
    Running = 0,
    /// Finished with a value.
    Complete = 1,
    /// Stopped early by a pruner (other programs do this; we read it).
    Pruned = 2,
    /// Finished without a value; the samplers do not see it.
    Fail = 3,
    /// Enqueued: parameters are asked for, nobody has begun it.
    Waiting = 4,
}

impl TrialState {
    /// Whether nothing about the trial can change any more.
    pub fn is_finished(self) -> bool {
        matches!(self, TrialState::Complete | TrialState::Pruned | TrialState::Fail)
    }

    /// Whether the samplers learn from it: complete or pruned.
    pub fn is_observed(self) -> bool {
        matches!(self, TrialState::Complete | TrialState::Pruned)
    }
}

/// How a parameter of a trial was distributed.
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// A float range, ours.
    Float(Range),
    /// An integer, stepped or categorical one, written by another program: its kind and settings as text. The samplers
    /// here leave it out of the joint space.
    Foreign {
        /// Name of the kind, for example `IntDistribution`.
        kind: String,
        /// The journal's text.
        text: String,
    },
}

impl Distribution {
    /// The range, if it is a float's.
    pub fn range(&self) -> Option<Range> {
        match self {
            Distribution::Float(range) => Some(*range),
            Distribution::Foreign { .. } => None,
        }
    }
}

/// One evaluation of the objective.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Number within its study, from 0.
    pub number: u32,
    /// Number within the journal, over all its studies.
    pub id: u64,
    /// Where it stands.
    pub state: TrialState,
    /// Parameters in the order in which they were set.
    pub parameters: Vec<(String, f64)>,
    /// Distributions, parallel to `parameters`.
    pub distributions: Vec<Distribution>,
    /// The objective, of a complete trial (and of a pruned one that reported).
    pub value: Option<f64>,
    /// Intermediate values by step, as a pruner wants them.
    pub intermediate: BTreeMap<i64, f64>,
    /// Attributes of the user: verdict, cause, measured terms.
    pub user_attributes: BTreeMap<String, Value>,
    /// Attributes of the machinery: fixed parameters, draw counters, announced joint samples.
    pub system_attributes: BTreeMap<String, Value>,
    /// When it began, if it did.
    pub started: Option<jiff::Timestamp>,
    /// When it was finished, if it was.
    pub completed: Option<jiff::Timestamp>,
    /// Identity of the writer that began it (or enqueued it, while it waits).
    pub worker: String,
}

impl Trial {
    /// A trial without anything.
    pub fn new(number: u32, state: TrialState) -> Self {
        Trial {
            number,
            id: u64::from(number),
            state,
            parameters: Vec::new(),
            distributions: Vec::new(),
            value: None,
            intermediate: BTreeMap::new(),
            user_attributes: BTreeMap::new(),
            system_attributes: BTreeMap::new(),
            started: None,
            completed: None,
            worker: String::new(),
        }
    }

    /// Sets a parameter, or replaces it.
    pub fn set(&mut self, name: &str, value: f64, distribution: Distribution) {
        match self.parameters.iter().position(|(n, _)| n == name) {
            Some(i) => {
                self.parameters[i].1 = value;
                self.distributions[i] = distribution;
            }
            None => {
                self.parameters.push((name.to_owned(), value));
                self.distributions.push(distribution);
            }
        }
    }

    /// The value of parameter `name`.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.iter().find(|(n, _)| n == name).map(|(_, v)| *v)
    }

    /// The distribution of parameter `name`.
    pub fn distribution(&self, name: &str) -> Option<&Distribution> {
        self.parameters.iter().position(|(n, _)| n == name).map(|i| &self.distributions[i])
    }

    /// Parameters that were given, not suggested: of an enqueued trial, or overridden by the operator.
    pub fn fixed(&self) -> Vec<(String, f64)> {
        match self.system_attributes.get(FIXED_PARAMS) {
            Some(Value::Object(map)) => map.iter().filter_map(|(k, v)| Some((k.clone(), number_of(v)?))).collect(),
            _ => Vec::new(),
        }
    }

    /// Whether the robot fell: its attribute `verdict` says `fall`.
    pub fn is_fall(&self) -> bool {
        self.user_attributes.get(VERDICT).and_then(Value::as_str) == Some(FALL)
    }

    /// The joint sample announced for other workers, empty where there is none. Optuna writes it as JSON text in pieces.
    pub fn announced(&self) -> Vec<(String, f64)> {
        let text: String =
            (0..).map_while(|i| self.system_attributes.get(&format!("{RELATIVE_PARAMS}:{i}"))?.as_str()).collect();
        match serde_json::from_str(&text) {
            Ok(Value::Object(map)) => map.iter().filter_map(|(k, v)| Some((k.clone(), number_of(v)?))).collect(),
            _ => Vec::new(),
        }
    }

    /// Announces a joint sample, as Optuna writes it.
    pub fn announce(&mut self, joint: &[(String, f64)]) {
        self.system_attributes.extend(announcement(joint));
    }

    /// The sum of the positive constraint values, 0 if there are none: above 0 the trial is infeasible to Optuna.
    pub fn violation(&self) -> f64 {
        let positive = |v: &Value| number_of(v).unwrap_or(0.0).max(0.0);
        let named: f64 = self
            .system_attributes
            .iter()
            .filter(|(k, _)| k.starts_with("constraints:"))
            .map(|(_, v)| positive(v))
            .sum();
        let listed: f64 = match self.system_attributes.get("constraints") {
            Some(Value::Array(list)) => list.iter().map(positive).sum(),
            _ => 0.0,
        };
        named + listed
    }
}

/// Trial user attribute: what the operator, or the machine for him, judged.
pub const VERDICT: &str = "verdict";
/// The verdict of a trial that ended on the floor. It is told with a value, but what the value says is where not to go.
pub const FALL: &str = "fall";
/// Trial user attribute: under which conditions besides its parameters it ran, an object. Trials with others are no repeats.
pub const GAINS: &str = "gains";
/// Trial system attribute: the fixed parameters, an object.
pub const FIXED_PARAMS: &str = "fixed_params";
/// Trial system attribute: the announced joint sample, with `:0`, `:1` ... for its pieces.
pub const RELATIVE_PARAMS: &str = "tpe:relative_params";

/// The attributes that announce a joint sample: an object as JSON text, in pieces of 2045 characters.
pub fn announcement(joint: &[(String, f64)]) -> Vec<(String, Value)> {
    if joint.is_empty() {
        return Vec::new();
    }
    let members: Vec<String> =
        joint.iter().map(|(n, v)| format!("{}: {}", Value::from(n.as_str()), Value::from(*v))).collect();
    let text: Vec<char> = format!("{{{}}}", members.join(", ")).chars().collect();
    let piece =
        |(i, c): (usize, &[char])| (format!("{RELATIVE_PARAMS}:{i}"), Value::from(c.iter().collect::<String>()));
    text.chunks(2045).enumerate().map(piece).collect()
}

/// A number of a JSON value; the tokens that JSON lacks arrive as text.
pub(crate) fn number_of(value: &Value) -> Option<f64> {
    match value {
        Value::Number(n) => n.as_f64(),
        Value::String(s) => match s.as_str() {
            "Infinity" => Some(f64::INFINITY),
            "-Infinity" => Some(f64::NEG_INFINITY),
            "NaN" => Some(f64::NAN),
            _ => None,
        },
        Value::Bool(b) => Some(f64::from(u8::from(*b))),
        _ => None,
    }
}
