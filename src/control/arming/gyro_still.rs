//! The robot lies still, so that the gyroscope's bias can be trusted.

use super::*;
use crate::control::limits::ticks;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::GyroStill, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    let limits = &settings.pre_arm;
    let reading = Reading::at_most(inputs.state.imu.gyro_body.norm(), limits.gyro_rad_s);
    Reading { passed: reading.passed && inputs.history.still >= ticks(limits.still_s), ..reading }
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: format!("{:.2} rad/s", finding.measured),
        needed: format!("at most {:.2} rad/s for {} s", limits.gyro_rad_s, limits.still_s),
    }
}
