//! Roll and pitch of the trunk are small.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::Upright, measure, sentence };

fn measure(inputs: &ArmingInputs, settings: &ControlSettings) -> Reading {
    let [roll, pitch, _] = inputs.estimate.roll_pitch_yaw.into();
    // `f64::max` drops a NaN.
    let tilt = if (roll + pitch).is_nan() { f64::NAN } else { roll.abs().max(pitch.abs()) };
    Reading::at_most(tilt, settings.pre_arm.tilt_rad)
}

fn sentence(finding: &ArmingFinding, limits: &ArmingLimits) -> Sentence {
    Sentence {
        found: format!("tilted {:.2} rad", finding.measured),
        needed: format!("at most {:.2} rad", limits.tilt_rad),
    }
}
