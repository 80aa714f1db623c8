//! Few states are lost on the way; none on a machine without a link.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Loss,
    measure: |inputs, settings| {
        Reading::at_most(inputs.link.map_or(0.0, |link| link.loss_share()), settings.arming.loss_share)
    },
    found: |finding| format!("{:.1} % lost", finding.measured * 100.0),
    needed: |limits| format!("at most {} % in 5 s", limits.loss_share * 100.0),
};
