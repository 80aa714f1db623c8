//! Copies of a file's events at its end: a reader lists the trials of a long recording without reading its chunks.

use std::borrow::Cow;
use std::collections::BTreeMap;

use prost::Message;

use super::container::Container;
use super::frog;
use super::topic::Topic;

/// Name of the attachment.
pub const NAME: &str = "events.binpb";

/// Largest event that is copied, bytes. Larger ones, the ticks before a fault, are read from their chunk.
const LARGEST_COPY: usize = 64 * 1024;

/// The copies of the events of a file that is being written.
#[derive(Debug, Default)]
pub struct EventIndexBuilder {
    events: Vec<frog::event_index::Event>,
}

impl EventIndexBuilder {
    /// Copies a message if it is an event.
    pub fn add(&mut self, topic: Topic, channel: u16, log_time: u64, data: &[u8]) {
        if topic.is_event() {
            let data = (data.len() <= LARGEST_COPY).then(|| data.to_vec());
            self.events.push(frog::event_index::Event { channel: channel.into(), log_time, data });
        }
    }

    /// Returns how often each event with a copy is there: channel, log time and data.
    pub fn counted(&self) -> BTreeMap<(u32, u64, Vec<u8>), usize> {
        let mut counts = BTreeMap::new();
        for event in &self.events {
            if let Some(data) = &event.data {
                *counts.entry((event.channel, event.log_time, data.clone())).or_default() += 1;
            }
        }
        counts
    }

    /// Returns the attachment that begins after `offset` bytes of the file, and forgets the events.
    pub fn attachment(&mut self, offset: u64) -> mcap::Attachment<'static> {
        let events = std::mem::take(&mut self.events);
        let time = events.last().map_or(0, |event| event.log_time);
        mcap::Attachment {
            log_time: time,
            create_time: time,
            name: NAME.into(),
            media_type: "application/x-protobuf".into(),
            data: Cow::Owned(frog::EventIndex { offset, events }.encode_to_vec()),
        }
    }
}

/// An event of the index; without data it is to be read from its chunk.
pub struct IndexedEvent {
    pub topic: Topic,
    pub log_time: u64,
    pub data: Option<Vec<u8>>,
}

/// Returns the copies of the events; none if the file has none, or if they are damaged or of another file.
pub fn read(container: &mut Container) -> Option<Vec<IndexedEvent>> {
    let span = *container.attachments.last()?;
    let body = container.read_record(span).ok()?;
    // The checksum is at the end; an attachment with none is not believed.
    if body.last_chunk::<4>().is_none_or(|checksum| *checksum == [0; 4]) {
        return None;
    }
    let attachment = container.read_attachment(span).ok().filter(|attachment| attachment.name == NAME)?;
    let index = frog::EventIndex::decode(&*attachment.data).ok().filter(|index| index.offset == span.offset)?;
    let event = |event: frog::event_index::Event| {
        let topic = container.topic(u16::try_from(event.channel).ok()?)?;
        Some(IndexedEvent { topic, log_time: event.log_time, data: event.data })
    };
    Some(index.events.into_iter().filter_map(event).collect())
}
