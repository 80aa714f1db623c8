//! The newest state of the robot is recent.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::StateFresh,
    measure: |inputs, settings| Reading::at_most(inputs.state_age_ms.into(), settings.arming.state_age_ms.into()),
    found: |finding| format!("{:.0} ms old", finding.measured),
    needed: |limits| format!("at most {} ms", limits.state_age_ms),
};
