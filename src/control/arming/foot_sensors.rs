//! The foot sensors of a lying robot report no more than its weight.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::FootSensors,
    measure: |inputs, settings| {
        let share = inputs.consistency.foot_load_n() / settings.weight_n;
        Reading::at_most(share, settings.arming.foot_load_share)
    },
    found: |finding| format!("{:.2} of the weight", finding.measured),
    needed: |limits| format!("at most {:.1} of the weight", limits.foot_load_share),
};
