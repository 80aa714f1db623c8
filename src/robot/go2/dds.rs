//! DDS of the Go2: participant, readers and writers of whole payloads by the library rustdds, and the [`Transport`] of a console.
//!
//! The library only moves bytes: what they mean is in [`super::message`]. Its participant has threads of its own, so nothing here
//! is called in the tick but [`DdsTransport`], which exchanges payloads with them through wait-free queues.

use std::convert::Infallible;
use std::net::Ipv4Addr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use rustdds::bytes::Bytes;
use rustdds::mio1::{Events, Interest, Poll, Token};
use rustdds::no_key::{DataReader, DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity,
    RepresentationIdentifier, TopicKind,
};

use super::link::{Transport, TransportCounts};
use super::message::{COMMAND_LENGTH, STATE_LENGTH};
use super::own_writes::OwnWrites;

/// Time for which a writer may wait for a reader that does not acknowledge, ms. Below the time after which a command that has
/// not been sent is a fault.
const WRITE_BLOCKING_MS: i64 = 10;
/// Longest wait of the thread that writes until it looks whether it is to end, ms.
const WAKE_MS: u64 = 50;
/// Longest wait for a state, ms: commands that came back are counted in time, too, while the robot sends no state.
const STATE_WAIT_MS: u64 = 2;
/// States that wait for the tick at most; more are dropped and show as lost.
const WAITING_STATES: usize = 64;
/// Samples that a reader keeps until they are taken. The newest is the one that counts, the others are for the count of losses.
const READER_DEPTH: i32 = 16;

/// A topic and its type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicType {
    /// Name of the topic.
    pub topic: String,
    /// Name of the type.
    pub type_name: &'static str,
    /// Whether every sample is delivered, also on a lossy network. A reliable writer waits for each reliable reader, so one that
    /// hangs anywhere in the domain stops it: commands and states, whose newest sample counts, are not reliable.
    reliable: bool,
}

impl TopicType {
    /// Commands to the motors.
    pub fn low_command() -> TopicType {
        TopicType { topic: "rt/lowcmd".to_owned(), type_name: "unitree_go::msg::dds_::LowCmd_", reliable: false }
    }

    /// States of the robot.
    pub fn low_state() -> TopicType {
        TopicType { topic: "rt/lowstate".to_owned(), type_name: "unitree_go::msg::dds_::LowState_", reliable: false }
    }

    /// Requests to a service.
    pub fn request(service: &str) -> TopicType {
        let topic = format!("rt/api/{service}/request");
        TopicType { topic, type_name: "unitree_api::msg::dds_::Request_", reliable: true }
    }

    /// Responses of a service.
    pub fn response(service: &str) -> TopicType {
        let topic = format!("rt/api/{service}/response");
        TopicType { topic, type_name: "unitree_api::msg::dds_::Response_", reliable: true }
    }

    /// Makes it reliable, for a robot whose reader demands that.
    pub fn with_reliable(self, reliable: bool) -> TopicType {
        TopicType { reliable, ..self }
    }

    fn qos(&self, depth: i32) -> QosPolicies {
        let max_blocking_time = rustdds::Duration::from_millis(WRITE_BLOCKING_MS);
        let reliability =
            if self.reliable { Reliability::Reliable { max_blocking_time } } else { Reliability::BestEffort };
        QosPolicyBuilder::new()
            .reliability(reliability)
            .durability(Durability::Volatile)
            .history(History::KeepLast { depth })
            .build()
    }
}

/// Error of joining a DDS domain.
#[derive(Debug, Clone, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum DdsError {
    #[error("DDS domain {domain} cannot be joined at {address}: {reason}")]
    Join { domain: u16, address: Ipv4Addr, reason: String },
    #[error("the DDS topic {topic} cannot be opened: {reason}")]
    Topic { topic: String, reason: String },
    #[error("a thread for DDS could not be started: {reason}")]
    Thread { reason: String },
}

/// Identity of the program behind a reader or writer.
pub type ParticipantIdentity = [u8; 12];

/// A reader or writer that was found in the domain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundEndpoint {
    /// Name of its topic.
    pub topic: String,
    /// Name of its type.
    pub type_name: String,
    /// The program that it belongs to.
    pub participant: ParticipantIdentity,
    /// Whether it offers or demands reliable delivery.
    pub reliable: bool,
}

/// A payload, without the encapsulation header.
#[derive(Debug, Clone)]
struct Payload(Bytes);

/// Moves payloads as they are; plain little-endian CDR.
#[derive(Debug, Clone, Copy)]
struct AsItIs;

impl SerializerAdapter<Payload> for AsItIs {
    type Error = Infallible;
    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }
    fn to_bytes(value: &Payload) -> Result<Bytes, Infallible> {
        Ok(value.0.clone())
    }
}

impl DeserializerAdapter<Payload> for AsItIs {
    type Error = Infallible;
    type Decoded = Payload;
    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }
    fn transform_decoded(decoded: Payload) -> Payload {
        decoded
    }
}

impl DefaultDecoder<Payload> for AsItIs {
    type Decoder = AsItIs;
    const DECODER: AsItIs = AsItIs;
}

impl Decode<'_, Payload> for AsItIs {
    type Error = Infallible;
    fn decode_bytes(self, bytes: &[u8], _: RepresentationIdentifier) -> Result<Payload, Infallible> {
        Ok(Payload(Bytes::copy_from_slice(bytes)))
    }
}

/// This program's membership in a domain, at one interface.
#[derive(Clone)]
pub struct Participant {
    participant: DomainParticipant,
}

impl std::fmt::Debug for Participant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Participant").field(&self.participant.guid()).finish()
    }
}

impl Participant {
    /// Joins `domain` at the interface with `address`.
    ///
    /// # Errors
    /// The sockets cannot be opened.
    pub fn join(domain: u16, address: Ipv4Addr) -> Result<Participant, DdsError> {
        let builder = DomainParticipantBuilder::new(domain).with_only_networks([address]);
        let failed = |error: rustdds::dds::CreateError| DdsError::Join { domain, address, reason: error.to_string() };
        Ok(Participant { participant: builder.build().map_err(failed)? })
    }

    /// Identity of this membership.
    pub fn identity(&self) -> ParticipantIdentity {
        identity(self.participant.guid())
    }

    /// Opens a writer that keeps the newest payload.
    ///
    /// # Errors
    /// The library refuses it.
    pub fn writer(&self, topic: &TopicType) -> Result<TopicWriter, DdsError> {
        let failed = |error: rustdds::dds::CreateError| topic_error(topic, &error);
        let qos = topic.qos(1);
        let found = self.topic(topic, &qos)?;
        let publisher = self.participant.create_publisher(&qos).map_err(failed)?;
        Ok(TopicWriter { writer: publisher.create_datawriter_no_key(&found, Some(qos)).map_err(failed)? })
    }

    /// Opens a reader.
    ///
    /// # Errors
    /// The library refuses it.
    pub fn reader(&self, topic: &TopicType) -> Result<TopicReader, DdsError> {
        let failed = |error: rustdds::dds::CreateError| topic_error(topic, &error);
        let qos = topic.qos(READER_DEPTH);
        let found = self.topic(topic, &qos)?;
        let subscriber = self.participant.create_subscriber(&qos).map_err(failed)?;
        let mut reader = subscriber.create_datareader_no_key(&found, Some(qos)).map_err(failed)?;
        let waiting = |error: std::io::Error| DdsError::Topic { topic: topic.topic.clone(), reason: error.to_string() };
        let poll = Poll::new().map_err(waiting)?;
        poll.registry().register(&mut reader, Token(0), Interest::READABLE).map_err(waiting)?;
        Ok(TopicReader { reader, poll, events: Events::with_capacity(4), foreign: 0 })
    }

    /// Returns the readers of other programs.
    pub fn readers(&self) -> Vec<FoundEndpoint> {
        let readers = self.participant.discovered_readers().into_iter().map(|found| {
            let data = &found.subscription_topic_data;
            FoundEndpoint {
                topic: data.topic_name().clone(),
                type_name: data.type_name().clone(),
                participant: identity(found.reader_proxy.remote_reader_guid),
                reliable: is_reliable(&data.qos()),
            }
        });
        readers.filter(|found| found.participant != self.identity()).collect()
    }

    /// Returns the writers of other programs.
    pub fn writers(&self) -> Vec<FoundEndpoint> {
        let writers = self.participant.discovered_writers().into_iter().map(|found| {
            let data = &found.publication_topic_data;
            FoundEndpoint {
                topic: data.topic_name().clone(),
                type_name: data.type_name.clone(),
                participant: identity(found.writer_proxy.remote_writer_guid),
                reliable: is_reliable(&data.qos()),
            }
        });
        writers.filter(|found| found.participant != self.identity()).collect()
    }

    fn topic(&self, topic: &TopicType, qos: &QosPolicies) -> Result<rustdds::Topic, DdsError> {
        self.participant
            .create_topic(topic.topic.clone(), topic.type_name.to_owned(), qos, TopicKind::NoKey)
            .map_err(|error| topic_error(topic, &error))
    }
}

fn topic_error(topic: &TopicType, error: &rustdds::dds::CreateError) -> DdsError {
    DdsError::Topic { topic: topic.topic.clone(), reason: error.to_string() }
}

fn is_reliable(qos: &QosPolicies) -> bool {
    matches!(qos.reliability(), Some(Reliability::Reliable { .. }))
}

fn identity(guid: GUID) -> ParticipantIdentity {
    let bytes = guid.to_bytes();
    std::array::from_fn(|i| bytes[i])
}

/// Writes payloads to one topic.
pub struct TopicWriter {
    writer: DataWriter<Payload, AsItIs>,
}

impl TopicWriter {
    /// Puts a payload on the network; allocates, and may wait for milliseconds.
    ///
    /// # Errors
    /// The library could not take it.
    pub fn write(&self, payload: &[u8]) -> std::io::Result<()> {
        let written = self.writer.write(Payload(Bytes::copy_from_slice(payload)), None);
        written.map_err(|error| std::io::Error::other(error.to_string()))
    }
}

/// A received payload.
#[derive(Debug, Clone)]
pub struct ReceivedSample {
    /// Bytes, without the encapsulation header.
    pub payload: Bytes,
    /// The program that wrote it.
    pub participant: ParticipantIdentity,
}

/// Reads payloads of one topic.
pub struct TopicReader {
    reader: DataReader<Payload, AsItIs>,
    poll: Poll,
    events: Events,
    /// Samples in another encoding.
    pub foreign: u64,
}

impl TopicReader {
    /// Waits until samples may have arrived, at most `longest`.
    pub fn wait(&mut self, longest: Duration) {
        // An interrupted wait is a short one.
        let _ = self.poll.poll(&mut self.events, Some(longest));
    }

    /// Takes the oldest sample that waits; none if there is none.
    pub fn take(&mut self) -> Option<ReceivedSample> {
        loop {
            match self.reader.take_next_sample() {
                Ok(None) => return None,
                Ok(Some(sample)) => {
                    let participant = identity(sample.sample_info().writer_guid());
                    return Some(ReceivedSample { payload: sample.into_value().0, participant });
                }
                // It is taken all the same.
                Err(_) => self.foreign += 1,
            }
        }
    }
}

/// A received state, as it waits for the tick.
struct WaitingState {
    length: usize,
    bytes: [u8; STATE_LENGTH],
}

/// Counts that the threads add to and the tick reads.
#[derive(Debug, Default)]
struct SharedCounts {
    sent: AtomicU64,
    returned: AtomicU64,
    send_errors: AtomicU64,
    foreign: AtomicU64,
    foreign_commands: AtomicU64,
}

/// A console's transport: one thread takes states and watches the commands of other programs, one writes the newest command.
pub struct DdsTransport {
    states: rtrb::Consumer<WaitingState>,
    command: triple_buffer::Input<[u8; COMMAND_LENGTH]>,
    counts: Arc<SharedCounts>,
    ending: Arc<AtomicBool>,
    writing: Option<JoinHandle<()>>,
    reading: Option<JoinHandle<()>>,
    /// End after the readers and writers.
    _participants: [Participant; 2],
}

impl std::fmt::Debug for DdsTransport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DdsTransport").field("counts", &self.counts).finish_non_exhaustive()
    }
}

impl DdsTransport {
    /// Opens the topics of states and commands, the latter as `commands` says, and starts the threads. `witness` reads the commands
    /// of all programs: the library hands no participant its own. The guard writes `guards_command`, which after a silence of this
    /// program is no command of another one.
    ///
    /// # Errors
    /// A topic cannot be opened, or a thread not started.
    pub fn open(
        participant: &Participant,
        witness: &Participant,
        commands: &TopicType,
        guards_command: &[u8; COMMAND_LENGTH],
    ) -> Result<DdsTransport, DdsError> {
        let states = participant.reader(&TopicType::low_state())?;
        let writer = participant.writer(commands)?;
        let all_commands = witness.reader(&TopicType::low_command())?;
        let (state_in, state_out) = rtrb::RingBuffer::new(WAITING_STATES);
        let (command_in, command_out) = triple_buffer::triple_buffer(&[0; COMMAND_LENGTH]);
        let (counts, ending) = (Arc::<SharedCounts>::default(), Arc::<AtomicBool>::default());
        let mut transport = DdsTransport {
            states: state_out,
            command: command_in,
            counts: counts.clone(),
            ending: ending.clone(),
            writing: None,
            reading: None,
            _participants: [participant.clone(), witness.clone()],
        };
        let failed = |error: std::io::Error| DdsError::Thread { reason: error.to_string() };
        let (shared, flag) = (counts.clone(), ending.clone());
        let write = move || write_commands(&writer, command_out, &shared, &flag);
        transport.writing = Some(std::thread::Builder::new().name("dds-commands".into()).spawn(write).map_err(failed)?);
        let ours = Ours { participant: participant.identity(), guards_command: *guards_command };
        let read = move || take_samples(states, all_commands, state_in, &ours, &counts, &ending);
        transport.reading = Some(std::thread::Builder::new().name("dds-states".into()).spawn(read).map_err(failed)?);
        Ok(transport)
    }
}

impl Transport for DdsTransport {
    fn receive(&mut self, payload: &mut [u8; STATE_LENGTH]) -> Option<usize> {
        let state = self.states.pop().ok()?;
        *payload = state.bytes;
        Some(state.length)
    }

    fn send(&mut self, payload: &[u8; COMMAND_LENGTH]) {
        self.command.write(*payload);
        // Wakes by one system call that does not wait.
        if let Some(writing) = &self.writing {
            writing.thread().unpark();
        }
    }

    fn counts(&self) -> TransportCounts {
        let SharedCounts { sent, returned, send_errors, foreign, foreign_commands } = &*self.counts;
        let [sent, returned, send_errors, foreign, foreign_commands] =
            [sent, returned, send_errors, foreign, foreign_commands].map(|count| count.load(Ordering::Relaxed));
        TransportCounts { sent, returned, send_errors, foreign, foreign_commands }
    }
}

impl Drop for DdsTransport {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        for thread in [self.writing.take(), self.reading.take()].into_iter().flatten() {
            thread.thread().unpark();
            // A thread that panicked has ended.
            let _ = thread.join();
        }
    }
}

/// Writes the newest command whenever there is one, the last one also at the end.
fn write_commands(
    writer: &TopicWriter,
    mut newest: triple_buffer::Output<[u8; COMMAND_LENGTH]>,
    counts: &SharedCounts,
    ending: &AtomicBool,
) {
    loop {
        let ends = ending.load(Ordering::Acquire);
        if newest.update() {
            let count = match writer.write(newest.output_buffer_mut()) {
                Ok(()) => &counts.sent,
                Err(_) => &counts.send_errors,
            };
            count.fetch_add(1, Ordering::Relaxed);
        } else if ends {
            return;
        } else {
            std::thread::park_timeout(Duration::from_millis(WAKE_MS));
        }
    }
}

/// Time since boot, ns. It counts a suspension of the computer, in which this program is silent and after which the guard damps.
fn since_boot_ns() -> u64 {
    clock_gettime(ClockId::CLOCK_BOOTTIME).map_or(0, |time| Duration::from(time).as_nanos() as u64)
}

/// Identity of the commands of this program and its guard.
struct Ours {
    participant: ParticipantIdentity,
    guards_command: [u8; COMMAND_LENGTH],
}

impl Ours {
    /// Whether a command of another participant that is taken now is not one of this program's guard.
    fn is_foreign(&self, sample: &ReceivedSample, own_writes: &OwnWrites) -> bool {
        sample.payload[..] != self.guards_command || !own_writes.guard_may_speak(since_boot_ns())
    }
}

/// Passes states on, and counts the commands of other programs and those of this one that came back.
fn take_samples(
    mut states: TopicReader,
    mut commands: TopicReader,
    mut waiting: rtrb::Producer<WaitingState>,
    ours: &Ours,
    counts: &SharedCounts,
    ending: &AtomicBool,
) {
    let mut own_writes = OwnWrites::default();
    while !ending.load(Ordering::Acquire) {
        states.wait(Duration::from_millis(STATE_WAIT_MS));
        while let Some(sample) = states.take() {
            let mut state = WaitingState { length: sample.payload.len(), bytes: [0; STATE_LENGTH] };
            let held = state.length.min(STATE_LENGTH);
            state.bytes[..held].copy_from_slice(&sample.payload[..held]);
            // A full queue means that no tick has run for many states; their gap is counted as lost.
            let _ = waiting.push(state);
        }
        counts.foreign.store(states.foreign, Ordering::Relaxed);
        while let Some(sample) = commands.take() {
            if sample.participant == ours.participant {
                counts.returned.fetch_add(1, Ordering::Relaxed);
                own_writes.note(since_boot_ns());
            } else if ours.is_foreign(&sample, &own_writes) {
                counts.foreign_commands.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}
