//! The charge suffices for a series of jumps; a battery that is not reported, or with more than 100 %, fails.

use super::check::*;
use crate::control::failsafe_causes::reported_charge;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Battery,
    measure: |inputs, settings| Reading::at_least(reported_charge(inputs.state), settings.arming.battery_percent),
    found: |finding| format!("{:.0} %", finding.measured),
    needed: |limits| format!("at least {:.0} %", limits.battery_percent),
};
