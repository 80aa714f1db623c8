//! Averages and sums with a time constant.

/// Share of the old value after `dt_s` with time constant `time_s`.
pub(super) fn kept(dt_s: f64, time_s: f64) -> f64 {
    (1.0 - dt_s / time_s).max(0.0)
}
