//! Every joint is inside its limits, with a margin.

use super::check::*;
use crate::telemetry::digits_apart;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::JointsInside,
    measure: |inputs, settings| {
        Reading::worst_joint(settings.arming.joint_margin_rad, |joint| {
            let q = inputs.state.joint_position_rad[joint];
            let (least, most) = (settings.min_position[joint], settings.max_position[joint]);
            if q.is_nan() { q } else { (least - q).max(q - most) }
        })
    },
    found: |finding| match finding.measured {
        beyond if beyond > 0.0 => {
            let digits = digits_apart(beyond, finding.allowed, 2);
            format!("{} {beyond:.digits$} rad beyond", joint_of(finding))
        }
        _ => "all".to_owned(),
    },
    needed: |limits| format!("at most {:.2} rad beyond", limits.joint_margin_rad),
};
