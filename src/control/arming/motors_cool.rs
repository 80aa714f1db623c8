//! No motor is hot.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::MotorsCool, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    Reading::worst_joint(settings.pre_arm.motor_c, |joint| inputs.state.motor_temperature_c[joint])
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: format!("{} {:.0} C", joint_of(finding), finding.measured),
        needed: format!("at most {:.0} C", limits.motor_c),
    }
}
