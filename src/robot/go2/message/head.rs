//! Fields at the beginning of commands and states.

use super::cdr::{CdrReader, CdrWriter};
use super::rejection::MessageRejection;

/// Number of motor records in a message; the Go2 uses the first twelve.
pub const MOTORS: usize = 20;
/// First 22 bytes of a command or state. The SDK sets `head` and `level`; the robot may not check them, so no message is
/// rejected for them. The meaning of the other fields is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MessageHead {
    /// FE EF from the SDK.
    pub head: [u8; 2],
    /// FF for the low level.
    pub level: u8,
    /// Reserved.
    pub frame_reserve: u8,
    /// Serial number.
    pub serial: [u32; 2],
    /// Version.
    pub version: [u32; 2],
    /// Bandwidth.
    pub bandwidth: u16,
}

impl MessageHead {
    /// The head of the SDK's low-level commands, all other fields zero.
    pub const LOW_LEVEL: MessageHead = MessageHead {
        head: [0xFE, 0xEF],
        level: 0xFF,
        frame_reserve: 0,
        serial: [0; 2],
        version: [0; 2],
        bandwidth: 0,
    };

    pub(super) fn read(reader: &mut CdrReader) -> Result<MessageHead, MessageRejection> {
        Ok(MessageHead {
            head: reader.bytes()?,
            level: reader.u8()?,
            frame_reserve: reader.u8()?,
            serial: reader.array(CdrReader::u32)?,
            version: reader.array(CdrReader::u32)?,
            bandwidth: reader.u16()?,
        })
    }

    pub(super) fn write(&self, writer: &mut CdrWriter) {
        writer.bytes(&self.head);
        writer.bytes(&[self.level, self.frame_reserve]);
        for word in self.serial.into_iter().chain(self.version) {
            writer.number(word.to_le_bytes());
        }
        writer.number(self.bandwidth.to_le_bytes());
    }
}
