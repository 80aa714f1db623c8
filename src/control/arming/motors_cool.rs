//! No motor is hot.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::MotorsCool,
    measure: |inputs, settings| {
        Reading::worst_joint(settings.arming.motor_c, |joint| inputs.state.motor_temperature_c[joint])
    },
    found: |finding| match finding.measured > 0.0 {
        true => format!("{} {:.0} C", joint_of(finding), finding.measured),
        // As the simulator: zeros.
        false => "no temperature is reported".to_owned(),
    },
    needed: |limits| format!("at most {:.0} C", limits.motor_c),
};
