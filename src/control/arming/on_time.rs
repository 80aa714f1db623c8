//! Ticks begin on time.

use super::check::*;

/// A shorter time gives no share of late ticks.
const LEAST_SPAN_MS: u32 = 1000;

pub(super) const CHECK: ControlCheck = ControlCheck {
    check: ArmingCheck::OnTime,
    measure: |inputs, settings| {
        let late = &inputs.history.late;
        let share = f64::from(late.sum()) / f64::from(late.span_ms().max(1));
        let known = late.span_ms() >= LEAST_SPAN_MS;
        Reading::at_most(if known { share } else { f64::NAN }, settings.arming.late_share)
    },
    found: |finding| format!("{:.1} % of ticks late", finding.measured * 100.0),
    needed: |limits| format!("at most {} % later than {} ms", limits.late_share * 100.0, limits.late_ms),
};
