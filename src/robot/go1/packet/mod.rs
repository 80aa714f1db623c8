//! The Go1's low-level datagrams; no sockets here.
//!
//! [`LowCmd`] and [`LowState`] have the memory layout of the datagrams (unaligned little-endian fields), so parsing a
//! state copies nothing. Layout, fixed point and checksums were observed on the official library (`docs/go1-wire.md`,
//! sections 2 to 4); `tests/golden_wire.rs` compares with datagrams that it sent and accepted.
//!
//! The byte that switches the battery off cannot be written: see [`LowCmd`].

mod command;
mod crc;
mod state;

use zerocopy::little_endian::{U16, U32};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

pub use crate::robot::crc::crc;
pub use crate::robot::remote::RemoteRecord;
pub use command::{COMMAND_LENGTH, LowCmd, MODE_BRAKE, MODE_SERVO, MotorTarget, POSITION_STOP, VELOCITY_STOP};
pub use crc::CrcForm;
pub use state::{BatteryRecord, ImuRecord, LowState, MotorRecord, STATE_LENGTH};

/// Number of motor records in a datagram; the Go1 uses the first twelve.
pub const MOTORS: usize = 20;
/// The first two bytes of every datagram.
pub const HEAD: [u8; 2] = [0xFE, 0xEF];
/// `Header::level` of the low-level protocol.
pub const LOW_LEVEL: u8 = 0xFF;
/// `Header::level` of the high-level protocol, whose states have another layout and the form [`CrcForm::Sealed`].
pub const HIGH_LEVEL: u8 = 0xEE;

/// First 22 bytes of every datagram. The meaning of the fields after `level` is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct Header {
    /// [`HEAD`].
    pub head: [u8; 2],
    /// [`LOW_LEVEL`] or [`HIGH_LEVEL`].
    pub level: u8,
    /// Reserved.
    pub frame_reserve: u8,
    /// Serial number.
    pub serial: [U32; 2],
    /// Version.
    pub version: [U32; 2],
    /// Bandwidth.
    pub bandwidth: U16,
}

impl Header {
    /// Returns the header of a low-level datagram, all other fields zero.
    pub fn low_level() -> Header {
        Header {
            head: HEAD,
            level: LOW_LEVEL,
            frame_reserve: 0,
            serial: [U32::ZERO; 2],
            version: [U32::ZERO; 2],
            bandwidth: U16::ZERO,
        }
    }
}

/// Reason for which a datagram is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum Rejection {
    /// A state that is too short, or a command of another length.
    #[error("a datagram of {length} bytes, expected {expected}")]
    Length { length: usize, expected: usize },
    /// Does not begin with [`HEAD`].
    #[error("a datagram that begins with {:02X} {:02X}, not FE EF", head[0], head[1])]
    Head { head: [u8; 2] },
    /// Wrong checksum for the form of the datagram.
    #[error("checksum {found:08X}, computed {computed:08X}")]
    Crc { found: u32, computed: u32 },
    /// A command that requests to switch the battery off, which drops the robot.
    #[error("a command that requests to switch the battery off (byte 562 is not zero)")]
    BatteryOff,
}

/// A number that a command cannot represent, in motor record `motor`, 0..20; `highest` is the first that is too large.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum CommandError {
    /// Not a finite number.
    #[error("{quantity} of motor {motor} is {value}, not a finite number")]
    NotFinite { quantity: &'static str, motor: usize, value: f32 },
    /// Outside of the range of the fixed point.
    #[error("{quantity} of motor {motor} is {value} {unit}; a datagram can hold {lowest} up to less than {highest}")]
    OutOfRange { quantity: &'static str, motor: usize, value: f32, unit: &'static str, lowest: f32, highest: f32 },
}
