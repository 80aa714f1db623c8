//! The events of a recording, and its markers: from the copies at its end, or from the chunks that hold any.

use prost::Message;

use super::{Marker, MarkerKind, Player};
use crate::recording::container::Chunk;
use crate::recording::error::RecordingError;
use crate::recording::event_index::IndexedEvent;
use crate::recording::record::Stamped;
use crate::recording::topic::Topic;
use crate::recording::wire::DecodeError;
use crate::recording::{frog, schema};

impl Player {
    /// Reads the events of chunks, and of the copies at the end of the file. Appends them and the markers with their log times;
    /// returns that of engine time 0, from the session's first record.
    pub(super) fn read_events(&mut self, chunks: &[Chunk], copies: Option<Vec<IndexedEvent>>) -> Option<u64> {
        let mut session = None;
        let mut large: Option<Vec<(Topic, u64)>> = None;
        for IndexedEvent { topic, log_time, data } in copies.into_iter().flatten() {
            let large = large.get_or_insert_default();
            match data {
                Some(data) => self.add_event(topic, log_time, &data, &mut session),
                None => large.push((topic, log_time)),
            }
        }
        for chunk in chunks {
            let channels = chunk.channels.as_ref();
            let holds = |wanted: &dyn Fn(Topic) -> bool| {
                let known = |channel: &u16| self.container.topic(*channel);
                channels.is_none_or(|channels| channels.iter().filter_map(known).any(wanted))
            };
            let in_chunk = |(topic, time): &(Topic, u64)| {
                (chunk.start..=chunk.end).contains(time) && holds(&|held: Topic| held == *topic)
            };
            let read = match &large {
                Some(large) => large.iter().any(in_chunk),
                None => holds(&Topic::is_event),
            };
            if !read {
                continue;
            }
            let Some(records) = self.records_of(chunk) else { continue };
            for (header, data) in records.messages().flatten() {
                let Some(topic) = self.container.topic(header.channel_id).filter(|topic| topic.is_event()) else {
                    continue;
                };
                if large.as_ref().is_none_or(|large| large.contains(&(topic, header.log_time))) {
                    self.add_event(topic, header.log_time, data, &mut session);
                }
            }
        }
        session
    }

    fn add_event(&mut self, topic: Topic, log_time: u64, data: &[u8], session: &mut Option<u64>) {
        if topic == Topic::Session && session.is_none() {
            *session = frog::Session::decode(data).ok().map(|message| message.start_utc_ns);
        }
        if topic == Topic::Marker {
            match marker(data) {
                Ok(kind) => self.markers.push(Marker { time_ns: log_time, kind }),
                Err(error) => self.note(&error),
            }
        } else {
            match schema::decode(topic, data) {
                Ok(record) => self.events.extend(record.map(|record| Stamped { time_ns: log_time, record })),
                Err(error) => self.note(&error),
            }
        }
    }

    /// Turns the log times of the events and markers from these on into times since the engine started, and sorts.
    pub(super) fn shift_events(&mut self, first_event: usize, first_marker: usize) {
        for event in &mut self.events[first_event..] {
            event.time_ns = event.time_ns.saturating_sub(self.start_utc_ns);
        }
        for marker in &mut self.markers[first_marker..] {
            marker.time_ns = marker.time_ns.saturating_sub(self.start_utc_ns);
        }
        self.events.sort_by_key(|event| event.time_ns);
        self.markers.sort_by_key(|marker| marker.time_ns);
    }

    /// Returns the error of a file without session: truncated before it, or of another program.
    pub(super) fn no_session(&self) -> RecordingError {
        let path = self.path.clone();
        let bytes = std::fs::metadata(&path).map(|metadata| metadata.len()).unwrap_or_default();
        if self.chunks.is_empty() && self.container.cut.is_some() {
            RecordingError::TooShort { path, bytes }
        } else {
            RecordingError::NoSession { path }
        }
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
