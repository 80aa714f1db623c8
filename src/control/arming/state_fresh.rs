//! The newest state of the robot is recent.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::StateFresh, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    Reading::at_most(f64::from(inputs.state_age_ms), f64::from(settings.pre_arm.state_age_ms))
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence { found: format!("{:.0} ms old", finding.measured), needed: format!("at most {} ms", limits.state_age_ms) }
}
