//! Every joint is inside its limits, with a margin.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::JointsInside, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    Reading::worst_joint(settings.pre_arm.joint_margin_rad, |joint| {
        let q = inputs.state.joint_position[joint];
        let (least, most) = (settings.min_position[joint], settings.max_position[joint]);
        if q.is_nan() { q } else { (least - q).max(q - most) }
    })
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: if finding.measured > 0.0 {
            format!("{} {:.2} rad beyond", joint_of(finding), finding.measured)
        } else {
            "all".to_owned()
        },
        needed: format!("at most {:.2} rad beyond", limits.joint_margin_rad),
    }
}
