//! Time for the motors to enter servo mode once they are commanded.

use super::{JOINTS, RobotState};

/// Decides when the mode that a motor reports counts: a motor can leave servo mode only after it was commanded and had the time
/// to enter it.
#[derive(Debug)]
pub struct ServoGrace {
    grace_ms: u32,
    /// Time since servo mode was first commanded after the robot's last boot, ms.
    commanded_ms: Option<u32>,
    /// Reboots of the robot up to the newest state.
    reboots: u64,
}

impl ServoGrace {
    /// A motor has `grace_ms` to enter servo mode.
    pub fn new(grace_ms: u32) -> ServoGrace {
        ServoGrace { grace_ms, commanded_ms: None, reboots: 0 }
    }

    /// Counts one millisecond.
    pub fn advance(&mut self) {
        if let Some(ms) = &mut self.commanded_ms {
            *ms = ms.saturating_add(1);
        }
    }

    /// Servo mode was commanded.
    pub fn command(&mut self) {
        self.commanded_ms.get_or_insert(0);
    }

    /// Corrects `motor_enabled` of a state after `reboots` restarts of the robot.
    pub fn apply(&mut self, state: &mut RobotState, reboots: u64) {
        if reboots != self.reboots {
            self.reboots = reboots;
            self.commanded_ms = None;
        }
        if self.commanded_ms.is_none_or(|ms| ms <= self.grace_ms) {
            state.motor_enabled = [true; JOINTS];
        }
    }
}
