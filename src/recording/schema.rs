//! Records as protobuf messages, and back.

use foxglove::messages::{Log, log};
use prost::Message;

use super::decode::{DecodeError, number, one_of};
use super::record::{
    ArmingCheckRecord, HealthLimits, LogLevel, LogRecord, Record, RequestRecord, SessionInfo, StageRecord, Transition,
};
use super::topic::Topic;
use super::{frog, optimizing, tick, trials};
use crate::optimize::ask::SamplerKind;
use crate::robot::LinkStatus;
use crate::telemetry::{ArmingCheck, ArmingCheckState, Counters, Mode};
use crate::trial::{ExperimentStage, ParameterInfo};

/// Encodes a record into `buffer` and returns its topic. `start_utc_ns` is the log time of engine time 0, ns.
pub fn encode(record: &Record, start_utc_ns: u64, log_time: u64, buffer: &mut Vec<u8>) -> Topic {
    buffer.clear();
    let (topic, encoded) = match record {
        Record::Session(info) => (Topic::Session, session(info, start_utc_ns).encode(buffer)),
        Record::Transition(transition) => {
            let message = frog::Transition {
                from: transition.from as i32,
                to: transition.to as i32,
                cause: transition.cause.clone(),
            };
            (Topic::Transition, message.encode(buffer))
        }
        Record::Stage(StageRecord { stage, trial, can_undo }) => {
            let message = frog::StageInfo { stage: *stage as i32, trial: *trial, can_undo: *can_undo };
            (Topic::Stage, message.encode(buffer))
        }
        Record::Proposal(value) => (Topic::Proposal, trials::proposal(value).encode(buffer)),
        Record::Trial(value) => (Topic::Trial, trials::trial(value).encode(buffer)),
        Record::Request(RequestRecord { wish, accepted, answer }) => {
            let message = frog::OperatorCommand { wish: wish.clone(), accepted: *accepted, answer: answer.clone() };
            (Topic::Command, message.encode(buffer))
        }
        Record::Counters(counters) => {
            let message = frog::Counters {
                late_ticks: counters.late_ticks,
                worst_lateness_ns: counters.worst_lateness_ns,
                ticks_not_recorded: counters.ticks_not_recorded,
                ticks_not_shown: counters.ticks_not_shown,
                commands_refused: counters.commands_refused,
                state_age_ms: counters.state_age_ms,
                link: counters.link.as_ref().map(link),
            };
            (Topic::Counters, message.encode(buffer))
        }
        Record::Log(LogRecord { level, source, message }) => {
            let level = match level {
                LogLevel::Info => log::Level::Info,
                LogLevel::Warning => log::Level::Warning,
                LogLevel::Error => log::Level::Error,
            };
            let message = Log {
                timestamp: Some(tick::timestamp(log_time)),
                level: level as i32,
                message: message.clone(),
                name: source.clone(),
                ..Log::default()
            };
            (Topic::Log, message.encode(buffer))
        }
        Record::FaultTicks(ticks) => {
            let message = frog::FaultTicks { ticks: ticks.iter().map(tick::whole).collect() };
            (Topic::Fault, message.encode(buffer))
        }
        Record::ArmingChecks(list) => {
            let item = |item: &ArmingCheckRecord| frog::pre_arm::Item {
                check: item.check as i32,
                state: item.state as i32,
                found: item.found.clone(),
                needed: item.needed.clone(),
            };
            (Topic::PreArm, frog::PreArm { items: list.iter().map(item).collect() }.encode(buffer))
        }
        Record::Search(value) => (Topic::Search, optimizing::search(value).encode(buffer)),
        Record::Insight(value) => (Topic::Insight, optimizing::insight(value).encode(buffer)),
        Record::Points(value) => (Topic::Points, optimizing::points(value).encode(buffer)),
    };
    encoded.expect("a Vec grows as needed");
    topic
}

/// Decodes the record of a message; none on a topic that holds no records.
pub fn decode(topic: Topic, data: &[u8]) -> Result<Option<Record>, DecodeError> {
    Ok(Some(match topic {
        Topic::Session => Record::Session(from_session(frog::Session::decode(data)?)),
        Topic::Transition => {
            let message = frog::Transition::decode(data)?;
            Record::Transition(Transition {
                from: one_of(&Mode::ALL, "mode", message.from)?,
                to: one_of(&Mode::ALL, "mode", message.to)?,
                cause: message.cause,
            })
        }
        Topic::Stage => {
            let frog::StageInfo { stage, trial, can_undo } = frog::StageInfo::decode(data)?;
            Record::Stage(StageRecord { stage: one_of(&ExperimentStage::ALL, "stage", stage)?, trial, can_undo })
        }
        Topic::Proposal => Record::Proposal(trials::from_proposal(frog::Proposal::decode(data)?)?),
        Topic::Trial => Record::Trial(trials::from_trial(frog::Trial::decode(data)?)?),
        Topic::Command => {
            let frog::OperatorCommand { wish, accepted, answer } = frog::OperatorCommand::decode(data)?;
            Record::Request(RequestRecord { wish, accepted, answer })
        }
        Topic::Counters => {
            let message = frog::Counters::decode(data)?;
            Record::Counters(Counters {
                late_ticks: message.late_ticks,
                worst_lateness_ns: message.worst_lateness_ns,
                ticks_not_recorded: message.ticks_not_recorded,
                ticks_not_shown: message.ticks_not_shown,
                commands_refused: message.commands_refused,
                state_age_ms: message.state_age_ms,
                link: message.link.as_ref().map(from_link),
            })
        }
        Topic::Log => {
            let message = Log::decode(data)?;
            let level = match message.level() {
                log::Level::Unknown => return Err(DecodeError::Unknown("log level", message.level)),
                log::Level::Debug | log::Level::Info => LogLevel::Info,
                log::Level::Warning => LogLevel::Warning,
                log::Level::Error | log::Level::Fatal => LogLevel::Error,
            };
            Record::Log(LogRecord { level, source: message.name, message: message.message })
        }
        Topic::Fault => {
            let message = frog::FaultTicks::decode(data)?;
            Record::FaultTicks(message.ticks.iter().map(tick::from_whole).collect::<Result<_, _>>()?)
        }
        Topic::PreArm => {
            let item = |item: frog::pre_arm::Item| {
                Ok(ArmingCheckRecord {
                    check: one_of(ArmingCheck::ALL, "check", item.check)?,
                    state: one_of(ArmingCheckState::ALL, "state of a check", item.state)?,
                    found: item.found,
                    needed: item.needed,
                })
            };
            let items = frog::PreArm::decode(data)?.items;
            Record::ArmingChecks(items.into_iter().map(item).collect::<Result<_, DecodeError>>()?)
        }
        Topic::Search => Record::Search(optimizing::from_search(frog::Search::decode(data)?)),
        Topic::Insight => Record::Insight(optimizing::from_insight(frog::Insight::decode(data)?)),
        Topic::Points => Record::Points(optimizing::from_points(frog::Points::decode(data)?)),
        Topic::JointStates | Topic::JointCommand | Topic::Tick | Topic::Pose | Topic::Tf | Topic::Marker => {
            return Ok(None);
        }
    }))
}

fn session(info: &SessionInfo, start_utc_ns: u64) -> frog::Session {
    let bounds = |parameter: &ParameterInfo| frog::Bounds {
        name: parameter.name.clone(),
        unit: parameter.unit.clone(),
        low: Some(parameter.low),
        high: Some(parameter.high),
    };
    frog::Session {
        version: info.version.clone(),
        backend: info.backend_name().to_owned(),
        robot: info.robot.clone(),
        task: info.task_name().to_owned(),
        unit: info.unit.clone(),
        sampler: info.sampler_name().to_owned(),
        seed: info.seed,
        budget: info.budget,
        parameters: info.parameters.iter().map(bounds).collect(),
        study: info.study.clone(),
        recording: info.recording.clone(),
        started: info.started.clone(),
        observe: info.observe,
        start_utc_ns,
        gains: info.gains.iter().map(bounds).collect(),
        approve: info.approve.name().to_owned(),
        limits: Some(health_limits(&info.limits)),
    }
}

fn from_session(message: frog::Session) -> SessionInfo {
    let bounds = |bounds: frog::Bounds| ParameterInfo {
        name: bounds.name,
        unit: bounds.unit,
        low: number(bounds.low),
        high: number(bounds.high),
    };
    SessionInfo {
        version: message.version,
        backend: message.backend.parse().ok(),
        robot: message.robot,
        task: message.task.parse().ok(),
        unit: message.unit,
        sampler: SamplerKind::from_name(&message.sampler),
        seed: message.seed,
        budget: message.budget,
        parameters: message.parameters.into_iter().map(bounds).collect(),
        study: message.study,
        recording: message.recording,
        started: message.started,
        observe: message.observe,
        gains: message.gains.into_iter().map(bounds).collect(),
        approve: message.approve.parse().unwrap_or_default(),
        limits: message.limits.map_or_else(HealthLimits::default, |limits| from_health_limits(&limits)),
    }
}

fn health_limits(limits: &HealthLimits) -> frog::HealthLimits {
    frog::HealthLimits {
        state_age_ms: limits.state_age_ms,
        loss_share: Some(limits.loss_share),
        motor_c: Some(limits.motor_c),
        battery_percent: Some(limits.battery_percent),
        late_share: Some(limits.late_share),
        late_ms: Some(limits.late_ms),
    }
}

fn from_health_limits(message: &frog::HealthLimits) -> HealthLimits {
    HealthLimits {
        state_age_ms: message.state_age_ms,
        loss_share: number(message.loss_share),
        motor_c: number(message.motor_c),
        battery_percent: number(message.battery_percent),
        late_share: number(message.late_share),
        late_ms: number(message.late_ms),
    }
}

fn link(link: &LinkStatus) -> frog::Link {
    frog::Link {
        received: link.received,
        lost: link.lost,
        late: link.late,
        duplicate: link.duplicate,
        corrupt: link.corrupt,
        wrong_length: link.wrong_length,
        foreign: link.foreign,
        reboots: link.reboots,
        sent: link.sent,
        send_errors: link.send_errors,
        state_age_ms: link.state_age_ms,
        rate_hz: link.rate_hz,
        recent_received: link.recent_received,
        recent_lost: link.recent_lost,
        recent_corrupt: link.recent_corrupt,
    }
}

fn from_link(link: &frog::Link) -> LinkStatus {
    LinkStatus {
        received: link.received,
        lost: link.lost,
        late: link.late,
        duplicate: link.duplicate,
        corrupt: link.corrupt,
        wrong_length: link.wrong_length,
        foreign: link.foreign,
        reboots: link.reboots,
        sent: link.sent,
        send_errors: link.send_errors,
        state_age_ms: link.state_age_ms,
        rate_hz: link.rate_hz,
        recent_received: link.recent_received,
        recent_lost: link.recent_lost,
        recent_corrupt: link.recent_corrupt,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::Phase;
    use crate::trial::{ProposalSource, Verdict};

    /// `STAND UP` in the program is `STAND_UP` in the schema, `re-run` is `RE_RUN`.
    fn assert_named(name: &str, in_schema: Option<&str>) {
        assert_eq!(Some(name.to_uppercase().replace([' ', '-'], "_").as_str()), in_schema);
    }

    #[test]
    fn enums_are_numbered_as_in_the_schema() {
        for (number, mode) in (0..).zip(Mode::ALL.iter().copied()) {
            assert_eq!(mode as i32, number);
            assert_named(mode.name(), frog::control_tick::Mode::try_from(number).ok().map(|m| m.as_str_name()));
        }
        for (number, phase) in (0..).zip(Phase::ALL.iter().copied()) {
            assert_eq!(phase as i32, number);
            assert_named(phase.name(), frog::control_tick::Phase::try_from(number).ok().map(|p| p.as_str_name()));
        }
        for (number, stage) in (0..).zip(ExperimentStage::ALL) {
            assert_eq!(stage as i32, number);
            assert_named(stage.name(), frog::stage_info::Stage::try_from(number).ok().map(|s| s.as_str_name()));
        }
        for (number, source) in (0..).zip(ProposalSource::ALL) {
            assert_eq!(source as i32, number);
            assert_named(source.name(), frog::proposal::Source::try_from(number).ok().map(|s| s.as_str_name()));
        }
        for (number, verdict) in (0..).zip(Verdict::ALL) {
            assert_eq!(verdict as i32, number);
            assert_named(verdict.name(), frog::trial::Verdict::try_from(number).ok().map(|v| v.as_str_name()));
        }
        // Their names are sentences; their numbers and count are what matters.
        for (number, check) in (0..).zip(ArmingCheck::ALL.iter().copied()) {
            assert_eq!(check as i32, number);
            assert!(frog::pre_arm::Check::try_from(number).is_ok(), "{check:?}");
        }
        for (number, state) in (0..).zip(ArmingCheckState::ALL.iter().copied()) {
            assert_eq!(state as i32, number);
            assert_named(state.name(), frog::pre_arm::State::try_from(number).ok().map(|s| s.as_str_name()));
        }
    }
}
