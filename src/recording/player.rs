//! Player of a recording, finished or truncated anywhere: ticks and records in the order of time, from any moment.
//!
//! In memory are the index and the events (everything but ticks and counters); ticks are decoded chunk by chunk while they
//! are played.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use foxglove::messages::JointStates;
use mcap::records::{MessageHeader, Record as McapRecord};
use prost::Message;

use super::container::{Chunk, Container};
use super::decode::DecodeError;
use super::error::RecordingError;
use super::record::{Record, SessionInfo, Stamped};
use super::topic::Topic;
use super::{frog, schema, tick};
use crate::telemetry::Tick;

/// A played tick or record.
#[allow(clippy::large_enum_variant, reason = "nearly all are ticks; a box for each costs more than it saves")]
#[derive(Debug, Clone, PartialEq)]
pub enum Played {
    /// A control tick.
    Tick(Tick),
    /// A record.
    Record(Stamped),
}

impl Played {
    /// Returns the time since the engine started, ns.
    pub fn time_ns(&self) -> u64 {
        match self {
            Played::Tick(tick) => tick.time_ns,
            Played::Record(stamped) => stamped.time_ns,
        }
    }
}

/// Kind of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkerKind {
    /// Begin of the trial of that number.
    Trial(u32),
    /// Begin of a fault.
    Fault,
}

/// A moment to seek.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Marker {
    /// Time since the engine started, ns.
    pub time_ns: u64,
    /// Kind.
    pub kind: MarkerKind,
}

/// Iterator over the ticks and records of a recording, in the order of time.
pub struct Player {
    container: Container,
    path: PathBuf,
    session: SessionInfo,
    start_utc_ns: u64,
    duration_ns: u64,
    markers: Vec<Marker>,
    events: Vec<Stamped>,
    /// Read and not yet played, in the order of time.
    queue: VecDeque<Played>,
    /// The next chunk to read; all before it are played or in the queue.
    next_chunk: usize,
    from_ns: u64,
    damaged_chunks: Vec<usize>,
    first_trouble: Option<String>,
}

impl Player {
    /// Opens a recording. Of a truncated or damaged one everything readable is played; [`damage`](Player::damage)
    /// describes the rest.
    ///
    /// # Errors
    /// When nothing can be played: missing or empty file, no MCAP file, file of another program.
    pub fn open(path: impl AsRef<Path>) -> Result<Player, RecordingError> {
        let path = path.as_ref();
        let mut container = Container::open(path)?;
        container.chunks.retain(|chunk| chunk.channels.as_ref().is_none_or(|channels| !channels.is_empty()));
        container.chunks.sort_by_key(|chunk| chunk.start);
        let mut player = Player {
            container,
            path: path.into(),
            session: SessionInfo::default(),
            start_utc_ns: 0,
            duration_ns: 0,
            markers: Vec::new(),
            events: Vec::new(),
            queue: VecDeque::new(),
            next_chunk: 0,
            from_ns: 0,
            damaged_chunks: Vec::new(),
            first_trouble: None,
        };
        player.read_events()?;
        let end = player.container.chunks.iter().map(|chunk| chunk.end).max().unwrap_or_default();
        player.duration_ns = end.saturating_sub(player.start_utc_ns);
        Ok(player)
    }

    /// Returns the facts of the session.
    pub fn session(&self) -> &SessionInfo {
        &self.session
    }

    /// Returns the UTC time of engine time 0, ns since 1970.
    pub fn start_utc_ns(&self) -> u64 {
        self.start_utc_ns
    }

    /// Returns the time of the last message since the engine started, ns.
    pub fn duration_ns(&self) -> u64 {
        self.duration_ns
    }

    /// Returns the begins of trials and faults, in the order of time.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Returns all records but the counters, in the order of time.
    pub fn events(&self) -> &[Stamped] {
        &self.events
    }

    /// Returns a description of the missing parts found so far: a truncated end is found on opening, a chunk with a wrong
    /// checksum when it is played. None for an intact file.
    pub fn damage(&self) -> Option<String> {
        let chunks = match (self.damaged_chunks.len(), &self.first_trouble) {
            (0, None) => None,
            (0, Some(trouble)) => Some(format!("a message cannot be read: {trouble}")),
            (count, trouble) => Some(format!(
                "{count} of {} chunks are damaged and left out{}",
                self.container.chunks.len(),
                trouble.as_ref().map(|trouble| format!(" ({trouble})")).unwrap_or_default()
            )),
        };
        let parts: Vec<_> = self.container.cut.iter().chain(&chunks).map(String::as_str).collect();
        (!parts.is_empty()).then(|| format!("{}: {}", self.path.display(), parts.join("; ")))
    }

    /// Continues at `time_ns`, forward or back, with the first tick or record not before it.
    pub fn seek(&mut self, time_ns: u64) {
        self.queue.clear();
        self.from_ns = time_ns;
        let log_time = self.start_utc_ns.saturating_add(time_ns);
        let chunks = &self.container.chunks;
        self.next_chunk = chunks.iter().position(|chunk| chunk.end >= log_time).unwrap_or(chunks.len());
    }

    /// Returns the bytes of an attached file, for example `config.toml`; none if no file has that name.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn attachment(&mut self, name: &str) -> Result<Option<Vec<u8>>, RecordingError> {
        for span in self.container.attachments.clone() {
            let attachment = self
                .container
                .read_attachment(span)
                .map_err(|source| RecordingError::Mcap { path: self.path.clone(), source })?;
            if attachment.name == name {
                return Ok(Some(attachment.data.into_owned()));
            }
        }
        Ok(None)
    }

    /// Reads the session, the markers and all events from the chunks that hold any.
    fn read_events(&mut self) -> Result<(), RecordingError> {
        let container = &self.container;
        let known = |channel: &u16| container.topic(*channel);
        let may_hold_events = |chunk: &Chunk| {
            chunk.channels.as_ref().is_none_or(|channels| channels.iter().filter_map(known).any(Topic::is_event))
        };
        let with_events: Vec<_> =
            (0..container.chunks.len()).filter(|&index| may_hold_events(&container.chunks[index])).collect();
        let mut session = None;
        let (mut events, mut markers) = (Vec::new(), Vec::new());
        for index in with_events {
            for (topic, header, data) in self.messages_of(index) {
                if !topic.is_event() {
                    continue;
                }
                let log_time = header.log_time;
                if topic == Topic::Session && session.is_none() {
                    session = frog::Session::decode(&*data).ok().map(|message| message.start_utc_ns);
                }
                if topic == Topic::Marker {
                    match marker(&data) {
                        Ok(kind) => markers.push((log_time, kind)),
                        Err(error) => self.note(&error),
                    }
                } else {
                    match schema::decode(topic, &data) {
                        Ok(record) => events.extend(record.map(|record| (log_time, record))),
                        Err(error) => self.note(&error),
                    }
                }
            }
        }
        let Some(start_utc_ns) = session else { return Err(self.no_session()) };
        self.start_utc_ns = start_utc_ns;
        events.sort_by_key(|(log_time, _)| *log_time);
        markers.sort_by_key(|(log_time, _)| *log_time);
        let time_ns = |log_time: u64| log_time.saturating_sub(start_utc_ns);
        self.events = events.into_iter().map(|(at, record)| Stamped { time_ns: time_ns(at), record }).collect();
        self.markers = markers.into_iter().map(|(at, kind)| Marker { time_ns: time_ns(at), kind }).collect();
        let info = self.events.iter().find_map(|event| match &event.record {
            Record::Session(info) => Some(info.clone()),
            _ => None,
        });
        self.session = info.ok_or_else(|| self.no_session())?;
        Ok(())
    }

    /// Returns the error of a file without session: truncated before it, or of another program.
    fn no_session(&self) -> RecordingError {
        let path = self.path.clone();
        let bytes = std::fs::metadata(&path).map(|metadata| metadata.len()).unwrap_or_default();
        if self.container.chunks.is_empty() && self.container.cut.is_some() {
            RecordingError::TooShort { path, bytes }
        } else {
            RecordingError::NoSession { path }
        }
    }

    /// Returns the messages of a chunk on known topics; none of a damaged chunk, which is noted.
    fn messages_of(&mut self, index: usize) -> Vec<(Topic, MessageHeader, Vec<u8>)> {
        let chunk = self.container.chunks[index].clone();
        let records = match self.container.read_chunk(&chunk) {
            Ok(records) => records,
            Err(error) => {
                if !self.damaged_chunks.contains(&index) {
                    self.damaged_chunks.push(index);
                    self.note(&error);
                }
                return Vec::new();
            }
        };
        let mut messages = Vec::with_capacity(records.len());
        for record in records {
            if let McapRecord::Message { header, data } = record
                && let Some(topic) = self.container.topic(header.channel_id)
            {
                messages.push((topic, header, data.into_owned()));
            }
        }
        messages
    }

    fn note(&mut self, trouble: &dyn std::error::Error) {
        self.first_trouble.get_or_insert_with(|| trouble.to_string());
    }

    /// Reads the next chunk into the queue.
    fn read_chunk(&mut self) {
        let messages = self.messages_of(self.next_chunk);
        self.next_chunk += 1;
        // The messages of a tick are adjacent and share sequence and log time: joints, command, the rest.
        let mut joints: Option<(MessageHeader, JointStates)> = None;
        let mut command: Option<(MessageHeader, frog::JointCommand)> = None;
        for (topic, header, data) in messages {
            let time_ns = header.log_time.saturating_sub(self.start_utc_ns);
            if time_ns < self.from_ns {
                continue;
            }
            let played = match topic {
                Topic::JointStates => JointStates::decode(&*data)
                    .map(|message| {
                        joints = Some((header, message));
                        None
                    })
                    .map_err(DecodeError::from),
                Topic::JointCommand => frog::JointCommand::decode(&*data)
                    .map(|message| {
                        command = Some((header, message));
                        None
                    })
                    .map_err(DecodeError::from),
                Topic::Tick => join(&header, &data, joints.take(), command.take()).map(|tick| Some(Played::Tick(tick))),
                _ => schema::decode(topic, &data)
                    .map(|record| record.map(|record| Played::Record(Stamped { time_ns, record }))),
            };
            match played {
                Ok(played) => self.queue.extend(played),
                Err(error) => self.note(&error),
            }
        }
        // Ticks and records come from two producers: a record may be written a little after ticks that are newer.
        self.queue.make_contiguous().sort_by_key(Played::time_ns);
    }
}

impl Iterator for Player {
    type Item = Played;

    /// Returns the next tick or record in the order of time; none at the end.
    fn next(&mut self) -> Option<Played> {
        // An unread chunk may hold something earlier than the queue.
        while let Some(chunk) = self.container.chunks.get(self.next_chunk) {
            let starts = chunk.start.saturating_sub(self.start_utc_ns);
            if self.queue.front().is_some_and(|first| first.time_ns() < starts) {
                break;
            }
            self.read_chunk();
        }
        self.queue.pop_front()
    }
}

fn marker(data: &[u8]) -> Result<MarkerKind, DecodeError> {
    let message = frog::Marker::decode(data)?;
    match frog::marker::Kind::try_from(message.kind) {
        Ok(frog::marker::Kind::Trial) => {
            Ok(MarkerKind::Trial(message.trial.ok_or(DecodeError::Missing("a trial's number"))?))
        }
        Ok(frog::marker::Kind::Fault) => Ok(MarkerKind::Fault),
        Err(_) => Err(DecodeError::Unknown("marker", message.kind)),
    }
}

/// Joins a tick from its message and the two before it.
fn join(
    header: &MessageHeader,
    control: &[u8],
    joints: Option<(MessageHeader, JointStates)>,
    command: Option<(MessageHeader, frog::JointCommand)>,
) -> Result<Tick, DecodeError> {
    let same = |other: &MessageHeader| other.sequence == header.sequence && other.log_time == header.log_time;
    let (_, joints) =
        joints.filter(|(other, _)| same(other)).ok_or(DecodeError::Missing("/robot/joint_states of a tick"))?;
    let (_, command) =
        command.filter(|(other, _)| same(other)).ok_or(DecodeError::Missing("/robot/joint_cmd of a tick"))?;
    tick::join(&frog::ControlTick::decode(control)?, &joints, &command)
}
