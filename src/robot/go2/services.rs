//! The robot's services over DDS: takes the robot over from its own controller.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::dds::{DdsError, FoundEndpoint, Participant, TopicReader, TopicType, TopicWriter};
use super::handover::{FRESH_MS, Handover, HandoverError, HandoverStatus, ServiceRequest};
use super::message::{ResponseMessage, StateMessage, motion_switcher, sport};
use crate::robot::{JOINTS, Joints};

/// Wait between two looks at the topics.
pub(super) const LOOK: Duration = Duration::from_millis(10);
/// Time after which an endpoint that is not found is reported.
const DISCOVERY: Duration = Duration::from_secs(2);

/// Error of taking the robot over.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum TakeoverError {
    #[error(transparent)]
    Dds(#[from] DdsError),
    #[error("{0}{1}")]
    Handover(HandoverError, String),
    #[error("the robot's reader of commands demands reliable delivery: set dds.reliable_commands = true in robot.toml")]
    DemandsReliable,
    #[error("the robot does not read commands: {0}")]
    NoReader(String),
    #[error("interrupted by the operator")]
    Interrupted,
}

/// A takeover that failed.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
pub struct TakeoverFailure {
    /// Its cause.
    pub error: TakeoverError,
    /// Name of the controller to which a release was sent: it may be released. None if none was sent.
    pub released: Option<String>,
}

/// Request and response topics of one service.
pub(super) struct Service {
    name: &'static str,
    pub requests: TopicWriter,
    pub responses: TopicReader,
}

impl Service {
    pub fn open(participant: &Participant, name: &'static str) -> Result<Service, DdsError> {
        let responses = participant.reader(&TopicType::response(name))?;
        Ok(Service { name, requests: participant.writer(&TopicType::request(name))?, responses })
    }

    /// Takes the oldest response that can be decoded.
    pub fn response(&mut self) -> Option<ResponseMessage> {
        std::iter::from_fn(|| self.responses.take()).find_map(|sample| ResponseMessage::decode(&sample.payload).ok())
    }
}

/// Returns an identity for requests above those of earlier programs: the library of Unitree counts nanoseconds, too.
pub(super) fn first_id() -> i64 {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(1, |time| time.as_nanos() as i64)
}

/// The robot's states, and the newest of them.
pub(super) struct States {
    reader: TopicReader,
    newest: Option<NewestState>,
}

/// Joint positions of a state, and the time at which it came.
struct NewestState {
    received: Instant,
    tick: u32,
    position_rad: Joints,
}

impl States {
    pub fn open(participant: &Participant) -> Result<States, DdsError> {
        Ok(States { reader: participant.reader(&TopicType::low_state())?, newest: None })
    }

    /// Waits for states, at most [`LOOK`], and takes all that came. One that repeats the robot's time is not a new one.
    pub fn receive(&mut self) {
        self.reader.wait(LOOK);
        while let Some(sample) = self.reader.take() {
            let Ok(state) = StateMessage::decode(&sample.payload) else { continue };
            if self.newest.as_ref().is_none_or(|newest| newest.tick != state.tick) {
                let position_rad = std::array::from_fn::<f64, JOINTS, _>(|i| state.motor[i].position.into());
                self.newest = Some(NewestState { received: Instant::now(), tick: state.tick, position_rad });
            }
        }
    }

    /// Joint positions of the newest state; none if it is not fresh.
    pub fn position_rad(&self) -> Option<&Joints> {
        let fresh = Duration::from_millis(FRESH_MS);
        self.newest.as_ref().filter(|newest| newest.received.elapsed() <= fresh).map(|newest| &newest.position_rad)
    }
}

/// Takes the robot over: waits for states, lets it lie down, and releases its own controller. `lying_rad` is the lying pose;
/// `reliable` whether commands will be sent reliably; `interrupted` ends the takeover before its next request; `report` receives each
/// new step, and once, after 2 s without states, what was found in the domain instead. Returns the name of the released controller;
/// none if none was active.
///
/// # Errors
/// The handover failed or was interrupted, or no reader of commands was found; no command has been sent to a motor.
pub fn take_over(
    participant: &Participant,
    lying_rad: &Joints,
    reliable: bool,
    interrupted: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<Option<String>, TakeoverFailure> {
    let mut handover = Handover::begin(0, lying_rad, first_id());
    let ended = hand_over(participant, &mut handover, interrupted, report)
        .and_then(|()| wait_for_reader(participant, reliable, interrupted));
    let released = handover.released_controller().map(str::to_owned);
    match ended {
        Ok(()) => Ok(released),
        Err(error) => Err(TakeoverFailure { error, released }),
    }
}

/// Advances `handover` to its end.
fn hand_over(
    participant: &Participant,
    handover: &mut Handover,
    interrupted: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<(), TakeoverError> {
    let mut states = States::open(participant)?;
    let mut services =
        [Service::open(participant, motion_switcher::SERVICE)?, Service::open(participant, sport::SERVICE)?];
    let begun = Instant::now();
    let (mut reported, mut is_late) = (None, false);
    loop {
        states.receive();
        check_interrupted(interrupted)?;
        let now_ms = begun.elapsed().as_millis() as u64;
        for service in &mut services {
            while let Some(response) = service.response() {
                handover.answer(now_ms, service.name, &response);
            }
        }
        if let Some(ServiceRequest { service, message }) = handover.advance(now_ms, states.position_rad()) {
            for found in services.iter().filter(|found| found.name == service) {
                // A lost request is repeated.
                let _ = found.requests.write(&message.encode());
            }
        }
        if states.newest.is_none() && begun.elapsed() > DISCOVERY && !is_late {
            is_late = true;
            report(&format!("no state yet: {}", found_for(&TopicType::low_state(), &participant.writers(), "writes")));
        }
        let status = handover.status();
        match &status {
            HandoverStatus::Done(_) => return Ok(()),
            HandoverStatus::Failed(error) => {
                let found = match error {
                    HandoverError::NoState { .. } => {
                        format!("; {}", found_for(&TopicType::low_state(), &participant.writers(), "writes"))
                    }
                    _ => String::new(),
                };
                return Err(TakeoverError::Handover(error.clone(), found));
            }
            step if reported.as_ref() != Some(step) => report(words(step)),
            _ => {}
        }
        reported = Some(status);
    }
}

const fn words(step: &HandoverStatus) -> &'static str {
    match step {
        HandoverStatus::AwaitingState => "waiting for the robot's states",
        HandoverStatus::Checking => "asking for the robot's active controller",
        HandoverStatus::LyingDown => "the robot is to lie down",
        HandoverStatus::Releasing => "releasing the robot's own controller: its legs lose their support",
        HandoverStatus::Done(_) => "the robot's own controller is released",
        HandoverStatus::Failed(_) => "the robot was not taken over",
    }
}

fn check_interrupted(interrupted: &AtomicBool) -> Result<(), TakeoverError> {
    if interrupted.load(Ordering::Acquire) { Err(TakeoverError::Interrupted) } else { Ok(()) }
}

/// Waits until a reader of commands is found that takes ours.
fn wait_for_reader(participant: &Participant, reliable: bool, interrupted: &AtomicBool) -> Result<(), TakeoverError> {
    let (commands, begun) = (TopicType::low_command(), Instant::now());
    loop {
        check_interrupted(interrupted)?;
        let readers = participant.readers();
        let fits = |found: &&FoundEndpoint| found.topic == commands.topic && found.type_name == commands.type_name;
        let found: Vec<_> = readers.iter().filter(fits).collect();
        if found.iter().any(|found| reliable || !found.reliable) {
            return Ok(());
        }
        if begun.elapsed() > DISCOVERY && !found.is_empty() {
            return Err(TakeoverError::DemandsReliable);
        }
        if begun.elapsed() > DISCOVERY {
            return Err(TakeoverError::NoReader(found_for(&commands, &readers, "reads")));
        }
        std::thread::sleep(LOOK);
    }
}

/// Says which endpoints on a topic were found in place of the wanted one. `does` is what they do.
pub(super) fn found_for(wanted: &TopicType, found: &[FoundEndpoint], does: &str) -> String {
    let types: Vec<_> =
        found.iter().filter(|found| found.topic == wanted.topic).map(|f| f.type_name.as_str()).collect();
    let TopicType { topic, type_name, .. } = wanted;
    if found.is_empty() {
        format!("no other program was found in this DDS domain, none {does} {topic}; check --interface and --domain")
    } else if types.is_empty() {
        format!(
            "programs were found in this DDS domain, but none {does} {topic}; check --domain, and that the robot has started"
        )
    } else if types.iter().all(|found| found != type_name) {
        format!("a program {does} {topic} with the type {}, expected {type_name}", types.join(", "))
    } else {
        format!(
            "a program {does} {topic} with the right type, but nothing arrives; check the network and the quality of service"
        )
    }
}
