//! The charge suffices for a series of jumps; a battery that is not reported fails.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::Battery, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    let charge = inputs.state.battery.map_or(f64::NAN, |battery| battery.charge_percent);
    Reading::at_least(charge, settings.pre_arm.battery_percent)
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: format!("{:.0} %", finding.measured),
        needed: format!("at least {:.0} %", limits.battery_percent),
    }
}
