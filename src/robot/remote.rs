//! Remote control: buttons and sticks as the robot reports them.

use serde::{Deserialize, Serialize};

/// Names of the buttons; the index is the bit of Unitree's `xKeySwitchUnion` (joystick.h of unitree_legged_sdk).
const NAMES: [&str; 16] =
    ["R1", "L1", "start", "select", "R2", "L2", "F1", "F2", "A", "B", "X", "Y", "up", "right", "down", "left"];

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buttons_are_parsed_as_they_are_written() {
        for text in ["L2+B", "R1", "none", "start+select+left"] {
            assert_eq!(text.parse::<RemoteButtons>().unwrap().to_string(), text);
        }
        assert_eq!("l2+b".parse(), Ok(RemoteButtons(1 << 5 | 1 << 9)));
        assert!("L9".parse::<RemoteButtons>().unwrap_err().contains("known buttons: R1"));
        assert!("".parse::<RemoteButtons>().is_err());
    }
}
