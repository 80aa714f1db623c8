//! Proposals and trials as protobuf messages, and back.

use super::decode::{DecodeError, number, one_of};
use super::frog;
use crate::trial::{FallRisk, MeasuredJump, Proposal, ProposalSource, ProposedParameter, TrialRecord, Verdict};

pub fn proposal(value: &Proposal) -> frog::Proposal {
    let parameter = |parameter: &ProposedParameter| frog::proposal::Parameter {
        name: parameter.name.clone(),
        value: Some(parameter.value),
        proposed: Some(parameter.proposed),
    };
    frog::Proposal {
        trial: value.trial,
        revision: value.revision,
        source: value.source as i32,
        parent: value.parent,
        parameters: value.parameters.iter().map(parameter).collect(),
        risk: value.risk.as_ref().map(risk),
        gains: value.gains.iter().map(parameter).collect(),
    }
}

pub fn from_proposal(message: frog::Proposal) -> Result<Proposal, DecodeError> {
    let parameter = |parameter: frog::proposal::Parameter| ProposedParameter {
        name: parameter.name,
        value: number(parameter.value),
        proposed: number(parameter.proposed),
    };
    Ok(Proposal {
        trial: message.trial,
        revision: message.revision,
        source: one_of(&ProposalSource::ALL, "source", message.source)?,
        parent: message.parent,
        parameters: message.parameters.into_iter().map(parameter).collect(),
        risk: message.risk.map(from_risk),
        gains: message.gains.into_iter().map(parameter).collect(),
    })
}

pub fn trial(value: &TrialRecord) -> frog::Trial {
    let parameter = |(name, value): &(String, f64)| frog::trial::Parameter { name: name.clone(), value: Some(*value) };
    let measured = |measured: &MeasuredJump| frog::trial::Measured {
        dx: Some(measured.dx_m),
        dy: Some(measured.dy_m),
        dyaw: Some(measured.dyaw_rad),
        apex: Some(measured.apex_m),
        air: Some(measured.air_s),
    };
    frog::Trial {
        trial: value.trial,
        source: value.source as i32,
        parent: value.parent,
        parameters: value.parameters.iter().map(parameter).collect(),
        measured: value.measured.as_ref().map(measured),
        value: value.value,
        hand_value: value.hand_value,
        suggested: value.suggested.map(|verdict| verdict as i32),
        cause: value.cause.clone(),
        verdict: value.verdict.map(|verdict| verdict as i32),
        note: value.note.clone(),
        risk: value.risk.as_ref().map(risk),
        gains: value.gains.iter().map(parameter).collect(),
    }
}

pub fn from_trial(message: frog::Trial) -> Result<TrialRecord, DecodeError> {
    let verdict = |verdict: Option<i32>| verdict.map(|verdict| one_of(&Verdict::ALL, "verdict", verdict)).transpose();
    let measured = |measured: frog::trial::Measured| MeasuredJump {
        dx_m: number(measured.dx),
        dy_m: number(measured.dy),
        dyaw_rad: number(measured.dyaw),
        apex_m: number(measured.apex),
        air_s: number(measured.air),
    };
    let parameter = |parameter: frog::trial::Parameter| (parameter.name, number(parameter.value));
    Ok(TrialRecord {
        trial: message.trial,
        source: one_of(&ProposalSource::ALL, "source", message.source)?,
        parent: message.parent,
        parameters: message.parameters.into_iter().map(parameter).collect(),
        measured: message.measured.map(measured),
        value: message.value,
        hand_value: message.hand_value,
        suggested: verdict(message.suggested)?,
        cause: message.cause,
        verdict: verdict(message.verdict)?,
        note: message.note,
        risk: message.risk.map(from_risk),
        gains: message.gains.into_iter().map(parameter).collect(),
    })
}

fn risk(risk: &FallRisk) -> frog::Risk {
    frog::Risk {
        nearest_fall: risk.nearest_fall,
        nearest_fall_trial: risk.nearest_fall_trial,
        falls: risk.falls,
        neighbours: risk.neighbours,
    }
}

fn from_risk(message: frog::Risk) -> FallRisk {
    FallRisk {
        nearest_fall: message.nearest_fall,
        nearest_fall_trial: message.nearest_fall_trial,
        falls: message.falls,
        neighbours: message.neighbours,
    }
}
