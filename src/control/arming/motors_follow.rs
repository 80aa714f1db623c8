//! Every motor reports servo mode. Servo mode is commanded while disarmed too, so a motor that does not report it
//! will not follow.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::MotorsFollow,
    measure: |inputs, _| {
        let enabled = &inputs.state.motor_enabled;
        let idle = enabled.iter().filter(|enabled| !**enabled).count();
        let first = enabled.iter().position(|enabled| !enabled);
        Reading { joint: first.map(|joint| joint as u8), ..Reading::at_most(idle as f64, 0.0) }
    },
    found: |finding| match finding.measured {
        idle if idle > 0.0 => format!("{idle:.0} out of servo mode, {} first", joint_of(finding)),
        _ => "all in servo mode".to_owned(),
    },
    needed: |_| "every motor in servo mode".to_owned(),
};
