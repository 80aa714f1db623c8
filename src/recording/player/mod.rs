//! Player of a recording, finished or truncated anywhere: ticks and records in the order of time, from any moment.
//!
//! In memory are the index and the events (everything but ticks and counters); ticks are decoded chunk by chunk while they
//! are played.

mod damage;
mod events;
mod lost;
mod tick_joiner;

use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;

use super::chunk::ChunkRecords;
use super::container::{Chunk, Container};
use super::error::RecordingError;
use super::event_index;
use super::record::{Record, SessionInfo, Stamped};
use super::schema;
use super::topic::Topic;
use super::wire::DecodeError;
use crate::telemetry::Tick;

pub use damage::Damage;
pub use lost::LostPart;
use lost::{DamagedChunk, MOST_EVENTS, UnreadableMessages, weight};
use tick_joiner::TickJoiner;

/// Most ticks of one rollout that a reader keeps, 2.4 kB each: 1,000 s. The longest `duration_s` is 600 s, countdown and settling
/// take 60 s at most.
pub const MOST_TICKS_OF_A_ROLLOUT: usize = 1_000_000;

/// A played tick or record.
#[expect(clippy::large_enum_variant, reason = "records are few; the many ticks are boxed")]
#[derive(Debug, Clone, PartialEq)]
pub enum Played {
    /// A control tick; of 2.4 kB, so that it is not copied on its way.
    Tick(Box<Tick>),
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

    /// Returns the number of messages as which it counts in the queue.
    fn weight(&self) -> usize {
        match self {
            Played::Tick(_) => 1,
            Played::Record(stamped) => weight(&stamped.record),
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

/// A message on `/robot/joint_cmd`.
type CommandMessage = (MessageHeader, Vec<u8>);

/// Iterator over the ticks and records of a recording, in the order of time.
pub struct Player {
    container: Container,
    path: PathBuf,
    /// Chunks with messages, in the order of time.
    chunks: Vec<Chunk>,
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
    /// The last command before a chunk, and the chunk's place: the one after that which was read last.
    carried: (usize, Option<CommandMessage>),
    /// Time before which only the ticks are played whose number the second value divides.
    sparse_until: Option<(u64, u32)>,
    damaged: Vec<DamagedChunk>,
    /// Offsets of the chunks that were played without a checksum.
    unguarded: BTreeSet<u64>,
    unreadable: UnreadableMessages,
    /// Events and markers, with each tick of a fault.
    counted_events: usize,
    /// Log time of the first event that was left out: there are too many.
    left_out_from: Option<u64>,
    /// Messages in the queue, with each tick of a fault.
    queued: usize,
    /// Time up to which everything was played when the queue was full; 0 before.
    played_until_ns: u64,
}

impl Player {
    /// Opens a recording. Of a truncated or damaged one everything readable is played; [`damage`](Player::damage)
    /// describes the rest.
    ///
    /// # Errors
    /// When nothing can be played: missing or empty file, pipe or device, no MCAP file, file of another program.
    pub fn open(path: impl AsRef<Path>) -> Result<Player, RecordingError> {
        let path = path.as_ref();
        let mut player = Player {
            container: Container::open(path)?,
            path: path.into(),
            chunks: Vec::new(),
            session: SessionInfo::default(),
            start_utc_ns: 0,
            duration_ns: 0,
            markers: Vec::new(),
            events: Vec::new(),
            queue: VecDeque::new(),
            next_chunk: 0,
            from_ns: 0,
            carried: (0, None),
            sparse_until: None,
            damaged: Vec::new(),
            unguarded: BTreeSet::new(),
            unreadable: UnreadableMessages::default(),
            counted_events: 0,
            left_out_from: None,
            queued: 0,
            played_until_ns: 0,
        };
        let (found, copies) = (player.new_chunks(), event_index::read(&mut player.container));
        let start_utc_ns = player.read_events(&found, copies);
        player.start_utc_ns = start_utc_ns.unwrap_or_default();
        player.add_chunks(found);
        if start_utc_ns.is_none() {
            return Err(player.no_session());
        }
        player.shift_events(0, 0);
        let info = player.events.iter().find_map(|event| match &event.record {
            Record::Session(info) => Some(info.clone()),
            _ => None,
        });
        player.session = info.ok_or_else(|| player.no_session())?;
        Ok(player)
    }

    /// Reads what another process has appended since the file was opened or refreshed; returns whether there was anything.
    /// A file that was complete when it was opened does not grow.
    ///
    /// # Errors
    /// When the file cannot be read any more.
    pub fn refresh(&mut self) -> Result<bool, RecordingError> {
        if !self.container.scanned {
            return Ok(false);
        }
        self.container.scan_appended()?;
        let found = self.new_chunks();
        if found.is_empty() {
            return Ok(false);
        }
        let (events, markers) = (self.events.len(), self.markers.len());
        self.read_events(&found, None);
        self.shift_events(events, markers);
        // Everything that is played already is in chunks before these.
        let next = self.chunks.get(self.next_chunk).map(|chunk| chunk.span.offset);
        self.add_chunks(found);
        let place = |offset| self.chunks.iter().position(|chunk| chunk.span.offset == offset);
        self.next_chunk = next.and_then(place).unwrap_or(self.next_chunk);
        Ok(true)
    }

    /// Returns the facts of the session.
    pub fn session(&self) -> &SessionInfo {
        &self.session
    }

    /// Returns the file's path as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the UTC time of engine time 0, ns since 1970.
    pub fn start_utc_ns(&self) -> u64 {
        self.start_utc_ns
    }

    /// Returns the numbers of the trials of which ticks are recorded, of the countdown at least.
    pub fn trials_with_ticks(&self) -> impl Iterator<Item = u32> + '_ {
        self.markers.iter().filter_map(|marker| match marker.kind {
            MarkerKind::Trial(trial) => Some(trial),
            MarkerKind::Fault => None,
        })
    }

    /// Returns the time of the last message since the engine started, ns.
    pub fn duration_ns(&self) -> u64 {
        self.duration_ns
    }

    /// Returns the time of the first message since the engine started, ns, without the session's own record unless there is no other.
    pub fn first_ns(&self) -> u64 {
        let other = |channel: &u16| self.container.topic(*channel) != Some(Topic::Session);
        let holds_others = |chunk: &&Chunk| chunk.channels.as_ref().is_none_or(|channels| channels.iter().any(other));
        let first = self.chunks.iter().filter(holds_others).map(|chunk| chunk.start).min();
        let first = first.or_else(|| self.chunks.iter().map(|chunk| chunk.start).min());
        first.unwrap_or(self.start_utc_ns).saturating_sub(self.start_utc_ns)
    }

    /// Returns the begins of trials and faults, in the order of time.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Returns all records but the counters, in the order of time.
    pub fn events(&self) -> &[Stamped] {
        &self.events
    }

    /// Continues at `time_ns`, forward or back, with the first tick or record not before it.
    pub fn seek(&mut self, time_ns: u64) {
        self.queue.clear();
        (self.queued, self.played_until_ns) = (0, 0);
        self.from_ns = time_ns;
        self.sparse_until = None;
        let log_time = self.start_utc_ns.saturating_add(time_ns);
        let chunks = &self.chunks;
        self.next_chunk = chunks.iter().position(|chunk| chunk.end >= log_time).unwrap_or(chunks.len());
    }

    /// Continues at `from_ns` like [`seek`](Player::seek); of the ticks before `to_ns` only those are played whose number is a
    /// multiple of `every`, and those in which the mode changes.
    pub fn seek_sparse(&mut self, from_ns: u64, to_ns: u64, every: u32) {
        self.seek(from_ns);
        self.sparse_until = Some((to_ns, every.max(1)));
    }

    /// Returns the bytes of an attached file, for example `config.toml`; none if no file has that name.
    ///
    /// # Errors
    /// When no whole attachment has that name and one is damaged: it may be the one.
    pub fn attachment(&mut self, name: &str) -> Result<Option<Vec<u8>>, RecordingError> {
        let mut damaged = None;
        for span in self.container.attachments.clone() {
            match self.container.read_attachment(span) {
                Ok(attachment) if attachment.name == name => return Ok(Some(attachment.data.into_owned())),
                Ok(_) => {}
                Err(error) => damaged = damaged.or(Some(error)),
            }
        }
        damaged.map_or(Ok(None), |error| Err(RecordingError::of_reading(&self.path, error)))
    }

    /// Takes the chunks that the container has found since the last call.
    fn new_chunks(&mut self) -> Vec<Chunk> {
        let mut found = std::mem::take(&mut self.container.chunks);
        if self.container.scanned {
            self.prove_times(&mut found);
        }
        found.retain(|chunk| chunk.channels.as_ref().is_none_or(|channels| !channels.is_empty()));
        found
    }

    fn add_chunks(&mut self, found: Vec<Chunk>) {
        self.chunks.extend(found);
        self.chunks.sort_by_key(|chunk| chunk.start);
        let end = self.chunks.iter().map(|chunk| chunk.end).max().unwrap_or_default();
        self.duration_ns = end.saturating_sub(self.start_utc_ns);
    }

    /// Whether the mode changes in the tick of this time.
    fn changes_mode(&self, time_ns: u64) -> bool {
        let from = self.events.partition_point(|event| event.time_ns < time_ns);
        let mut of_tick = self.events[from..].iter().take_while(|event| event.time_ns == time_ns);
        of_tick.any(|event| matches!(event.record, Record::Transition(_)))
    }

    /// Returns the last command before chunk `place`, which its first tick needs where another program has divided the recording into
    /// chunks of its own. None beyond a damaged chunk, which may have held another one.
    fn command_before(&mut self, place: usize, carried: (usize, Option<CommandMessage>)) -> Option<CommandMessage> {
        if carried.0 == place {
            return carried.1;
        }
        for earlier in (0..place).rev() {
            let records = self.records_of(&self.chunks[earlier].clone())?;
            let topic = |header: &MessageHeader| self.container.topic(header.channel_id);
            let commands =
                records.messages().flatten().filter(|(header, _)| topic(header) == Some(Topic::JointCommand));
            if let Some((header, data)) = commands.last() {
                return Some((header, data.to_vec()));
            }
        }
        None
    }

    /// Whether the first tick of a chunk comes before its first command.
    fn lacks_command(&self, records: &ChunkRecords) -> bool {
        let topics = records.messages().flatten().filter_map(|(header, _)| self.container.topic(header.channel_id));
        let mut of_ticks = topics.filter(|topic| [Topic::Tick, Topic::JointCommand].contains(topic));
        of_ticks.next() == Some(Topic::Tick)
    }

    /// Reads the next chunk into the queue.
    fn read_chunk(&mut self) {
        let place = self.next_chunk;
        let chunk = self.chunks[place].clone();
        self.next_chunk += 1;
        let carried = std::mem::replace(&mut self.carried, (place + 1, None));
        let Some(records) = self.records_of(&chunk) else { return };
        let before = if self.lacks_command(&records) { self.command_before(place, carried) } else { None };
        let mut joiner = TickJoiner::default();
        if let Some((header, data)) = &before {
            joiner.set_command(*header, data);
        }
        let mut errors = Vec::new();
        for (header, data) in records.messages().flatten() {
            let Some(topic) = self.container.topic(header.channel_id) else { continue };
            match topic {
                Topic::JointStates => joiner.joints = Some((header, data)),
                Topic::JointCommand => joiner.set_command(header, data),
                _ => {}
            }
            let time_ns = header.log_time.saturating_sub(self.start_utc_ns);
            if time_ns < self.from_ns {
                continue;
            }
            let left_out =
                |(until_ns, every)| topic == Topic::Tick && time_ns < until_ns && header.sequence % every != 0;
            if self.sparse_until.is_some_and(left_out) && !self.changes_mode(time_ns) {
                continue;
            }
            if time_ns < self.played_until_ns {
                // Played now, it would come after later ones.
                errors.push((header.log_time, DecodeError::TooMany("messages of chunks of one time", MOST_EVENTS)));
                continue;
            }
            let played = match topic {
                Topic::Tick => joiner.tick(&header, data).map(|tick| Some(Played::Tick(Box::new(tick)))),
                _ => schema::decode(topic, data)
                    .map(|record| record.map(|record| Played::Record(Stamped { time_ns, record }))),
            };
            match played {
                Ok(Some(played)) => {
                    self.queued += played.weight();
                    self.queue.push_back(played);
                }
                Ok(None) => {}
                Err(error) => errors.push((header.log_time, error)),
            }
        }
        self.carried.1 = joiner.command.map(|(header, data)| (header, data.to_vec()));
        self.unreadable.add(chunk.span.offset, errors);
        // Ticks and records come from two producers: a record may be written a little after ticks that are newer.
        self.queue.make_contiguous().sort_by_key(Played::time_ns);
    }
}

impl Iterator for Player {
    type Item = Played;

    /// Returns the next tick or record in the order of time; none at the end.
    fn next(&mut self) -> Option<Played> {
        // An unread chunk may hold something earlier than the queue.
        while let Some(chunk) = self.chunks.get(self.next_chunk) {
            let starts = chunk.start.saturating_sub(self.start_utc_ns);
            match self.queue.front() {
                Some(first) if first.time_ns() < starts => break,
                Some(first) if self.queued >= MOST_EVENTS => {
                    self.played_until_ns = first.time_ns();
                    break;
                }
                _ => self.read_chunk(),
            }
        }
        let played = self.queue.pop_front();
        self.queued -= played.as_ref().map_or(0, Played::weight);
        played
    }
}
