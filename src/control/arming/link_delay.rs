//! The link is as fast as at first: with a delay that has grown, the failsafe would sit the robot down at once. The clock of a
//! robot whose computer stood still lags behind for good, which looks the same: a restart of this program measures anew.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::LinkDelay,
    measure: |inputs, settings| Reading::at_most(inputs.delay_growth_ms, settings.failsafe.delay_land_ms),
    found: |finding| format!("grown by {:.0} ms, limit {} ms", finding.measured, finding.allowed),
    needed: |_| "the delay of the start: check the cable, or restart this program".to_owned(),
};
