//! Every motor reports servo mode. Servo mode is commanded while disarmed too, so a motor that does not report it
//! will not follow.

use super::*;

pub(super) const CHECK: ControlCheck = ControlCheck { check: ArmingCheck::MotorsFollow, measure, sentence };

fn measure(inputs: &ArmingInputs, _: &ControlSettings) -> Reading {
    let enabled = &inputs.state.motor_enabled;
    let idle = enabled.iter().filter(|enabled| !**enabled).count();
    let first = enabled.iter().position(|enabled| !enabled);
    Reading { joint: first.map(|joint| joint as u8), ..Reading::at_most(idle as f64, 0.0) }
}

fn sentence(finding: &ArmingFinding, _: &ArmingLimits) -> Sentence {
    Sentence {
        found: if finding.measured > 0.0 {
            format!("{:.0} out of servo mode, {} first", finding.measured, joint_of(finding))
        } else {
            "all in servo mode".to_owned()
        },
        needed: "every motor in servo mode".to_owned(),
    }
}
