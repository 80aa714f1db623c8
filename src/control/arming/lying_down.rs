//! The joints are near the folded pose, where the stand-up ramp begins.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::LyingDown,
    measure: |inputs, settings| {
        Reading::worst_joint(settings.arming.lying_tolerance_rad, |joint| {
            (inputs.state.joint_position_rad[joint] - settings.lying_position[joint]).abs()
        })
    },
    found: |finding| format!("{} {:.2} rad away", joint_of(finding), finding.measured),
    needed: |limits| format!("at most {:.2} rad", limits.lying_tolerance_rad),
};
