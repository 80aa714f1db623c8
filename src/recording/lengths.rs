//! Lengths inside a record, checked before the MCAP library reads it: it allocates the length that a text names before it reads the
//! text, up to 4 GB.

use mcap::records::op;

/// Returns the length of the text at `at`; the largest number beyond the end of `body`.
pub fn length(body: &[u8], at: u64) -> u32 {
    let bytes = usize::try_from(at).ok().and_then(|at| body.get(at..at + 4)).and_then(|bytes| bytes.try_into().ok());
    bytes.map_or(u32::MAX, u32::from_le_bytes)
}

/// Returns whether the texts of a record fit in it.
pub fn texts_fit(opcode: u8, body: &[u8]) -> bool {
    // A text is its length and its bytes.
    let after_text = |at: u64| at + 4 + u64::from(length(body, at));
    // A map is the length of all its keys and values, and these texts.
    let after_map = |map: u64| {
        let end = after_text(map);
        let mut at = map + 4;
        while at < end {
            at = after_text(at);
        }
        at
    };
    let end = match opcode {
        // Start, end, length, checksum; name of the compression.
        op::CHUNK => after_text(8 + 8 + 8 + 4),
        // Number; name, encoding, definition.
        op::SCHEMA => after_text(after_text(after_text(2))),
        // Number, number of the schema; topic, encoding, metadata.
        op::CHANNEL => after_map(after_text(after_text(4))),
        op::METADATA => after_map(after_text(0)),
        // Two times, offset, length; offsets of the messages; their length; name of the compression; two lengths.
        op::CHUNK_INDEX => after_text(after_text(8 + 8 + 8 + 8) + 8) + 8 + 8,
        // Offset, length, two times, length of the data; name, media type.
        op::ATTACHMENT_INDEX => after_text(after_text(8 + 8 + 8 + 8 + 8)),
        // Offset, length; name.
        op::METADATA_INDEX => after_text(8 + 8),
        _ => 0,
    };
    end <= body.len() as u64
}
