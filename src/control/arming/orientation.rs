//! The upward direction of the reported orientation is that of accelerometer and gyroscope.

use super::check::*;
use crate::telemetry::SensorCheck;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Orientation,
    measure: |inputs, settings| {
        let consistency = inputs.consistency;
        let turning = consistency.measured(SensorCheck::Orientation).max(consistency.measured(SensorCheck::TurnRate));
        Reading::at_most(consistency.resting_tilt_error_rad().max(turning), settings.arming.gravity_rad)
    },
    found: |finding| format!("{:.2} rad off", finding.measured),
    needed: |limits| format!("at most {:.2} rad from gravity", limits.gravity_rad),
};
