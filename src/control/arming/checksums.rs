//! Few states arrive with a wrong checksum; none on a machine without a link.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::Checksums, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    let corrupt = inputs.link.map_or(0.0, |link| f64::from(link.recent_corrupt));
    Reading::at_most(corrupt, f64::from(settings.pre_arm.corrupt))
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence { found: format!("{:.0} corrupt", finding.measured), needed: format!("at most {} in 5 s", limits.corrupt) }
}
