//! The accelerometer of a robot at rest shows gravity.

use super::check::*;
use crate::telemetry::SensorCheck;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Gravity,
    measure: |inputs, settings| {
        Reading::at_most(inputs.consistency.measured(SensorCheck::GravityMagnitude), settings.arming.gravity_m_s2)
    },
    found: |finding| format!("{:.2} m/s^2 off 9.81", finding.measured),
    needed: |limits| format!("at most {:.1} m/s^2", limits.gravity_m_s2),
};
