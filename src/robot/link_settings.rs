//! Settings that the network section of each robot's `robot.toml` has.

use super::description::{DescriptionError, RobotFiles};
use super::state_counter::StateClock;

/// Settings that are the same on every link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkSettings {
    /// Reading of the robot's clock: period and restart.
    pub clock: StateClock,
    /// Time that a motor may take to report servo mode after the first command, ms.
    pub servo_grace_ms: u32,
    /// Force per count of a foot sensor, N.
    pub foot_force_n: f64,
}

impl LinkSettings {
    /// Checks the keys of `section` of `files`.
    ///
    /// # Errors
    /// A value is out of range.
    pub fn check(&self, files: &RobotFiles, section: &str) -> Result<(), DescriptionError> {
        let times = [
            ("state_period_ms", self.clock.state_period_ms, 1..=20, "give 1 to 20 milliseconds"),
            ("restart_ms", self.clock.restart_ms, 20..=10_000, "give 20 to 10000 milliseconds"),
            ("servo_grace_ms", self.servo_grace_ms, 0..=2000, "give 0 to 2000 milliseconds"),
        ];
        for (key, ms, range, remedy) in times {
            if !range.contains(&ms) {
                return Err(files.invalid(&format!("{section}.{key}"), format!("{ms} ms"), remedy));
            }
        }
        let force = self.foot_force_n;
        if !(0.01..=100.0).contains(&force) {
            let key = format!("{section}.foot_force_n");
            return Err(files.invalid(&key, format!("{force} N"), "give 0.01 to 100 N a count"));
        }
        Ok(())
    }
}
