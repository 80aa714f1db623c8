//! The records of one chunk, decompressed at once and read in place.

use mcap::McapError;
use mcap::records::{MessageHeader, Record, op};

use super::error::ChunkError;
use super::lengths::texts_fit;

/// Opcode (1 byte) and length (8 bytes) before each record.
pub const RECORD_HEAD: usize = 9;

/// Most messages of a chunk. Small ones take many times their bytes in memory. A chunk that this program writes holds a quarter of a
/// megabyte: 260 messages in the samples.
const MOST_MESSAGES: usize = 65_536;

/// Returns opcode and body of each record in `bytes`, up to the first whose length does not fit.
pub fn records_in(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut unread = bytes;
    std::iter::from_fn(move || {
        let (head, rest) = unread.split_first_chunk::<RECORD_HEAD>()?;
        let length = u64::from_le_bytes(*head.last_chunk()?);
        let (body, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
        unread = rest;
        Some((head[0], body))
    })
}

/// The records of a chunk. Their lengths fit.
pub struct ChunkRecords {
    bytes: Vec<u8>,
    /// Whether a checksum guards them; without one every message is to be decoded before any is used.
    pub checked: bool,
}

impl ChunkRecords {
    /// Decompresses the body of a chunk record and verifies its checksum.
    ///
    /// # Errors
    /// When the chunk is longer than `largest` bytes, holds too many messages, cannot be decompressed, or is damaged.
    pub fn of(body: &[u8], largest: usize) -> Result<ChunkRecords, ChunkError> {
        let records = ChunkRecords::unpacked(body, largest)?;
        let messages = records.records().filter(|(opcode, _)| *opcode == op::MESSAGE).count();
        if messages > MOST_MESSAGES { Err(ChunkError::TooManyMessages { most: MOST_MESSAGES }) } else { Ok(records) }
    }

    fn unpacked(body: &[u8], largest: usize) -> Result<ChunkRecords, ChunkError> {
        if !texts_fit(op::CHUNK, body) {
            return Err(McapError::UnexpectedEoc.into());
        }
        let Record::Chunk { header, data } = mcap::parse_record(op::CHUNK, body)? else {
            unreachable!("parsed by its opcode");
        };
        let bytes = match header.compression.as_str() {
            _ if header.uncompressed_size > largest as u64 => {
                return Err(McapError::ChunkTooLarge(header.uncompressed_size).into());
            }
            "" => data.into_owned(),
            "zstd" => zstd::bulk::decompress(&data, header.uncompressed_size as usize)
                .map_err(|error| McapError::DecompressionError(error.to_string()))?,
            other => return Err(ChunkError::Compression { name: other.escape_default().to_string() }),
        };
        if bytes.len() as u64 != header.uncompressed_size {
            return Err(McapError::UnexpectedEoc.into());
        }
        let (saved, calculated) = (header.uncompressed_crc, crc32fast::hash(&bytes));
        if saved != 0 && saved != calculated {
            return Err(McapError::BadChunkCrc { saved, calculated }.into());
        }
        let records = ChunkRecords { bytes, checked: saved != 0 };
        let read: usize = records.records().map(|(_, body)| RECORD_HEAD + body.len()).sum();
        let fit = records.records().all(|(opcode, body)| texts_fit(opcode, body));
        if fit && read == records.bytes.len() { Ok(records) } else { Err(McapError::UnexpectedEoc.into()) }
    }

    /// Returns opcode and body of each record.
    pub fn records(&self) -> impl Iterator<Item = (u8, &[u8])> {
        records_in(&self.bytes)
    }

    /// Returns head and content of each message.
    pub fn messages(&self) -> impl Iterator<Item = Result<(MessageHeader, &[u8]), McapError>> {
        self.records().filter(|(opcode, _)| *opcode == op::MESSAGE).map(|(_, body)| {
            let Record::Message { header, .. } = mcap::parse_record(op::MESSAGE, body)? else {
                unreachable!("parsed by its opcode");
            };
            // The head of a message is 22 bytes: channel, sequence, log time, publish time.
            Ok((header, &body[2 + 4 + 8 + 8..]))
        })
    }
}
