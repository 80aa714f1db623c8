//! The inertial unit measures: no measurement repeats for long. A dead unit passes "gyro still" best.

use super::check::*;
use crate::telemetry::SensorCheck;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::InertialLive,
    measure: |inputs, settings| {
        let measured = inputs.consistency.measured(SensorCheck::InertialUnitLive);
        Reading::at_most(measured, settings.consistency.repeated_states.into())
    },
    found: |finding| match finding.measured {
        repeated if repeated > finding.allowed => format!("{repeated:.0} equal states"),
        _ => "measures".to_owned(),
    },
    needed: |_| "no measurement repeated for long".to_owned(),
};
