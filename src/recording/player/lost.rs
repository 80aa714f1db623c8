//! Parts of a recording that cannot be read, and the number of events beyond which others are left out.

use std::collections::BTreeMap;

use crate::recording::record::Record;
use crate::recording::wire::DecodeError;

/// Most events and markers of a file, and most messages that are read ahead; each tick of a fault counts. A session writes some 20
/// events a trial.
pub const MOST_EVENTS: usize = 262_144;

/// A part of a recording that cannot be read.
#[derive(Debug, Clone, PartialEq)]
pub struct LostPart {
    /// Its begin since the engine started, ns.
    pub from_ns: u64,
    /// Its end, ns.
    pub to_ns: u64,
    /// Reason for which it cannot be read.
    pub reason: String,
}

/// A chunk that cannot be read; times are log times, ns UTC.
pub struct DamagedChunk {
    pub offset: u64,
    pub start: u64,
    pub end: u64,
    pub reason: String,
}

/// Messages that cannot be read. Those of a chunk that is read twice count once.
#[derive(Default)]
pub struct UnreadableMessages {
    /// Number of them in each chunk, by the chunk's offset; at offset 0 those among the copies of the events.
    counts: BTreeMap<u64, usize>,
    /// Log time and error of the earliest one.
    pub first: Option<(u64, DecodeError)>,
}

impl UnreadableMessages {
    /// Takes over those of one reading of a chunk.
    pub fn add(&mut self, offset: u64, errors: impl IntoIterator<Item = (u64, DecodeError)>) {
        let mut count = 0;
        for (log_time, error) in errors {
            count += 1;
            if self.first.as_ref().is_none_or(|(earliest, _)| log_time < *earliest) {
                self.first = Some((log_time, error));
            }
        }
        if count > 0 {
            let known = self.counts.entry(offset).or_default();
            *known = count.max(*known);
        }
    }

    /// Returns their number. A copy is of a message in a chunk.
    pub fn count(&self) -> usize {
        let copies = self.counts.get(&0).copied().unwrap_or(0);
        (self.counts.values().sum::<usize>() - copies).max(copies)
    }
}

/// Returns the number of events as which a record counts: a tick of a fault takes as much memory as a record.
pub fn weight(record: &Record) -> usize {
    match record {
        Record::FaultTicks(ticks) => ticks.len().max(1),
        _ => 1,
    }
}
