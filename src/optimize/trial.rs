//! A trial, as samplers read it and the journal stores it.

use super::space::Range;
use serde_json::Value;
use std::collections::BTreeMap;

/// State of a trial; the discriminants are the journal's, the names those of Optuna's tables.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, strum::FromRepr, strum::EnumString, strum::IntoStaticStr)]
#[strum(serialize_all = "UPPERCASE")]
#[repr(u8)]
pub enum TrialState {
    /// Begun, no value yet.
    #[default]
    Running = 0,
    /// Finished with a value.
    Complete = 1,
    /// Stopped early by a pruner of another program.
    Pruned = 2,
    /// Finished without a value; ignored by the samplers.
    Fail = 3,
    /// Enqueued, not begun.
    Waiting = 4,
}

impl TrialState {
    /// Whether the trial is immutable.
    pub fn is_finished(self) -> bool {
        matches!(self, TrialState::Complete | TrialState::Pruned | TrialState::Fail)
    }

    /// Whether the samplers learn from it: complete or pruned.
    pub fn is_observed(self) -> bool {
        matches!(self, TrialState::Complete | TrialState::Pruned)
    }
}

/// Distribution of a parameter of a trial.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the variant describes its fields")]
pub enum Distribution {
    /// A float range.
    Float(Range),
    /// An integer, stepped or categorical distribution of another program, left out of the joint space: its kind, for
    /// example `IntDistribution`, and its JSON text in the journal.
    Foreign { kind: String, text: String },
}

impl Distribution {
    /// The value that a program set, of its number in the journal: the choice of a categorical distribution, an integer.
    pub fn external(&self, number: f64) -> Value {
        let Distribution::Foreign { kind, text } = self else { return Value::from(number) };
        let whole = number as i64;
        if kind == "CategoricalDistribution" {
            let parsed: Option<Value> = serde_json::from_str(text).ok();
            let choice = parsed.as_ref().and_then(|of| of["attributes"]["choices"].get(usize::try_from(whole).ok()?));
            return choice.cloned().unwrap_or_else(|| Value::from(number));
        }
        if kind.starts_with("Int") && whole as f64 == number { Value::from(whole) } else { Value::from(number) }
    }

    /// The range of a float.
    pub fn range(&self) -> Option<Range> {
        match self {
            Distribution::Float(range) => Some(*range),
            Distribution::Foreign { .. } => None,
        }
    }
}

/// One evaluation of the objective.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trial {
    /// Number within its study, from 0.
    pub number: u32,
    /// Number within the journal, over all its studies.
    pub id: u64,
    /// State.
    pub state: TrialState,
    /// Parameters in the order in which they were set.
    pub parameters: Vec<(String, f64)>,
    /// Distributions, parallel to `parameters`.
    pub distributions: Vec<Distribution>,
    /// Value of the objective, of a complete trial or of a pruned one that reported one.
    pub value: Option<f64>,
    /// Intermediate values by step, for pruners.
    pub intermediate: BTreeMap<i64, f64>,
    /// User attributes: verdict, cause, measured terms.
    pub user_attributes: BTreeMap<String, Value>,
    /// System attributes: fixed parameters, positions of the random streams, announced joint samples.
    pub system_attributes: BTreeMap<String, Value>,
    /// Time of the beginning.
    pub started: Option<jiff::Timestamp>,
    /// Time of the end.
    pub completed: Option<jiff::Timestamp>,
    /// Identity of the writer that began it (enqueued it, while it waits).
    pub worker: String,
}

impl Trial {
    /// A trial without parameters, value, attributes and times.
    pub fn new(number: u32, state: TrialState) -> Self {
        Trial { number, id: u64::from(number), state, ..Trial::default() }
    }

    /// Sets or replaces a parameter.
    pub fn set(&mut self, name: &str, value: f64, distribution: Distribution) {
        if let Some(i) = self.parameters.iter().position(|(n, _)| n == name) {
            (self.parameters[i].1, self.distributions[i]) = (value, distribution);
        } else {
            self.parameters.push((name.to_owned(), value));
            self.distributions.push(distribution);
        }
    }

    /// The value of parameter `name`.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        value_of(&self.parameters, name)
    }

    /// The parameters with the values that the program set; of a waiting trial those that are given.
    pub fn external_parameters(&self) -> Vec<(String, Value)> {
        if self.state == TrialState::Waiting {
            let fixed = self.system_attributes.get(FIXED_PARAMS).and_then(Value::as_object);
            return fixed.into_iter().flatten().map(|(name, value)| (name.clone(), value.clone())).collect();
        }
        let pairs = self.parameters.iter().zip(&self.distributions);
        pairs.map(|((name, value), distribution)| (name.clone(), distribution.external(*value))).collect()
    }

    /// The distribution of parameter `name`.
    pub fn distribution(&self, name: &str) -> Option<&Distribution> {
        self.parameters.iter().position(|(n, _)| n == name).map(|i| &self.distributions[i])
    }

    /// Given parameters: of an enqueued trial, or overridden by the operator. A value of another program that is not a finite number
    /// is none.
    pub fn fixed(&self) -> Vec<(String, f64)> {
        let given = self.system_attributes.get(FIXED_PARAMS).map(numbers_of).unwrap_or_default();
        given.into_iter().filter(|(_, value)| value.is_finite()).collect()
    }

    /// Parameters that another program has given without a finite number, with their values as it wrote them.
    pub fn given_without_number(&self) -> impl Iterator<Item = (&str, &Value)> {
        let given = self.system_attributes.get(FIXED_PARAMS).and_then(Value::as_object).into_iter().flatten();
        let is_number = |value: &Value| number_of(value).is_some_and(f64::is_finite);
        given.filter(move |(_, value)| !is_number(value)).map(|(name, value)| (name.as_str(), value))
    }

    /// Whether the robot fell: attribute `verdict` is `fall`.
    pub fn is_fall(&self) -> bool {
        self.user_attributes.get(VERDICT).and_then(Value::as_str) == Some(FALL)
    }

    /// Applies a change of its verdict after its end; a value without a known verdict changes nothing. The members are those
    /// of [`VerdictChange`].
    pub(super) fn change_verdict(&mut self, change: &Value) {
        let value = change.get("value").and_then(Value::as_f64);
        let state = match (change.get(VERDICT).and_then(Value::as_str), value) {
            (Some("void"), _) => TrialState::Fail,
            (Some("accept" | FALL), Some(_)) => TrialState::Complete,
            _ => return,
        };
        (self.state, self.value) = (state, value.filter(|_| state == TrialState::Complete));
        for name in [VERDICT, "value", "cause"] {
            self.user_attributes.insert(name.to_owned(), change.get(name).cloned().unwrap_or_default());
        }
    }

    /// The joint sample announced to other workers, empty without one. Optuna stores it as JSON text in pieces.
    pub fn announced(&self) -> Vec<(String, f64)> {
        let text: String =
            (0..).map_while(|i| self.system_attributes.get(&format!("{RELATIVE_PARAMS}:{i}"))?.as_str()).collect();
        serde_json::from_str(&text).as_ref().map(numbers_of).unwrap_or_default()
    }

    /// Sum of the positive constraint values: above 0 the trial is infeasible for Optuna.
    pub fn violation(&self) -> f64 {
        let positive = |v: &Value| number_of(v).unwrap_or(0.0).max(0.0);
        let named = self.system_attributes.iter().filter(|(k, _)| k.starts_with("constraints:"));
        let listed = self.system_attributes.get("constraints").and_then(Value::as_array).into_iter().flatten();
        named.map(|(_, v)| positive(v)).sum::<f64>() + listed.map(positive).sum::<f64>()
    }
}

/// Trial user attribute: the verdict of the operator or of the automatic judge.
pub const VERDICT: &str = "verdict";
/// The verdict of a trial that ended with a fall. Its value shows the sampler a region to avoid.
pub const FALL: &str = "fall";
/// Study user attribute of a verdict that was changed after the trial's end: this prefix and the number of the trial. An array
/// of [`VerdictChange`], the newest last.
pub const CHANGED_VERDICT: &str = "verdict:";

/// A verdict that was changed after the trial's end, and the one before.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct VerdictChange {
    /// Time of the change, ISO 8601.
    pub at: String,
    /// The new verdict: `accept`, `fall` or `void`.
    pub verdict: String,
    /// The new value; none for void.
    pub value: Option<f64>,
    /// The new cause.
    pub cause: String,
    /// The reason of the operator.
    pub reason: String,
    /// The verdict before.
    pub old_verdict: String,
    /// The value before; none for void.
    pub old_value: Option<f64>,
}

/// Trial user attribute: gains of the controller, an object. Trials with different gains are not repeats.
pub const GAINS: &str = "gains";
/// Trial system attribute: the fixed parameters, an object.
pub const FIXED_PARAMS: &str = "fixed_params";
/// Trial system attribute: the announced joint sample; its pieces have the suffixes `:0`, `:1` ...
pub const RELATIVE_PARAMS: &str = "tpe:relative_params";

/// Text of an attribute in the pieces of 2045 characters in which Optuna and its dashboard store it.
pub(super) fn pieces(text: &str) -> Vec<String> {
    let characters: Vec<char> = text.chars().collect();
    characters.chunks(2045).map(|piece| piece.iter().collect()).collect()
}

/// The attributes that announce a joint sample: an object as JSON text.
pub fn announcement(joint: &[(String, f64)]) -> Vec<(String, Value)> {
    if joint.is_empty() {
        return Vec::new();
    }
    let members: Vec<String> =
        joint.iter().map(|(n, v)| format!("{}: {}", Value::from(n.as_str()), Value::from(*v))).collect();
    let text = format!("{{{}}}", members.join(", "));
    pieces(&text).into_iter().enumerate().map(|(i, text)| (format!("{RELATIVE_PARAMS}:{i}"), text.into())).collect()
}

/// The value of parameter `name`.
pub fn value_of(parameters: &[(String, f64)], name: &str) -> Option<f64> {
    parameters.iter().find(|(n, _)| n == name).map(|(_, v)| *v)
}

/// The parameters as a JSON object.
pub(crate) fn json_object(parameters: &[(String, f64)]) -> Value {
    Value::Object(parameters.iter().map(|(name, value)| (name.clone(), Value::from(*value))).collect())
}

/// The members of a JSON object that are numbers.
fn numbers_of(value: &Value) -> Vec<(String, f64)> {
    let members = value.as_object().into_iter().flatten();
    members.filter_map(|(name, v)| Some((name.clone(), number_of(v)?))).collect()
}

/// The number of a JSON value; infinities and NaN, which JSON lacks, are text.
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
