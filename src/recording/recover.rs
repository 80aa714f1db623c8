//! Recovery of a recording that was not finished or is damaged.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::{MessageHeader, Metadata, Record};

use super::container::Container;
use super::error::RecordingError;
use super::event_index::{self, IndexedEvent};
use super::output::{Output, with_suffix};
use super::topic::Topic;
use crate::trial::counted_are;
use crate::unfinished::Unfinished;

/// Name of the metadata record of a recovered file that lacks something, and its key for what that is.
pub(super) const RECOVERED: &str = "recovered";
pub(super) const LOST: &str = "lost";

/// Events of damaged chunks that one new chunk holds, at most.
const EVENTS_OF_A_CHUNK: u32 = 1_000;

/// Result of a recovery.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovered {
    /// The new file. The old one is unchanged.
    pub path: PathBuf,
    /// Ticks in it.
    pub ticks: u64,
    /// Messages in it, the ticks' among them.
    pub messages: u64,
    /// Description of the lost parts; none if only the file's index was missing.
    pub lost: Option<String>,
}

/// Copies everything readable of `path` (`*.mcap.part`, or a finished file that was damaged later) into a new file with
/// an index: `x.mcap` for `x.mcap.part`, `x.recovered.mcap` for `x.mcap`. Nothing is overwritten and nothing deleted.
///
/// # Errors
/// When there is nothing to recover or no session in it, when the new file exists already, or when the disk fails.
pub fn recover(path: impl AsRef<Path>) -> Result<Recovered, RecordingError> {
    let path = path.as_ref();
    let target = match path.extension() {
        Some(extension) if extension == "part" => path.with_extension(""),
        _ => path.with_extension("recovered.mcap"),
    };
    recover_to(path, &target)
}

/// Like [`recover`], into the new file `target` (`*.mcap`).
///
/// # Errors
/// Those of [`recover`], and when the name does not end in `.mcap`.
pub fn recover_to(path: &Path, target: &Path) -> Result<Recovered, RecordingError> {
    if !path.exists() {
        return Err(RecordingError::Missing { path: path.into() });
    }
    if target.extension().is_none_or(|extension| extension != "mcap") {
        return Err(RecordingError::Name { path: target.into() });
    }
    let mut container = Container::open(path)?;
    let exists = || RecordingError::Exists { path: target.into() };
    if target.exists() {
        return Err(exists());
    }
    if container.chunks.is_empty() {
        let bytes = fs::metadata(path).map(|metadata| metadata.len()).unwrap_or_default();
        return Err(RecordingError::TooShort { path: path.into(), bytes });
    }
    let unfinished = with_suffix(target, ".recovering");
    let io = |doing, path: &Path| {
        let path = path.to_path_buf();
        move |source: io::Error| RecordingError::Io { path, doing, source }
    };
    // Of two recoveries into one file the second is refused, before it would empty what the first writes.
    let file = File::options().write(true).create(true).truncate(false).open(&unfinished);
    let file = file.map_err(io("create the file", &unfinished))?;
    file.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => RecordingError::Recovering { path: unfinished.clone() },
        TryLockError::Error(source) => io("lock the file", &unfinished)(source),
    })?;
    let _unfinished = Unfinished::enter(&unfinished);
    if target.exists() {
        // The first has ended meanwhile, and this is its file.
        return Err(exists());
    }
    file.set_len(0).map_err(io("create the file", &unfinished))?;
    let result = Output::new(Box::new(file)).and_then(|out| RecordCopier::new(out).all(&mut container));
    let result = result.map_err(|error| RecordingError::of_writing(&unfinished, error));
    let named = result.and_then(|copied| {
        if copied.sessions == 0 {
            let path = path.into();
            return Err(match copied.first_damage {
                Some(reason) => RecordingError::UnreadableSession { path, reason },
                None => RecordingError::NoSession { path },
            });
        }
        if target.exists() {
            return Err(exists());
        }
        fs::rename(&unfinished, target).map_err(io("give the file its final name", &unfinished)).map(|()| copied)
    });
    // The beginning of a copy is of no use, and takes the room that may be short.
    let copied = named.inspect_err(|_| drop(fs::remove_file(&unfinished)))?;
    Ok(Recovered { path: target.into(), ticks: copied.ticks, messages: copied.messages, lost: copied.lost })
}

/// Copies records, with the new file's numbers of schemas and channels.
struct RecordCopier {
    out: Output,
    schemas: HashMap<u16, u16>,
    channels: HashMap<u16, (u16, Option<Topic>)>,
    done: CopyCounts,
}

#[derive(Default)]
struct CopyCounts {
    ticks: u64,
    messages: u64,
    /// Messages on `/session`.
    sessions: u64,
    damaged_chunks: usize,
    /// Reason of the first damaged chunk.
    first_damage: Option<String>,
    /// Messages of channels that the file does not describe.
    unknown_messages: usize,
    /// Attachments and metadata.
    damaged_extras: usize,
    /// Description of the lost parts.
    lost: Option<String>,
}

impl RecordCopier {
    fn new(out: Output) -> RecordCopier {
        let (schemas, channels) = (HashMap::new(), HashMap::new());
        RecordCopier { out, schemas, channels, done: CopyCounts::default() }
    }

    /// Copies everything, metadata and attachments first.
    fn all(mut self, container: &mut Container) -> Result<CopyCounts, McapError> {
        // The first chunk has the schemas and channels, too; it may be damaged.
        for definition in std::mem::take(&mut container.definitions) {
            self.record(definition)?;
        }
        let copies = event_index::read(container).unwrap_or_default();
        for span in container.metadata.clone() {
            match container.read_metadata(span) {
                Ok(Some(metadata)) => self.out.mcap.write_metadata(&metadata)?,
                Ok(None) | Err(_) => self.done.damaged_extras += 1,
            }
        }
        for span in container.attachments.clone() {
            match container.read_attachment(span) {
                // The new file has an index of its own events.
                Ok(attachment) if attachment.name == event_index::NAME => {}
                Ok(attachment) => self.out.mcap.attach(&attachment)?,
                Err(_) => self.done.damaged_extras += 1,
            }
        }
        for chunk in container.chunks.clone() {
            let chunk = container.read_chunk(&chunk);
            let parsed =
                chunk.as_ref().map(|chunk| chunk.records().map(|(opcode, body)| mcap::parse_record(opcode, body)));
            match parsed.map(Iterator::collect::<Result<Vec<_>, _>>) {
                Ok(Ok(records)) => {
                    for record in records {
                        self.record(record)?;
                    }
                    // The new file has the chunks of the old one: each holds whole ticks.
                    self.out.mcap.flush()?;
                }
                Ok(Err(error)) => self.damaged(&error),
                Err(error) => self.damaged(error),
            }
        }
        if self.done.damaged_chunks > 0 {
            self.events_of_damaged_chunks(copies)?;
        }
        self.done.lost = self.lost(container);
        if let Some(lost) = &self.done.lost {
            let metadata = BTreeMap::from([(LOST.into(), lost.clone())]);
            self.out.mcap.write_metadata(&Metadata { name: RECOVERED.into(), metadata })?;
        }
        self.out.finish()?;
        Ok(self.done)
    }

    fn damaged(&mut self, reason: &dyn Display) {
        self.done.damaged_chunks += 1;
        self.done.first_damage.get_or_insert_with(|| reason.to_string());
    }

    /// Writes the events that only the copies at the end of the old file still have, the session's own among them.
    fn events_of_damaged_chunks(&mut self, copies: Vec<IndexedEvent>) -> Result<(), McapError> {
        // Several events of a channel may have one time: the rows with which a continued session begins.
        let mut written = self.out.events.counted();
        for (sequence, event) in (1..).zip(copies) {
            let IndexedEvent { topic, log_time, data: Some(data) } = event else { continue };
            let of_topic = self.channels.iter().find(|(_, (_, known))| *known == Some(topic));
            let Some((&channel_id, &(new_id, _))) = of_topic else { continue };
            let event = (u32::from(new_id), log_time, data);
            match written.get_mut(&event) {
                Some(left) if *left > 0 => *left -= 1,
                _ => {
                    let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
                    self.record(Record::Message { header, data: event.2.into() })?;
                }
            }
            if sequence % EVENTS_OF_A_CHUNK == 0 {
                self.out.mcap.flush()?;
            }
        }
        self.out.mcap.flush()
    }

    /// Describes what the new file lacks of the old one.
    fn lost(&self, container: &Container) -> Option<String> {
        let CopyCounts { damaged_chunks, damaged_extras, unknown_messages, .. } = self.done;
        let damaged = [
            (damaged_chunks > 0)
                .then(|| format!("{damaged_chunks} of {} damaged", counted_are(container.chunks.len(), "chunk"))),
            (damaged_extras > 0).then(|| format!("{} damaged", counted_are(damaged_extras, "attachment"))),
            (unknown_messages > 0)
                .then(|| format!("{} of unknown channels and left out", counted_are(unknown_messages, "message"))),
        ];
        // A missing index is made anew.
        let cut = container.cut.clone().filter(|_| container.lacks_data_at_its_end());
        let lost: Vec<_> = cut.into_iter().chain(damaged.into_iter().flatten()).collect();
        (!lost.is_empty()).then(|| lost.join("; "))
    }

    fn record(&mut self, record: Record<'_>) -> Result<(), McapError> {
        let mcap = &mut self.out.mcap;
        match record {
            Record::Schema { header, data } => {
                let id = mcap.add_schema(&header.name, &header.encoding, &data)?;
                self.schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).copied().unwrap_or_default();
                let id = mcap.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata)?;
                self.channels.insert(channel.id, (id, Topic::from_name(&channel.topic)));
            }
            Record::Message { mut header, data } => {
                if let Some(&(id, topic)) = self.channels.get(&header.channel_id) {
                    self.done.messages += 1;
                    self.done.ticks += u64::from(topic == Some(Topic::Tick));
                    self.done.sessions += u64::from(topic == Some(Topic::Session));
                    header.channel_id = id;
                    if let Some(topic) = topic {
                        self.out.events.add(topic, id, header.log_time, &data);
                    }
                    mcap.write_to_known_channel(&header, &data)?;
                } else {
                    self.done.unknown_messages += 1;
                }
            }
            _ => {}
        }
        Ok(())
    }
}
