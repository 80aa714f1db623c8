//! Few states arrive with a wrong checksum; none on a machine without a link.

use super::check::*;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::Checksums,
    measure: |inputs, settings| {
        let corrupt = inputs.link.map_or(0, |link| link.recent_corrupt);
        Reading::at_most(corrupt.into(), settings.arming.corrupt.into())
    },
    found: |finding| format!("{:.0} corrupt", finding.measured),
    needed: |limits| format!("at most {} in 5 s", limits.corrupt),
};
