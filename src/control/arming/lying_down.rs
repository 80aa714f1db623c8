//! The joints are near the folded pose, where the stand-up ramp begins.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::LyingDown, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    Reading::worst_joint(settings.pre_arm.lying_tolerance_rad, |joint| {
        (inputs.state.joint_position[joint] - settings.lying_position[joint]).abs()
    })
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: format!("{} {:.2} rad away", joint_of(finding), finding.measured),
        needed: format!("at most {:.2} rad", limits.lying_tolerance_rad),
    }
}
