//! The remote control answers; its stop buttons damp the robot.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Remote,
    measure: |inputs, settings| Reading::at_most(f64::from(u8::from(settings.misses_remote(inputs.state))), 0.0),
    found: |finding| if finding.measured > 0.0 { "silent".to_owned() } else { "answers".to_owned() },
    needed: |_| "switched on, in reach".to_owned(),
};
