//! The Go1's low-level datagrams as bytes; no sockets here.
//!
//! [`LowCmd`] and [`LowState`] *are* the datagrams: structures of unaligned little-endian fields that lie in memory as they
//! travel, so that judging a state copies nothing. Layout, fixed point and checksums are facts observed on the official
//! library (`specs/go1-wire.md`, sections 2 to 4); `tests/golden_wire.rs` compares with what it sent and accepted.
//!
//! The one dangerous byte cannot be written: see [`LowCmd`].

mod command;
mod crc;
mod state;

use zerocopy::little_endian::{U16, U32};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

pub use command::{COMMAND_LENGTH, LowCmd, MODE_DAMPING, MODE_SERVO, MotorTarget, POSITION_STOP, VELOCITY_STOP};
pub use crc::{CrcForm, crc};
pub use state::{BatteryRecord, ImuRecord, LowState, MotorRecord, STATE_LENGTH};

/// Motor records in a datagram; the Go1 uses the first twelve.
pub const MOTORS: usize = 20;
/// The first two bytes of every datagram.
pub const HEAD: [u8; 2] = [0xFE, 0xEF];
/// `Header::level` of the low-level protocol.
pub const LOW_LEVEL: u8 = 0xFF;
/// `Header::level` of the high-level protocol, whose states are sealed and laid out in another way.
pub const HIGH_LEVEL: u8 = 0xEE;

/// The 22 bytes with which every datagram begins. What the fields after `level` mean to the robot is not established.
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
    /// That of a low-level datagram, the rest zero.
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

/// Why a datagram is not one of ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// Too short, or for a command any other length.
    #[error("a datagram of {length} bytes, expected {expected}")]
    Length {
        /// Bytes that came.
        length: usize,
        /// Bytes that it should have (for a state: at least).
        expected: usize,
    },
    /// Does not begin with [`HEAD`].
    #[error("a datagram that begins with {:02X} {:02X}, not FE EF", head[0], head[1])]
    Head {
        /// The first two bytes.
        head: [u8; 2],
    },
    /// The checksum is wrong for the form that the datagram must have.
    #[error("checksum {found:08X}, computed {computed:08X}")]
    Crc {
        /// In the datagram.
        found: u32,
        /// Computed over it.
        computed: u32,
    },
    /// A command that asks to switch the battery off: the robot would drop. Never obeyed, never built.
    #[error("a command that asks to switch the battery off (byte 562 is not zero)")]
    BatteryOff,
}

/// A number that the fixed point of a command cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// Not a finite number.
    #[error("{quantity} of motor {motor} is {value}, not a finite number")]
    NotFinite {
        /// The quantity.
        quantity: &'static str,
        /// Motor record, 0..20.
        motor: usize,
        /// The value.
        value: f32,
    },
    /// Outside of what the datagram can say.
    #[error("{quantity} of motor {motor} is {value} {unit}; a datagram can say {lowest} up to less than {highest}")]
    OutOfRange {
        /// The quantity.
        quantity: &'static str,
        /// Motor record, 0..20.
        motor: usize,
        /// The value.
        value: f32,
        /// Its unit.
        unit: &'static str,
        /// Lowest value.
        lowest: f32,
        /// First value that is too much.
        highest: f32,
    },
}
