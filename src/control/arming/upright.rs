//! Roll and pitch of the trunk are small.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Upright,
    measure: |inputs, settings| Reading::at_most(inputs.estimate.tilt_rad(), settings.arming.tilt_rad),
    found: |finding| format!("tilted {:.2} rad", finding.measured),
    needed: |limits| format!("at most {:.2} rad", limits.tilt_rad),
};
