//! State of the optimizer (search, insight, points) as protobuf messages, and back.

use super::decode::number;
use super::frog;
use crate::trial::{FixedParameter, ParameterInsight, PointRecord, ProposalInsight, SearchStatus, SearchedParameter};

pub fn search(value: &SearchStatus) -> frog::Search {
    let parameter = |parameter: &SearchedParameter| frog::search::Parameter {
        name: parameter.name.clone(),
        low: Some(parameter.low),
        high: Some(parameter.high),
        least: Some(parameter.least),
        most: Some(parameter.most),
        fixed: parameter.fixed.map(|fixed| frog::search::Fixed { value: Some(fixed.value), trials: fixed.trials }),
    };
    frog::Search {
        budget: value.budget,
        counted: value.counted,
        parameters: value.parameters.iter().map(parameter).collect(),
        confirming: value.confirming,
    }
}

pub fn from_search(message: frog::Search) -> SearchStatus {
    let parameter = |parameter: frog::search::Parameter| SearchedParameter {
        name: parameter.name,
        low: number(parameter.low),
        high: number(parameter.high),
        least: number(parameter.least),
        most: number(parameter.most),
        fixed: parameter.fixed.map(|fixed| FixedParameter { value: number(fixed.value), trials: fixed.trials }),
    };
    SearchStatus {
        budget: message.budget,
        counted: message.counted,
        parameters: message.parameters.into_iter().map(parameter).collect(),
        confirming: message.confirming,
    }
}

pub fn insight(value: &ProposalInsight) -> frog::Insight {
    let parameter = |parameter: &ParameterInsight| frog::insight::Parameter {
        name: parameter.name.clone(),
        proposed: Some(parameter.proposed),
        importance: parameter.importance,
        at: parameter.at.clone(),
        good: parameter.good.clone(),
        bad: parameter.bad.clone(),
    };
    frog::Insight { trial: value.trial, parameters: value.parameters.iter().map(parameter).collect() }
}

pub fn from_insight(message: frog::Insight) -> ProposalInsight {
    let parameter = |parameter: frog::insight::Parameter| ParameterInsight {
        name: parameter.name,
        proposed: number(parameter.proposed),
        importance: parameter.importance,
        at: parameter.at,
        good: parameter.good,
        bad: parameter.bad,
    };
    ProposalInsight { trial: message.trial, parameters: message.parameters.into_iter().map(parameter).collect() }
}

pub fn points(value: &[PointRecord]) -> frog::Points {
    let parameter = |(name, value): &(String, f64)| frog::trial::Parameter { name: name.clone(), value: Some(*value) };
    let point = |point: &PointRecord| frog::points::Point {
        parameters: point.parameters.iter().map(parameter).collect(),
        trials: point.trials.clone(),
        stood: point.stood,
        mean: Some(point.mean),
        deviation: point.deviation,
        contender: point.contender,
        confidence: point.confidence,
    };
    frog::Points { points: value.iter().map(point).collect() }
}

pub fn from_points(message: frog::Points) -> Vec<PointRecord> {
    let parameter = |parameter: frog::trial::Parameter| (parameter.name, number(parameter.value));
    let point = |point: frog::points::Point| PointRecord {
        parameters: point.parameters.into_iter().map(parameter).collect(),
        trials: point.trials,
        stood: point.stood,
        mean: number(point.mean),
        deviation: point.deviation,
        contender: point.contender,
        confidence: point.confidence,
    };
    message.points.into_iter().map(point).collect()
}
