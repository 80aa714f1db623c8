//! Roll and pitch of the trunk are small.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Upright,
    measure: |inputs, settings| {
        let [roll, pitch, _] = inputs.estimate.roll_pitch_yaw.into();
        // `f64::max` drops a NaN.
        let tilt = if (roll + pitch).is_nan() { f64::NAN } else { roll.abs().max(pitch.abs()) };
        Reading::at_most(tilt, settings.arming.tilt_rad)
    },
    found: |finding| format!("tilted {:.2} rad", finding.measured),
    needed: |limits| format!("at most {:.2} rad", limits.tilt_rad),
};
