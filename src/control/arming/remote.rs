//! The remote control answers; its stop buttons damp the robot.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Remote,
    measure: |inputs, settings| {
        let silent = settings.remote.needed && inputs.state.remote.is_none();
        Reading::at_most(f64::from(u8::from(silent)), 0.0)
    },
    found: |finding| if finding.measured > 0.0 { "silent".to_owned() } else { "answers".to_owned() },
    needed: |_| "switched on, in reach".to_owned(),
};
