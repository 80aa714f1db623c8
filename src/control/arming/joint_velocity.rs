//! The reported joint velocities are those of the reported angles.

use super::check::*;
use crate::telemetry::SensorCheck;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::JointVelocity,
    measure: |inputs, settings| {
        let measured = inputs.consistency.measured(SensorCheck::JointVelocity);
        let joint = Some(inputs.consistency.worst_joint());
        Reading { joint, ..Reading::at_most(measured, settings.consistency.joint_velocity_rad) }
    },
    found: |finding| format!("{} {:.2} rad apart", joint_of(finding), finding.measured),
    needed: |_| "angle and velocity agree".to_owned(),
};
