//! User attributes of the trials of a study in the journal, as typed data (`docs/journal.md`). With those of the study
//! (`study_attributes.rs`) they hold everything that a later session needs. An attribute of another program, or of another type, is
//! ignored.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde::de::value::MapDeserializer;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use super::plan::ExperimentPlan;
use crate::optimize::ask::SamplerKind;
use crate::optimize::journal::InOrder;
use crate::optimize::study::{DRAWS, Outcome};
use crate::optimize::trial::{Trial, TrialState, value_of};
use crate::trial::{
    Backend, DrawnRange, ExpectedResult, FallRisk, GAIN_UNITS, JudgedBy, MeasuredJump, PRUNED, ParameterInfo,
    ParameterValues, Proposal, ProposalSource, RepeatRecord, TrialRecord, Verdict, is_changed_verdict,
};

/// Attributes in the order in which they are written.
pub type Attributes = Vec<(String, Value)>;

/// Origin of a trial; kept with a queued trial. Without attributes the trial was queued by another program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    pub source: ProposalSource,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parent: Option<u32>,
    /// The seed of its noise and terrain; none for a new one. Text: JSON numbers of other programs do not hold 64 bits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<String>,
    /// Its gains; empty for those of the configuration.
    #[serde(skip_serializing_if = "is_empty", serialize_with = "as_object", deserialize_with = "numbers")]
    pub gains: ParameterValues,
    /// Judged rollouts, its own or those of the interrupted trial that it continues.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub repeats: Vec<RepeatRecord>,
}

impl Default for Origin {
    fn default() -> Origin {
        Origin::new(ProposalSource::Queued)
    }
}

impl Origin {
    /// Returns the origin of new parameters with a seed of their own and the configured gains.
    pub fn new(source: ProposalSource) -> Origin {
        Origin { source, parent: None, seed: None, gains: ParameterValues::default(), repeats: Vec::new() }
    }

    /// Returns the origin of a repetition with the same gains and new noise. The repetition of a repeat that confirms
    /// the best confirms it, too.
    pub fn rerun_of(trial: u32, source: ProposalSource, gains: ParameterValues) -> Origin {
        let source = if source == ProposalSource::Confirm { source } else { ProposalSource::Rerun };
        Origin { source, parent: Some(trial), seed: None, gains, repeats: Vec::new() }
    }

    /// Returns the origin of a repeat of a point that may be the best, with the gains of its first trial.
    pub fn confirming(first: &Trial) -> Origin {
        let gains = Origin::of_trial(first).gains;
        let source = ProposalSource::Confirm;
        Origin { source, parent: Some(first.number), seed: None, gains, repeats: Vec::new() }
    }

    /// Returns the origin of a repetition with the same gains, the same seed and the judged rollouts: after a crash the study
    /// continues as if the crash had not happened.
    pub fn interrupted(trial: &Trial) -> Origin {
        let Origin { source, seed, gains, repeats, .. } = Origin::of_trial(trial);
        Origin { seed, repeats, ..Origin::rerun_of(trial.number, source, gains) }
    }

    pub fn of(attributes: &BTreeMap<String, Value>) -> Origin {
        read(attributes)
    }

    pub fn of_trial(trial: &Trial) -> Origin {
        read(&trial.user_attributes)
    }

    pub fn seed(&self) -> Option<u64> {
        self.seed.as_ref()?.parse().ok()
    }

    pub fn attributes(&self) -> Attributes {
        write(self)
    }
}

/// Attributes that are written when a trial begins.
#[derive(Debug, Serialize)]
pub struct BeganAttributes {
    #[serde(flatten)]
    origin: Origin,
    version: &'static str,
    worker: u32,
    /// None on the simulator.
    #[serde(skip_serializing_if = "Option::is_none")]
    backend: Option<&'static str>,
    /// The sampler that proposed it; none for a queued point.
    #[serde(skip_serializing_if = "Option::is_none")]
    sampler: Option<&'static str>,
    #[serde(skip_serializing_if = "String::is_empty")]
    recording: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    risk: Option<FallRisk>,
    /// Numeric columns of their own: `predicted`, `predicted_deviation`, `p_stand`.
    #[serde(flatten)]
    expected: Option<ExpectedResult>,
    #[serde(skip_serializing_if = "is_empty", serialize_with = "as_object")]
    fixed: ParameterValues,
    /// Proposed values of the parameters and gains that the operator has changed.
    #[serde(skip_serializing_if = "is_empty", serialize_with = "as_object")]
    proposed: ParameterValues,
    /// Coulomb coefficient of the ground; none where it is not drawn for each trial.
    #[serde(skip_serializing_if = "Option::is_none")]
    friction: Option<f64>,
}

impl BeganAttributes {
    /// Returns the attributes of a trial of `proposal`; `fixed` holds the parameters that the operator had fixed for some
    /// trials, `sampler` what proposed it.
    pub fn new(
        proposal: &Proposal,
        seed: u64,
        repeats: Vec<RepeatRecord>,
        plan: &ExperimentPlan,
        fixed: ParameterValues,
        sampler: Option<SamplerKind>,
    ) -> BeganAttributes {
        let gains = proposal.gains.iter().map(|gain| (gain.name.clone(), gain.value)).collect();
        let drawn = plan.terrain.filter(|terrain| terrain.friction_range.is_some());
        BeganAttributes {
            origin: Origin {
                source: proposal.source,
                parent: proposal.parent,
                seed: Some(seed.to_string()),
                gains,
                repeats,
            },
            version: env!("CARGO_PKG_VERSION"),
            worker: plan.worker,
            backend: (plan.backend != Backend::Simulator).then(|| plan.backend.name()),
            sampler: sampler.map(Into::into),
            recording: plan.recording.clone(),
            risk: proposal.risk,
            expected: proposal.expected,
            fixed,
            proposed: proposal.replaced(),
            friction: drawn.map(|terrain| terrain.friction_of(seed)),
        }
    }
}

/// Attributes that are written when a rollout of several is judged.
#[derive(Debug, Serialize)]
pub struct RepeatsAttribute<'a> {
    pub repeats: &'a [RepeatRecord],
}

/// Attributes that are written when a trial was measured, and when it is judged; before the verdict, and after it was taken back,
/// the verdict and its origin are null. The suggestion follows what was measured, and the verdict is the last: a judgement that was cut
/// off has none, and one that was cut off within the measured values has no suggestion either.
#[derive(Debug, Serialize)]
pub struct JudgedAttributes<'a> {
    cause: &'a str,
    value: Option<f64>,
    hand_value: Option<f64>,
    rerun: bool,
    /// Numeric columns of their own, so that optuna-dashboard can sort by them.
    #[serde(flatten)]
    measured: Option<&'a MeasuredJump>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    repeats: &'a [RepeatRecord],
    suggested: Option<Verdict>,
    judged_by: Option<JudgedBy>,
    verdict: Option<Verdict>,
}

impl JudgedAttributes<'_> {
    /// Returns the attributes of the row; `rerun` queues the parameters again.
    pub fn of(row: &TrialRecord, rerun: bool) -> JudgedAttributes<'_> {
        let TrialRecord { verdict, judged_by, suggested, cause, value, hand_value, measured, repeats, .. } = row;
        JudgedAttributes {
            suggested: *suggested,
            cause,
            value: *value,
            hand_value: *hand_value,
            rerun,
            measured: measured.as_ref(),
            repeats,
            judged_by: *judged_by,
            verdict: *verdict,
        }
    }
}

/// Attributes of a trial whose program ended before the verdict. The verdict is the last, as of [`JudgedAttributes`].
#[derive(Debug, Serialize)]
pub struct InterruptedAttributes<'a> {
    pub cause: &'a str,
    pub rerun: bool,
    pub interrupted: bool,
    /// None for a trial that did not run.
    pub judged_by: Option<JudgedBy>,
    pub verdict: Verdict,
}

/// Attributes of a queued trial that was removed before it began.
#[derive(Debug, Serialize)]
pub struct RemovedAttributes<'a> {
    pub verdict: Verdict,
    pub cause: &'a str,
}

/// Attributes of a trial besides its [`Origin`].
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct TrialAttributes {
    /// The worker that runs it: 0 is the session that has the study's folder.
    pub worker: Option<u32>,
    /// The robot on which it ran; none on the simulator.
    pub backend: Option<String>,
    /// The sampler that proposed it; none for a queued point and for a trial of an earlier version.
    pub sampler: Option<String>,
    pub risk: Option<FallRisk>,
    /// Parameters that the operator had fixed for some trials.
    #[serde(deserialize_with = "numbers")]
    pub fixed: ParameterValues,
    /// Proposed values of the parameters and gains that the operator has changed; empty in journals of earlier versions.
    #[serde(deserialize_with = "numbers")]
    pub proposed: ParameterValues,
    pub verdict: Option<Verdict>,
    /// Origin of the verdict; none for a trial of an earlier version.
    pub judged_by: Option<JudgedBy>,
    pub suggested: Option<Verdict>,
    /// Reason of the suggestion, or of another verdict.
    pub cause: Option<String>,
    pub value: Option<f64>,
    pub hand_value: Option<f64>,
    /// The parameters are to be queued again.
    pub rerun: Option<bool>,
    /// The program ended before the verdict.
    pub interrupted: Option<bool>,
}

impl TrialAttributes {
    pub fn of(trial: &Trial) -> TrialAttributes {
        read(&trial.user_attributes)
    }

    /// Whether a running trial was measured and has no verdict. A trial that is void by the rules is not among them, unless a value
    /// was entered by hand.
    pub fn is_unjudged(&self) -> bool {
        let counts = matches!(self.suggested, Some(Verdict::Accept | Verdict::Fall)) || self.hand_value.is_some();
        self.verdict.is_none() && counts
    }

    /// Returns the outcome of a running trial whose verdict was on disk when the program ended; none without a verdict. A verdict
    /// without a suggestion is that of a removal from the queue that was cut off: the trial has run since.
    pub fn outcome(&self) -> Option<Outcome> {
        match self.verdict.filter(|_| self.suggested.is_some())? {
            Verdict::Void => Some(Outcome::Fail),
            // A judgement that was cut off may have the value that was measured.
            Verdict::Fall => Some(Outcome::Complete(0.0)),
            Verdict::Accept => self.value.map(Outcome::Complete),
        }
    }
}

/// Returns the attributes that hold in another study, too: without numbers of trials and workers, without the recording, in which the
/// trial has the number of its own study, and without a re-run.
pub fn elsewhere(mut attributes: Map<String, Value>) -> Map<String, Value> {
    for name in ["parent", "worker", "backend", "recording", "rerun", "interrupted"] {
        attributes.remove(name);
    }
    // A table has no types: a text of digits is a number there.
    if let Some(seed) = attributes.get_mut("seed")
        && let Some(number) = seed.as_u64()
    {
        *seed = number.to_string().into();
    }
    attributes
}

/// Returns the number of the worker of this program that runs a trial; none for a trial of another program.
pub fn worker_of(trial: &Trial) -> Option<u32> {
    trial.system_attributes.get(DRAWS)?;
    Some(TrialAttributes::of(trial).worker.unwrap_or(0))
}

pub fn confirms(trial: &Trial) -> bool {
    Origin::of_trial(trial).source == ProposalSource::Confirm
}

/// Returns the row of a trial of the study. A complete trial of another program has no verdict and counts as accepted.
pub fn row_of(trial: &Trial, note: String, order: &[ParameterInfo]) -> TrialRecord {
    let origin = Origin::of_trial(trial);
    let seed = origin.seed();
    let Origin { source, parent, gains, repeats, .. } = origin;
    // In table order: the journal has them by name.
    let gains = GAIN_UNITS.iter().filter_map(|(name, _)| Some(((*name).to_owned(), gains.get(name)?))).collect();
    let kept = TrialAttributes::of(trial);
    let fits = |verdict: &Verdict| match trial.state {
        TrialState::Complete => *verdict != Verdict::Void,
        TrialState::Fail | TrialState::Pruned => *verdict == Verdict::Void,
        TrialState::Running | TrialState::Waiting => true,
    };
    let of_state = match trial.state {
        TrialState::Complete => Some(Verdict::Accept),
        TrialState::Fail | TrialState::Pruned => Some(Verdict::Void),
        TrialState::Running | TrialState::Waiting => None,
    };
    // A point that was removed from the queue was never begun: it has the values that were given.
    let given = trial.fixed();
    // As the gains above.
    let names = order.iter().map(|p| p.name.as_str()).chain(GAIN_UNITS.iter().map(|(name, _)| *name));
    let proposed = names.filter_map(|name| Some((name.to_owned(), kept.proposed.get(name)?))).collect();
    let parameter = |name: &str| trial.parameter(name).or_else(|| value_of(&given, name));
    // A verdict that can still be taken back has its value already.
    let judged = trial.state == TrialState::Running && matches!(kept.verdict, Some(Verdict::Accept | Verdict::Fall));
    // A verdict that does not fit the trial's state was overruled by another program.
    let verdict = kept.verdict.filter(fits);
    let pruned = (trial.state == TrialState::Pruned).then(|| PRUNED.to_owned());
    let cause = kept.cause.or(pruned).unwrap_or_default();
    // A change of the verdict leaves the attributes of the trial as they were.
    let changed = is_changed_verdict(&cause).then_some(JudgedBy::Operator);
    let elsewhere = !trial.user_attributes.contains_key("source") && worker_of(trial).is_none();
    TrialRecord {
        trial: trial.number,
        source: if elsewhere && trial.state != TrialState::Waiting { ProposalSource::OtherProgram } else { source },
        parent,
        parameters: order.iter().filter_map(|p| Some((p.name.clone(), parameter(&p.name)?))).collect(),
        measured: parse(&trial.user_attributes, &|_| true),
        value: trial.value.or(kept.value.filter(|_| judged)),
        hand_value: kept.hand_value,
        suggested: kept.suggested,
        cause,
        verdict: verdict.or(of_state),
        judged_by: verdict.and(changed.or(kept.judged_by)),
        note,
        risk: kept.risk,
        expected: parse(&trial.user_attributes, &|_| true),
        gains,
        repeats,
        seed,
        ranges: ranges_of(trial),
        proposed,
    }
}

/// Returns the ranges from which the parameters of a trial were drawn.
pub fn ranges_of(trial: &Trial) -> Vec<DrawnRange> {
    let pairs = trial.parameters.iter().zip(&trial.distributions);
    let ranges = pairs.filter_map(|((name, _), distribution)| {
        let range = distribution.range()?;
        Some(DrawnRange { name: name.clone(), low: range.low, high: range.high })
    });
    ranges.collect()
}

/// Reads attributes; those of another type are left out.
pub(super) fn read<T: DeserializeOwned + Default>(attributes: &BTreeMap<String, Value>) -> T {
    let fits = |name: &str| parse::<T>(attributes, &|other| other == name).is_some();
    parse(attributes, &|_| true).or_else(|| parse(attributes, &fits)).unwrap_or_default()
}

/// Reads the attributes whose names are `kept`; none if one is missing or of another type. It has one form for each type: the
/// compiled form is long.
fn parse<T: DeserializeOwned>(attributes: &BTreeMap<String, Value>, kept: &dyn Fn(&str) -> bool) -> Option<T> {
    let pairs = attributes.iter().map(|(name, value)| (name.as_str(), value)).filter(|(name, _)| kept(name));
    let pairs: Vec<(&str, &Value)> = pairs.collect();
    T::deserialize(MapDeserializer::<_, serde_json::Error>::new(pairs.into_iter())).ok()
}

/// Returns the fields of `attributes` in their order; a [`Value`] would sort them.
pub fn write(attributes: &impl Serialize) -> Attributes {
    let text = serde_json::to_string(attributes).and_then(|text| serde_json::from_str::<InOrder<Value>>(&text));
    text.expect("attributes are a struct with text keys").0
}

fn is_empty(values: &ParameterValues) -> bool {
    (**values).is_empty()
}

fn as_object<S: Serializer>(values: &ParameterValues, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(values.iter().map(|(name, value)| (name, value)))
}

/// Reads the numbers of an object; empty where it is none.
fn numbers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ParameterValues, D::Error> {
    let Value::Object(map) = Value::deserialize(deserializer)? else { return Ok(ParameterValues::default()) };
    Ok(map.iter().filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect())
}
