//! The robot's clock runs as this computer's.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::RobotClock,
    measure: |inputs, settings| {
        Reading::at_most(inputs.consistency.clock_error_ms().abs(), settings.consistency.clock_step_ms)
    },
    found: |finding| format!("{:.0} ms off", finding.measured),
    needed: |_| "no step for 1 s".to_owned(),
};
