//! The robot lies still, so that the gyroscope's bias can be trusted.

use super::check::*;
use crate::robot::ticks_in;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::GyroStill,
    measure: |inputs, settings| {
        let limits = &settings.arming;
        let reading = Reading::at_most(inputs.state.imu.gyro_body.norm(), limits.gyro_rad_s);
        Reading { passed: reading.passed && inputs.history.still >= ticks_in(limits.still_s), ..reading }
    },
    found: |finding| format!("{:.2} rad/s", finding.measured),
    needed: |limits| format!("at most {:.2} rad/s for {} s", limits.gyro_rad_s, limits.still_s),
};
