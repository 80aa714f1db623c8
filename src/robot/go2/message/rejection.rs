//! Conditions of a payload before its fields are read.

/// Encapsulation header of a payload: plain CDR, little-endian, no options.
pub const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Reason for which a payload is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum MessageRejection {
    /// Too short for the message.
    #[error("a payload of {length} bytes, expected at least {expected}")]
    Length { length: usize, expected: usize },
    /// Not plain little-endian CDR.
    #[error("encapsulation {:02X} {:02X}, expected 00 01 (CDR, little-endian)", kind[0], kind[1])]
    Encapsulation { kind: [u8; 2] },
    /// Wrong checksum.
    #[error("checksum {found:08X}, computed {computed:08X}")]
    Checksum { found: u32, computed: u32 },
    /// A text without its final zero byte or not in UTF-8, or a truth value other than 0 and 1.
    #[error("the {field} at byte {at} is malformed")]
    Malformed { field: &'static str, at: usize },
}

/// Returns the payload of serialized data: without the encapsulation header. Its last two bytes, options, are ignored.
///
/// # Errors
/// The header is missing or names another encoding.
pub fn payload(serialized: &[u8]) -> Result<&[u8], MessageRejection> {
    let Some((header, payload)) = serialized.split_first_chunk::<4>() else {
        return Err(MessageRejection::Length { length: serialized.len(), expected: 4 });
    };
    let kind = [header[0], header[1]];
    if kind == ENCAPSULATION[..2] { Ok(payload) } else { Err(MessageRejection::Encapsulation { kind }) }
}

/// Returns the first `N` bytes of a payload; more are padding of the transport.
pub(super) fn whole<const N: usize>(payload: &[u8]) -> Result<&[u8; N], MessageRejection> {
    payload.first_chunk().ok_or(MessageRejection::Length { length: payload.len(), expected: N })
}

/// Checks the checksum in the last word of a payload.
pub(super) fn check_sum(payload: &[u8], computed: u32) -> Result<(), MessageRejection> {
    let found = payload.last_chunk().map_or(0, |word| u32::from_le_bytes(*word));
    if found == computed { Ok(()) } else { Err(MessageRejection::Checksum { found, computed }) }
}
