//! Records as protobuf messages, and back.

use foxglove::messages::{Log, log};
use prost::Message;
use prost::encoding::{DecodeContext, WireType, decode_key, skip_field};

use super::record::{
    ArmingCheckRecord, HealthLimits, LogLevel, LogRecord, Record, RequestRecord, SessionInfo, StageRecord, Transition,
};
use super::topic::Topic;
use super::wire::{DecodeError, Way, decoded, encoded, one_of};
use super::{frog, tick, trials};
use crate::robot::LinkStatus;
use crate::telemetry::{Counters, Tick};
use crate::trial::ParameterInfo;

/// Most ticks of a fault. The recorder writes `recorder::FAULT_TICKS`, 200.
const MOST_FAULT_TICKS: usize = 1_000;

/// Largest message that is decoded, bytes, but for the ticks of a fault, which are decoded one at a time. An empty element of a list
/// takes 2 bytes in the message and up to 64 in memory. The longest own message lists every trial of a study, 22 bytes each.
const LARGEST_RECORD: usize = 1024 * 1024;

/// Encodes a record into `buffer` and returns its topic. `start_utc_ns` is the log time of engine time 0, ns.
pub fn encode(record: &Record, start_utc_ns: u64, log_time: u64, buffer: &mut Vec<u8>) -> Topic {
    buffer.clear();
    let (topic, written) = match record {
        Record::Session(info) => {
            (Topic::Session, frog::Session { start_utc_ns, ..encoded(session, info) }.encode(buffer))
        }
        Record::Transition(Transition { from, to, cause }) => {
            let message = frog::Transition { from: *from as i32, to: *to as i32, cause: cause.clone() };
            (Topic::Transition, message.encode(buffer))
        }
        Record::Stage(value) => (Topic::Stage, encoded(stage, value).encode(buffer)),
        Record::Proposal(value) => (Topic::Proposal, encoded(trials::proposal, value).encode(buffer)),
        Record::Trial(value) => (Topic::Trial, encoded(trials::trial, value).encode(buffer)),
        Record::Request(value) => (Topic::Command, encoded(request, value).encode(buffer)),
        Record::Counters(value) => (Topic::Counters, encoded(counters, value).encode(buffer)),
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
        Record::Search(value) => (Topic::Search, encoded(trials::search, value).encode(buffer)),
        Record::Insight(value) => (Topic::Insight, encoded(trials::insight, value).encode(buffer)),
        Record::Points(value) => (Topic::Points, encoded(trials::points, value).encode(buffer)),
    };
    written.expect("a Vec grows as needed");
    topic
}

/// Decodes the record of a message; none on a topic that holds no records.
pub fn decode(topic: Topic, data: &[u8]) -> Result<Option<Record>, DecodeError> {
    if topic != Topic::Fault && topic.is_event() && data.len() > LARGEST_RECORD {
        return Err(DecodeError::TooLong(data.len(), LARGEST_RECORD));
    }
    Ok(Some(match topic {
        Topic::Session => Record::Session(decoded(session, frog::Session::decode(data)?)?),
        Topic::Transition => {
            let frog::Transition { from, to, cause } = frog::Transition::decode(data)?;
            Record::Transition(Transition { from: one_of("mode", from)?, to: one_of("mode", to)?, cause })
        }
        Topic::Stage => Record::Stage(decoded(stage, frog::StageInfo::decode(data)?)?),
        Topic::Proposal => Record::Proposal(decoded(trials::proposal, frog::Proposal::decode(data)?)?),
        Topic::Trial => Record::Trial(decoded(trials::trial, frog::Trial::decode(data)?)?),
        Topic::Command => Record::Request(decoded(request, frog::OperatorCommand::decode(data)?)?),
        Topic::Counters => Record::Counters(decoded(counters, frog::Counters::decode(data)?)?),
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
        Topic::Fault => Record::FaultTicks(fault_ticks(data)?),
        Topic::PreArm => {
            let item = |item: frog::pre_arm::Item| {
                let (check, state) = (one_of("check", item.check)?, one_of("state of a check", item.state)?);
                Ok(ArmingCheckRecord { check, state, found: item.found, needed: item.needed })
            };
            let items = frog::PreArm::decode(data)?.items;
            Record::ArmingChecks(items.into_iter().map(item).collect::<Result<_, DecodeError>>()?)
        }
        Topic::Search => Record::Search(decoded(trials::search, frog::Search::decode(data)?)?),
        Topic::Insight => Record::Insight(decoded(trials::insight, frog::Insight::decode(data)?)?),
        Topic::Points => Record::Points(decoded(trials::points, frog::Points::decode(data)?)?),
        Topic::JointStates
        | Topic::JointCommand
        | Topic::Tick
        | Topic::Pose
        | Topic::Tf
        | Topic::Marker
        | Topic::RobotScene
        | Topic::GroundScene => {
            return Ok(None);
        }
    }))
}

/// Decodes the ticks of a `frog.v1.FaultTicks` one at a time: a tick of 2 bytes in the message takes over a thousand in memory.
///
/// # Errors
/// At the first tick that cannot be read, or that is one too many.
fn fault_ticks(mut message: &[u8]) -> Result<Vec<Tick>, DecodeError> {
    /// Number of the field `ticks` in `proto/frog.proto`.
    const TICKS: u32 = 1;
    let mut ticks = Vec::new();
    while !message.is_empty() {
        let (field, wire_type) = decode_key(&mut message)?;
        if (field, wire_type) != (TICKS, WireType::LengthDelimited) {
            skip_field(wire_type, field, &mut message, DecodeContext::default())?;
        } else if ticks.len() == MOST_FAULT_TICKS {
            return Err(DecodeError::TooMany("ticks of a fault", MOST_FAULT_TICKS));
        } else {
            ticks.push(tick::from_whole(frog::fault_ticks::Whole::decode_length_delimited(&mut message)?)?);
        }
    }
    Ok(ticks)
}

fn stage(way: Way, ours: &mut StageRecord, m: &mut frog::StageInfo) -> Result<(), DecodeError> {
    way.variant(&mut ours.stage, &mut m.stage, "stage")?;
    way.copy(&mut ours.trial, &mut m.trial);
    way.copy(&mut ours.can_undo, &mut m.can_undo);
    way.copy(&mut ours.jumps, &mut m.jumps);
    Ok(())
}

fn request(way: Way, ours: &mut RequestRecord, m: &mut frog::OperatorCommand) -> Result<(), DecodeError> {
    way.copy(&mut ours.request, &mut m.wish);
    way.copy(&mut ours.accepted, &mut m.accepted);
    way.copy(&mut ours.answer, &mut m.answer);
    Ok(())
}

/// All but the time of the start, which is the writer's.
fn session(way: Way, ours: &mut SessionInfo, m: &mut frog::Session) -> Result<(), DecodeError> {
    way.copy(&mut ours.version, &mut m.version);
    way.copy(&mut ours.robot, &mut m.robot);
    way.copy(&mut ours.unit, &mut m.unit);
    way.copy(&mut ours.seed, &mut m.seed);
    way.copy(&mut ours.budget, &mut m.budget);
    way.list(&mut ours.parameters, &mut m.parameters, bounds)?;
    way.copy(&mut ours.study, &mut m.study);
    way.copy(&mut ours.recording, &mut m.recording);
    way.copy(&mut ours.started, &mut m.started);
    way.copy(&mut ours.observe, &mut m.observe);
    way.list(&mut ours.gains, &mut m.gains, bounds)?;
    way.copy(&mut ours.commit, &mut m.commit);
    way.copy(&mut ours.host, &mut m.host);
    way.copy(&mut ours.operator, &mut m.operator);
    way.values(&mut ours.configured_gains, &mut m.configured_gains);
    match way {
        Way::Encode => {
            m.backend = ours.backend_name().to_owned();
            m.task = ours.task_name().to_owned();
            m.sampler = ours.sampler_name().to_owned();
            m.approve = ours.approve.name().to_owned();
            m.limits = Some(encoded(health_limits, &ours.limits));
        }
        Way::Decode => {
            ours.backend = m.backend.parse().ok();
            ours.task = m.task.parse().ok();
            ours.sampler = m.sampler.parse().ok();
            ours.approve = m.approve.parse().unwrap_or_default();
            ours.limits = m.limits.take().map(|m| decoded(health_limits, m)).transpose()?.unwrap_or_default();
        }
    }
    Ok(())
}

fn bounds(way: Way, ours: &mut ParameterInfo, m: &mut frog::Bounds) -> Result<(), DecodeError> {
    way.copy(&mut ours.name, &mut m.name);
    way.copy(&mut ours.unit, &mut m.unit);
    way.number(&mut ours.low, &mut m.low);
    way.number(&mut ours.high, &mut m.high);
    Ok(())
}

fn health_limits(way: Way, ours: &mut HealthLimits, m: &mut frog::HealthLimits) -> Result<(), DecodeError> {
    way.copy(&mut ours.state_age_ms, &mut m.state_age_ms);
    way.number(&mut ours.loss_share, &mut m.loss_share);
    way.number(&mut ours.motor_c, &mut m.motor_c);
    way.number(&mut ours.battery_percent, &mut m.battery_percent);
    way.number(&mut ours.late_share, &mut m.late_share);
    way.number(&mut ours.late_ms, &mut m.late_ms);
    Ok(())
}

fn counters(way: Way, ours: &mut Counters, m: &mut frog::Counters) -> Result<(), DecodeError> {
    way.copy(&mut ours.late_ticks, &mut m.late_ticks);
    way.copy(&mut ours.worst_lateness_ns, &mut m.worst_lateness_ns);
    way.copy(&mut ours.ticks_not_recorded, &mut m.ticks_not_recorded);
    way.copy(&mut ours.ticks_not_shown, &mut m.ticks_not_shown);
    way.copy(&mut ours.commands_refused, &mut m.commands_refused);
    way.copy(&mut ours.state_age_ms, &mut m.state_age_ms);
    way.option(&mut ours.link, &mut m.link, link)
}

fn link(way: Way, ours: &mut LinkStatus, m: &mut frog::Link) -> Result<(), DecodeError> {
    way.copy(&mut ours.received, &mut m.received);
    way.copy(&mut ours.lost, &mut m.lost);
    way.copy(&mut ours.out_of_order, &mut m.late);
    way.copy(&mut ours.duplicate, &mut m.duplicate);
    way.copy(&mut ours.corrupt, &mut m.corrupt);
    way.copy(&mut ours.wrong_length, &mut m.wrong_length);
    way.copy(&mut ours.foreign, &mut m.foreign);
    way.copy(&mut ours.reboots, &mut m.reboots);
    way.copy(&mut ours.sent, &mut m.sent);
    way.copy(&mut ours.send_errors, &mut m.send_errors);
    way.copy(&mut ours.state_age_ms, &mut m.state_age_ms);
    way.copy(&mut ours.rate_hz, &mut m.rate_hz);
    way.copy(&mut ours.recent_received, &mut m.recent_received);
    way.copy(&mut ours.recent_lost, &mut m.recent_lost);
    way.copy(&mut ours.recent_corrupt, &mut m.recent_corrupt);
    way.copy(&mut ours.foreign_commands, &mut m.foreign_commands);
    Ok(())
}
