//! What of a trial is kept in the study as attributes, so that the study alone tells the whole story: names, and both ways
//! between attributes and rows of the table.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::optimize::study::{DRAWS, Outcome};
use crate::optimize::trial::{GAINS, Trial, TrialState};
use crate::trial::{FallRisk, MeasuredJump, ParameterInfo, Proposal, ProposalSource, TrialRecord, Verdict};

const SOURCE: &str = "source";
const PARENT: &str = "parent";
const SEED: &str = "seed";
const RECORDING: &str = "recording";
const VERSION: &str = "version";
const VERDICT: &str = "verdict";
const SUGGESTED: &str = "suggested";
const CAUSE: &str = "cause";
const VALUE: &str = "value";
const HAND_VALUE: &str = "hand_value";
const RERUN: &str = "rerun";
const INTERRUPTED: &str = "interrupted";
const RISK: &str = "risk";
const FIXED: &str = "fixed";
const WORKER: &str = "worker";

type Attributes = Vec<(String, Value)>;

/// Where a queued point comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// Who chose it.
    pub source: ProposalSource,
    /// The trial that it repeats.
    pub parent: Option<u32>,
    /// The seed that it is to run with; none for one of its own.
    pub seed: Option<u64>,
    /// The gains that it is to run with; empty for those of the configuration.
    pub gains: Vec<(String, f64)>,
}

impl Origin {
    /// The sampler's own.
    pub fn sampler() -> Origin {
        Origin { source: ProposalSource::Sampler, parent: None, seed: None, gains: Vec::new() }
    }

    /// A point that somebody queued.
    pub fn queued() -> Origin {
        Origin { source: ProposalSource::Queued, ..Origin::sampler() }
    }

    /// A repetition with the same gains and with noise of its own. What confirmed the best still does.
    pub fn rerun_of(row: &TrialRecord) -> Origin {
        let source =
            if row.source == ProposalSource::Confirm { ProposalSource::Confirm } else { ProposalSource::Rerun };
        Origin { source, parent: Some(row.trial), seed: None, gains: row.gains.clone() }
    }

    /// A repeat of a point that may be the best, with the gains of its first trial.
    pub fn confirming(first: &Trial) -> Origin {
        Origin { source: ProposalSource::Confirm, parent: Some(first.number), seed: None, gains: gains_of(first) }
    }

    /// The same trial once more, after a crash, as if nothing had happened.
    pub fn interrupted(trial: &Trial) -> Origin {
        let confirms = source_of(trial) == ProposalSource::Confirm;
        let source = if confirms { ProposalSource::Confirm } else { ProposalSource::Rerun };
        Origin { source, parent: Some(trial.number), seed: seed_of(trial), gains: gains_of(trial) }
    }

    /// As kept with the queued trial; without attributes it was queued by another program.
    pub fn of(attributes: &BTreeMap<String, Value>) -> Origin {
        Origin {
            source: named(attributes.get(SOURCE), ProposalSource::ALL, ProposalSource::name)
                .unwrap_or(ProposalSource::Queued),
            parent: number(attributes.get(PARENT)),
            seed: attributes.get(SEED).and_then(seed_from),
            gains: numbers(attributes.get(GAINS)),
        }
    }

    /// To be kept with the queued trial.
    pub fn attributes(&self) -> Attributes {
        let mut kept = vec![(SOURCE.to_owned(), json!(self.source.name()))];
        if let Some(parent) = self.parent {
            kept.push((PARENT.to_owned(), json!(parent)));
        }
        if let Some(seed) = self.seed {
            kept.push((SEED.to_owned(), seed_text(seed)));
        }
        if !self.gains.is_empty() {
            kept.push((GAINS.to_owned(), object(&self.gains)));
        }
        kept
    }
}

/// What the study is to be told of a running trial whose verdict was on disk when the program ended; none without one.
pub fn judgement_of(trial: &Trial) -> Option<Outcome> {
    let kept = &trial.user_attributes;
    match named(kept.get(VERDICT), Verdict::ALL, Verdict::name)? {
        Verdict::Void => Some(Outcome::Fail),
        Verdict::Accept | Verdict::Fall => kept.get(VALUE).and_then(Value::as_f64).map(Outcome::Complete),
    }
}

/// What is kept when a trial begins.
pub fn began(proposal: &Proposal, began: &Began<'_>) -> Attributes {
    let gains = proposal.gains.iter().map(|gain| (gain.name.clone(), gain.value)).collect();
    let origin = Origin { source: proposal.source, parent: proposal.parent, seed: Some(began.seed), gains };
    let mut kept = origin.attributes();
    kept.push((VERSION.to_owned(), json!(env!("CARGO_PKG_VERSION"))));
    kept.push((WORKER.to_owned(), json!(began.worker)));
    if !began.recording.is_empty() {
        kept.push((RECORDING.to_owned(), json!(began.recording)));
    }
    if let Some(risk) = &proposal.risk {
        kept.push((RISK.to_owned(), json!(risk)));
    }
    if !began.fixed.is_empty() {
        kept.push((FIXED.to_owned(), object(began.fixed)));
    }
    kept
}

/// What is kept with a trial besides its proposal.
pub struct Began<'a> {
    /// Its seed.
    pub seed: u64,
    /// Who runs it: 0 is the session that has the study's folder.
    pub worker: u32,
    /// Where it is recorded; empty where it is not.
    pub recording: &'a str,
    /// Parameters that the operator had fixed for some trials.
    pub fixed: &'a [(String, f64)],
}

/// What is kept when a trial is judged; a verdict that was taken back is kept as null.
pub fn judged(row: &TrialRecord, rerun: bool) -> Attributes {
    let mut kept = vec![
        (VERDICT.to_owned(), json!(row.verdict.map(Verdict::name))),
        (SUGGESTED.to_owned(), json!(row.suggested.map(Verdict::name))),
        (CAUSE.to_owned(), json!(row.cause)),
        (VALUE.to_owned(), json!(row.value)),
        (HAND_VALUE.to_owned(), json!(row.hand_value)),
        (RERUN.to_owned(), json!(rerun)),
    ];
    if let Some(MeasuredJump { dx_m, dy_m, dyaw_rad, apex_m, air_s }) = row.measured {
        // Numeric columns of their own, so that the dashboard can sort by them.
        let terms = [("dx_m", dx_m), ("dy_m", dy_m), ("dyaw_rad", dyaw_rad), ("apex_m", apex_m), ("air_s", air_s)];
        kept.extend(terms.map(|(name, value)| (name.to_owned(), json!(value))));
    }
    kept
}

/// What is kept of a trial whose program ended before the verdict.
pub fn interrupted(cause: &str) -> Attributes {
    vec![
        (VERDICT.to_owned(), json!(Verdict::Void.name())),
        (CAUSE.to_owned(), json!(cause)),
        (RERUN.to_owned(), json!(true)),
        (INTERRUPTED.to_owned(), json!(true)),
    ]
}

/// What of the attributes still holds in another study: not its numbers, and no debt.
pub fn elsewhere(mut attributes: Map<String, Value>) -> Map<String, Value> {
    for name in [PARENT, WORKER, RERUN, INTERRUPTED] {
        attributes.remove(name);
    }
    attributes
}

/// Whether the parameters of a finished trial are to come again.
pub fn is_owed(trial: &Trial) -> bool {
    trial.state == TrialState::Fail && trial.user_attributes.get(RERUN).and_then(Value::as_bool) == Some(true)
}

/// Whether a trial is void because its program ended before the verdict.
pub fn was_interrupted(trial: &Trial) -> bool {
    trial.user_attributes.get(INTERRUPTED).and_then(Value::as_bool) == Some(true)
}

/// Who chose a trial's parameters.
pub fn source_of(trial: &Trial) -> ProposalSource {
    named(trial.user_attributes.get(SOURCE), ProposalSource::ALL, ProposalSource::name)
        .unwrap_or(ProposalSource::Queued)
}

/// The gains that a trial ran with; empty where nobody has kept them.
pub fn gains_of(trial: &Trial) -> Vec<(String, f64)> {
    numbers(trial.user_attributes.get(GAINS))
}

/// Whether `name` was fixed at `value` for this trial.
pub fn was_fixed(trial: &Trial, name: &str, value: f64) -> bool {
    numbers(trial.user_attributes.get(FIXED)).iter().any(|(n, v)| n == name && *v == value)
}

/// Which worker of this program runs a trial; none for a trial of another program.
pub fn worker_of(trial: &Trial) -> Option<u32> {
    trial.system_attributes.get(DRAWS)?;
    Some(number(trial.user_attributes.get(WORKER)).unwrap_or(0))
}

/// The seed that a trial ran with.
pub fn seed_of(trial: &Trial) -> Option<u64> {
    trial.user_attributes.get(SEED).and_then(seed_from)
}

/// The row of a trial that is in the study. A trial of another program has no verdict of its own: if it is complete, it
/// counts as accepted.
pub fn row_of(trial: &Trial, note: String, order: &[ParameterInfo]) -> TrialRecord {
    let kept = &trial.user_attributes;
    let number_of = |name: &str| kept.get(name).and_then(Value::as_f64);
    let origin = Origin::of(kept);
    let measured = (|| {
        Some(MeasuredJump {
            dx_m: number_of("dx_m")?,
            dy_m: number_of("dy_m")?,
            dyaw_rad: number_of("dyaw_rad")?,
            apex_m: number_of("apex_m")?,
            air_s: number_of("air_s")?,
        })
    })();
    let default_verdict = match trial.state {
        TrialState::Complete => Some(Verdict::Accept),
        TrialState::Fail | TrialState::Pruned => Some(Verdict::Void),
        TrialState::Running | TrialState::Waiting => None,
    };
    TrialRecord {
        trial: trial.number,
        source: origin.source,
        parent: origin.parent,
        parameters: order.iter().filter_map(|p| Some((p.name.clone(), trial.parameter(&p.name)?))).collect(),
        measured,
        value: trial.value,
        hand_value: number_of(HAND_VALUE),
        suggested: named(kept.get(SUGGESTED), Verdict::ALL, Verdict::name),
        cause: kept.get(CAUSE).and_then(Value::as_str).unwrap_or_default().to_owned(),
        // A verdict of ours that fits how the trial ended; otherwise another program ended it, and theirs stands.
        verdict: named(kept.get(VERDICT), Verdict::ALL, Verdict::name)
            .filter(|verdict| match trial.state {
                TrialState::Complete => *verdict != Verdict::Void,
                TrialState::Fail | TrialState::Pruned => *verdict == Verdict::Void,
                TrialState::Running | TrialState::Waiting => true,
            })
            .or(default_verdict),
        note,
        risk: kept.get(RISK).and_then(|risk| serde_json::from_value::<FallRisk>(risk.clone()).ok()),
        gains: gains_of(trial),
    }
}

/// Numbers by name, as an attribute.
pub fn object(list: &[(String, f64)]) -> Value {
    Value::Object(list.iter().map(|(name, value)| (name.clone(), json!(value))).collect())
}

/// Numbers by name of an attribute; empty where it is none.
pub fn numbers(value: Option<&Value>) -> Vec<(String, f64)> {
    let Some(Value::Object(map)) = value else { return Vec::new() };
    map.iter().filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

/// A seed as text: JSON numbers of other programs do not hold 64 bits.
fn seed_text(seed: u64) -> Value {
    json!(seed.to_string())
}

fn seed_from(value: &Value) -> Option<u64> {
    value.as_str()?.parse().ok()
}

fn number(value: Option<&Value>) -> Option<u32> {
    u32::try_from(value?.as_u64()?).ok()
}

fn named<T: Copy, const N: usize>(value: Option<&Value>, all: [T; N], name: fn(T) -> &'static str) -> Option<T> {
    let text = value?.as_str()?;
    all.into_iter().find(|item| name(*item) == text)
}
