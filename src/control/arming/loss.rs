//! Few states are lost on the way; none on a machine without a link.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::Loss, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    Reading::at_most(inputs.link.map_or(0.0, |link| link.loss_share()), settings.pre_arm.loss_share)
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: format!("{:.1} % lost", finding.measured * 100.0),
        needed: format!("at most {} % in 5 s", limits.loss_share * 100.0),
    }
}
