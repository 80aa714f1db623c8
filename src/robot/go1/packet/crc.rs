//! Forms of the checksum in the Go1's datagrams (`docs/go1-wire.md`, section 3); the checksum itself is
//! [`crate::robot::crc::crc`].

/// Form of the checksum in a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CrcForm {
    /// Unchanged: in every command of the official library and in low-level states.
    Plain,
    /// Xored and rotated: in states of the high-level protocol, and in commands of the robot's factory controller.
    Sealed,
}

impl CrcForm {
    /// Returns the number in a datagram whose checksum is `crc`.
    pub const fn apply(self, crc: u32) -> u32 {
        match self {
            CrcForm::Plain => crc,
            CrcForm::Sealed => (crc ^ 0xEDCA_B9DE).rotate_right(8),
        }
    }
}
