//! Damage of a recording: chunks that cannot be read, and the time that they take.

use std::fmt;
use std::path::PathBuf;

use foxglove::messages::JointStates;
use prost::Message;

use super::Player;
use super::lost::{DamagedChunk, LostPart, MOST_EVENTS};
use crate::recording::chunk::ChunkRecords;
use crate::recording::container::Chunk;
use crate::recording::error::RecordingError;
use crate::recording::recover;
use crate::recording::topic::Topic;
use crate::recording::wire::DecodeError;
use crate::recording::{frog, schema};
use crate::trial::{counted, counted_are};

/// Period of the ticks, ns.
const TICK_NS: u64 = 1_000_000;

/// Longest time between the messages of a chunk, and between chunks, that needs no proof, ns: a session flushes every second.
const USUAL_SPAN_NS: u64 = 60_000_000_000;

/// The missing parts of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The recording.
    pub path: PathBuf,
    /// Their description.
    pub parts: String,
    /// Whether `quadfrog recover` helps: against damaged chunks and a missing end. Messages it copies as they are.
    pub is_recoverable: bool,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.parts)
    }
}

impl Player {
    /// Returns the missing parts found so far: a truncated end is found on opening, a chunk with a wrong checksum when it is played.
    /// None for an intact file.
    pub fn damage(&self) -> Option<Damage> {
        let seconds = |log_time: u64| log_time.saturating_sub(self.start_utc_ns) as f64 / 1e9;
        let unreadable = self.unreadable.first.as_ref().map(|(log_time, error)| {
            let count = self.unreadable.count();
            let first = if count > 1 { "the first " } else { "" };
            let messages = counted(count, "message");
            // A newer version writes every part of a tick.
            let newer = if matches!(error, DecodeError::Missing(_)) { "" } else { "; perhaps of a newer version" };
            format!("{messages} cannot be read, {first}at {:.3} s: {error}{newer}", seconds(*log_time))
        });
        let left_out = self.left_out_from.map(|log_time| {
            let from_s = seconds(log_time);
            format!(
                "holds more than {MOST_EVENTS} events; those after {from_s:.3} s are left out: damaged, or not written by quadfrog"
            )
        });
        let chunks = self.damaged.first().map(|first| {
            format!(
                "{} of {} damaged and left out, {:.3} s ({})",
                self.damaged.len(),
                counted_are(self.chunks.len(), "chunk"),
                self.lost_ns() as f64 / 1e9,
                first.reason
            )
        });
        let unguarded = (!self.unguarded.is_empty()).then(|| {
            let count = counted(self.unguarded.len(), "chunk");
            format!("{count} without a checksum played as decoded; a wrong number there is not seen")
        });
        let cut = &self.container.cut;
        let is_recoverable = cut.is_some() || chunks.is_some() || unguarded.is_some();
        let parts = [&unreadable, &left_out, cut, &chunks, &unguarded];
        let parts: Vec<&str> = parts.into_iter().flatten().map(String::as_str).collect();
        (!parts.is_empty()).then(|| Damage { path: self.path.clone(), parts: parts.join("; "), is_recoverable })
    }

    /// Verifies what playing does not read: attachments, metadata, index and the checksum of all data. Returns what is damaged.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn check_extras(&mut self) -> Result<Vec<String>, RecordingError> {
        let (attachments, metadata) = (self.container.attachments.clone(), self.container.metadata.clone());
        let mut found = Vec::new();
        let bad = attachments.into_iter().filter(|span| self.container.read_attachment(*span).is_err()).count();
        if bad > 0 {
            found.push(format!("{} damaged", counted_are(bad, "attachment")));
        }
        let bad =
            metadata.into_iter().filter(|span| !matches!(self.container.read_metadata(*span), Ok(Some(_)))).count();
        if bad > 0 {
            found.push(format!("{} damaged", counted_are(bad, "metadata record")));
        }
        if self.container.scanned && self.is_complete() {
            found.push("its index is damaged; its chunks were found one by one".into());
        }
        let whole = self.container.verify_data().map_err(|error| RecordingError::of_reading(&self.path, error))?;
        if whole == Some(false) && found.is_empty() && self.damaged.is_empty() && self.unguarded.is_empty() {
            found.push("bytes between its chunks are damaged; every message is there".into());
        }
        Ok(found)
    }

    /// Returns what was lost already when the file was recovered from a damaged one, one line for each recovery.
    /// [`Player::check_extras`] names metadata that cannot be read.
    pub fn lost_before_recovery(&mut self) -> Vec<String> {
        let spans = self.container.metadata.clone();
        let read = spans.into_iter().filter_map(|span| self.container.read_metadata(span).ok().flatten());
        let recoveries = read.filter(|metadata| metadata.name == recover::RECOVERED);
        let lost = recoveries.filter_map(|mut metadata| metadata.metadata.remove(recover::LOST));
        lost.map(|lost| format!("recovered from a file that was not whole: {lost}")).collect()
    }

    /// Returns the lines of [`Player::lost_before_recovery`], each after the file's name.
    pub fn named_losses_before_recovery(&mut self) -> Vec<String> {
        let lost = self.lost_before_recovery();
        lost.into_iter().map(|lost| format!("{}: {lost}", self.path.display())).collect()
    }

    /// Returns the reason for which the end of the file is missing; none for a finished file.
    pub fn cut(&self) -> Option<&str> {
        self.container.cut.as_deref()
    }

    /// Returns whether more may have followed what is there: the end of the data is missing.
    pub fn lacks_data_at_its_end(&self) -> bool {
        self.container.lacks_data_at_its_end()
    }

    /// Returns whether the file was completed: it has an end, though perhaps a damaged one.
    pub fn is_complete(&self) -> bool {
        self.container.cut.is_none()
    }

    /// Returns the parts found so far that cannot be read, in the order in which they were found.
    pub fn lost(&self) -> impl ExactSizeIterator<Item = LostPart> + '_ {
        self.damaged.iter().map(|chunk| LostPart {
            from_ns: chunk.start.saturating_sub(self.start_utc_ns),
            to_ns: chunk.end.saturating_sub(self.start_utc_ns),
            reason: chunk.reason.clone(),
        })
    }

    /// Returns the time that the parts found so far take together, ns.
    pub fn lost_ns(&self) -> u64 {
        let mut parts: Vec<_> = self.damaged.iter().map(|chunk| (chunk.start, chunk.end)).collect();
        parts.sort_unstable();
        let mut until = 0;
        let new = |(start, end): (u64, u64)| {
            let from = start.max(until);
            until = until.max(end);
            end.saturating_sub(from)
        };
        parts.into_iter().map(new).fold(0, u64::saturating_add)
    }

    /// Takes the times of chunks with unusual ones from their messages. Without the file's index no checksum guards them: a wrong
    /// one would reach years.
    pub(super) fn prove_times(&mut self, chunks: &mut [Chunk]) {
        let mut before = self.chunks.iter().map(|chunk| chunk.end).max();
        for chunk in chunks {
            let span = chunk.end.checked_sub(chunk.start);
            let usual = span.is_some_and(|span| span <= USUAL_SPAN_NS)
                && before.is_some_and(|before| chunk.start.abs_diff(before) <= USUAL_SPAN_NS);
            if !usual {
                let records = self.container.read_chunk(chunk);
                let times = records.iter().flat_map(|records| records.messages().flatten());
                let times = times.map(|(header, _)| header.log_time);
                let first_and_last = times.fold(None, |found: Option<(u64, u64)>, time| {
                    let (first, last) = found.unwrap_or((time, time));
                    Some((first.min(time), last.max(time)))
                });
                let unknown = before.unwrap_or(chunk.start);
                (chunk.start, chunk.end) = first_and_last.unwrap_or((unknown, unknown));
            }
            before = Some(chunk.end);
        }
    }

    /// Returns the records of a chunk; none of a damaged one, which is noted.
    pub(super) fn records_of(&mut self, chunk: &Chunk) -> Option<ChunkRecords> {
        let records = self.container.read_chunk(chunk).map_err(|error| error.to_string());
        let proved = records.and_then(|records| match records.checked {
            true => Ok(records),
            false => self.decodable(chunk, &records).map(|()| records),
        });
        match proved {
            Ok(records) => {
                if !records.checked {
                    self.unguarded.insert(chunk.span.offset);
                }
                Some(records)
            }
            Err(reason) => {
                let Chunk { span, start, end, .. } = *chunk;
                if !self.damaged.iter().any(|known| known.offset == span.offset) {
                    // A tick lasts 1 ms: the last one of the chunk is lost, too.
                    self.damaged.push(DamagedChunk {
                        offset: span.offset,
                        start,
                        end: end.saturating_add(TICK_NS),
                        reason,
                    });
                }
                None
            }
        }
    }

    /// Decodes every message of a chunk without a checksum.
    ///
    /// # Errors
    /// The reason when a message cannot be decoded, or is not of the chunk's time or of a channel that its index names.
    fn decodable(&self, chunk: &Chunk, records: &ChunkRecords) -> Result<(), String> {
        for message in records.messages() {
            let (header, data) = message.map_err(|error| error.to_string())?;
            let known = chunk.channels.as_ref().is_none_or(|channels| channels.contains(&header.channel_id));
            if !known || !(chunk.start..=chunk.end).contains(&header.log_time) {
                return Err("no checksum, and a message that does not belong to it".into());
            }
            let decoded = match self.container.topic(header.channel_id) {
                Some(Topic::JointStates) => JointStates::decode(data).map(drop).map_err(DecodeError::from),
                Some(Topic::JointCommand) => frog::JointCommand::decode(data).map(drop).map_err(DecodeError::from),
                Some(Topic::Tick) => frog::ControlTick::decode(data).map(drop).map_err(DecodeError::from),
                Some(topic) => schema::decode(topic, data).map(drop),
                None => Ok(()),
            };
            decoded.map_err(|error| format!("no checksum, and a message that cannot be read: {error}"))?;
        }
        Ok(())
    }
}
