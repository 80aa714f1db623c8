//! The charge suffices for a series of jumps; a battery that is not reported fails.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Battery,
    measure: |inputs, settings| {
        let charge = inputs.state.battery.map_or(f64::NAN, |battery| battery.charge_percent);
        Reading::at_least(charge, settings.arming.battery_percent)
    },
    found: |finding| format!("{:.0} %", finding.measured),
    needed: |limits| format!("at least {:.0} %", limits.battery_percent),
};
