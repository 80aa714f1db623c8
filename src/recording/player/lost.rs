//! Parts of a recording that cannot be read.

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
