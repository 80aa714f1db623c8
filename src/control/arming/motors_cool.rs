//! Every motor measures its temperature, and none is hot.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::MotorsCool,
    measure: |inputs, settings| {
        let (celsius, limits) = (&inputs.state.motor_temperature_c, &settings.arming);
        match (0..celsius.len()).find(|&joint| celsius[joint] < limits.motor_measured_c) {
            Some(joint) => {
                Reading { joint: Some(joint as u8), ..Reading::at_least(celsius[joint], limits.motor_measured_c) }
            }
            None => Reading::worst_joint(limits.motor_c, |joint| celsius[joint]),
        }
    },
    found: |finding| format!("{} {:.0} C", joint_of(finding), finding.measured),
    needed: |limits| format!("{:.0} to {:.0} C", limits.motor_measured_c, limits.motor_c),
};
