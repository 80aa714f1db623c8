//! The events of a recording, and its markers: from the copies at its end, or from the chunks that hold any.

use std::collections::BTreeSet;

use prost::Message;

use super::lost::{MOST_EVENTS, weight};
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
        // Those without a copy, in the order of time.
        let mut large: Option<BTreeSet<(u64, Topic)>> = None;
        let mut errors = Vec::new();
        for IndexedEvent { topic, log_time, data } in copies.into_iter().flatten() {
            let large = large.get_or_insert_default();
            match data {
                Some(data) => {
                    let added = self.add_event(topic, log_time, &data, &mut session);
                    errors.extend(added.err().map(|error| (log_time, error)));
                }
                None => drop(large.insert((log_time, topic))),
            }
        }
        self.unreadable.add(0, errors);
        for chunk in chunks {
            let channels = chunk.channels.as_ref();
            let holds = |wanted: &dyn Fn(Topic) -> bool| {
                let known = |channel: &u16| self.container.topic(*channel);
                channels.is_none_or(|channels| channels.iter().filter_map(known).any(wanted))
            };
            let read = match &large {
                Some(large) => {
                    let from_start = large.range((chunk.start, Topic::ALL[0])..);
                    let mut in_chunk = from_start.take_while(|(time, _)| *time <= chunk.end);
                    in_chunk.any(|(_, topic)| holds(&|held: Topic| held == *topic))
                }
                None => holds(&Topic::is_event),
            };
            if !read {
                continue;
            }
            let Some(records) = self.records_of(chunk) else { continue };
            let mut errors = Vec::new();
            for (header, data) in records.messages().flatten() {
                let Some(topic) = self.container.topic(header.channel_id).filter(|topic| topic.is_event()) else {
                    continue;
                };
                if large.as_ref().is_none_or(|large| large.contains(&(header.log_time, topic))) {
                    let added = self.add_event(topic, header.log_time, data, &mut session);
                    errors.extend(added.err().map(|error| (header.log_time, error)));
                }
            }
            self.unreadable.add(chunk.span.offset, errors);
        }
        session
    }

    /// Adds an event or a marker; leaves it out beyond [`MOST_EVENTS`].
    ///
    /// # Errors
    /// When it cannot be decoded.
    fn add_event(
        &mut self,
        topic: Topic,
        log_time: u64,
        data: &[u8],
        session: &mut Option<u64>,
    ) -> Result<(), DecodeError> {
        if self.counted_events >= MOST_EVENTS {
            let from = self.left_out_from.unwrap_or(log_time);
            self.left_out_from = Some(from.min(log_time));
            return Ok(());
        }
        if topic == Topic::Session && session.is_none() {
            *session = frog::Session::decode(data).ok().map(|message| message.start_utc_ns);
        }
        if topic == Topic::Marker {
            self.markers.push(Marker { time_ns: log_time, kind: marker(data)? });
            self.counted_events += 1;
        } else if let Some(record) = schema::decode(topic, data)? {
            let event = Stamped { time_ns: log_time, record };
            self.counted_events += weight(&event.record);
            self.events.push(event);
        }
        Ok(())
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

    /// Returns the error of a file without session: truncated before it, unreadable, or of another program.
    pub(super) fn no_session(&self) -> RecordingError {
        let path = self.path.clone();
        let bytes = std::fs::metadata(&path).map(|metadata| metadata.len()).unwrap_or_default();
        if self.chunks.is_empty() && self.container.cut.is_some() {
            RecordingError::TooShort { path, bytes }
        } else if let Some(first) = self.damaged.first() {
            RecordingError::UnreadableSession { path, reason: first.reason.clone() }
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
