//! Remote control: buttons and sticks as the robot reports them.

use serde::{Deserialize, Serialize};
use zerocopy::little_endian::{F32, U16};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

/// Names of the buttons; the index is the bit of Unitree's `xKeySwitchUnion` (joystick.h of unitree_legged_sdk).
const NAMES: [&str; 16] =
    ["R1", "L1", "start", "select", "R2", "L2", "F1", "F2", "A", "B", "X", "Y", "up", "right", "down", "left"];

/// Head of the remote control's bytes that an emulator sends. Assumption: not zero while the remote control answers.
const ANSWERING_HEAD: [u8; 2] = [0x55, 0x51];

/// A set of buttons, written as `L2+B`; the empty set is `none`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct RemoteButtons(pub u16);

impl RemoteButtons {
    /// Whether the set has no button.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether every button of `others` is in the set.
    pub const fn contains(self, others: RemoteButtons) -> bool {
        self.0 & others.0 == others.0
    }
}

impl std::fmt::Display for RemoteButtons {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let pressed = NAMES.iter().enumerate().filter(|(bit, _)| self.0 >> bit & 1 == 1);
        let mut separator = "";
        for (_, name) in pressed {
            write!(f, "{separator}{name}")?;
            separator = "+";
        }
        if self.is_empty() { f.write_str("none") } else { Ok(()) }
    }
}

impl std::str::FromStr for RemoteButtons {
    type Err = String;

    fn from_str(text: &str) -> Result<RemoteButtons, String> {
        if text == "none" {
            return Ok(RemoteButtons::default());
        }
        let bit = |name: &str| {
            let found = NAMES.iter().position(|known| known.eq_ignore_ascii_case(name));
            let known = NAMES.join(", ");
            found.ok_or_else(|| format!("\"{name}\" is not a button; write buttons as L2+B; known buttons: {known}"))
        };
        text.split('+').try_fold(RemoteButtons::default(), |set, name| Ok(RemoteButtons(set.0 | 1 << bit(name)?)))
    }
}

impl TryFrom<String> for RemoteButtons {
    type Error = String;

    fn try_from(text: String) -> Result<RemoteButtons, String> {
        text.parse()
    }
}

impl From<RemoteButtons> for String {
    fn from(buttons: RemoteButtons) -> String {
        buttons.to_string()
    }
}

/// State of the remote control.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Remote {
    /// Pressed buttons.
    pub buttons: RemoteButtons,
    /// Left stick, x and y, -1 to 1.
    pub left_stick: [f64; 2],
    /// Right stick, x and y, -1 to 1.
    pub right_stick: [f64; 2],
    /// Travel of L2, 0 to 1.
    pub l2_travel: f64,
}

/// Record of the remote control in a state of the Go1 or the Go2, 40 bytes: Unitree's `xRockerBtnDataStruct` (joystick.h of
/// unitree_legged_sdk).
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct RemoteRecord {
    /// Head; its value is not established.
    pub head: [u8; 2],
    /// Pressed buttons, one bit each.
    pub buttons: U16,
    /// Left stick, x.
    pub left_x: F32,
    /// Right stick, x and y.
    pub right: [F32; 2],
    /// Travel of L2.
    pub l2: F32,
    /// Left stick, y.
    pub left_y: F32,
    /// Unused.
    pub idle: [u8; 16],
}

impl RemoteRecord {
    /// Whether the remote control answers: a byte is not zero.
    pub fn answers(&self) -> bool {
        self.as_bytes().iter().any(|byte| *byte != 0)
    }

    /// Decodes the bytes; none if the remote control does not answer.
    pub fn decode(&self) -> Option<Remote> {
        let [left_x, right_x, right_y, l2, left_y] =
            [self.left_x, self.right[0], self.right[1], self.l2, self.left_y].map(|axis| axis.get().into());
        self.answers().then_some(Remote {
            buttons: RemoteButtons(self.buttons.get()),
            left_stick: [left_x, left_y],
            right_stick: [right_x, right_y],
            l2_travel: l2,
        })
    }

    /// Encodes a remote control that answers, for the emulator.
    pub fn encode(remote: &Remote) -> RemoteRecord {
        let float = |value: f64| F32::from(value as f32);
        RemoteRecord {
            head: ANSWERING_HEAD,
            buttons: remote.buttons.0.into(),
            left_x: float(remote.left_stick[0]),
            right: remote.right_stick.map(float),
            l2: float(remote.l2_travel),
            left_y: float(remote.left_stick[1]),
            idle: [0; 16],
        }
    }
}

const _: () = assert!(size_of::<RemoteRecord>() == 40);
