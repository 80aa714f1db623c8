//! The trial that has just landed, fitted to the charts until it has its verdict.

use super::comparison::impulse_start_ns;
use super::history::{BEFORE_IMPULSE_S, ChartSample, SignalHistory};

/// The samples of a landed trial, from shortly before its impulse to rest.
#[derive(Debug, Clone, Copy)]
pub struct LandedTrial<'a> {
    /// Its number.
    pub trial: u32,
    /// Its samples, oldest first; at least one.
    pub samples: &'a [ChartSample],
    /// Start of its impulse, ns.
    pub start_ns: u64,
    /// The trial under it and that one's samples; none without one.
    pub under: Option<(u32, &'a [ChartSample])>,
}

impl<'a> LandedTrial<'a> {
    /// The trial with another one under it; none without recorded signals of an impulse.
    pub fn of(history: &'a SignalHistory, trial: u32, under: Option<u32>) -> Option<LandedTrial<'a>> {
        let samples = fitted(history.trace(trial)?);
        let last = samples.last().filter(|last| last.trial_time_s >= 0.0)?;
        let under = under.and_then(|under| Some((under, fitted(history.trace(under)?))));
        Some(LandedTrial { trial, samples, start_ns: impulse_start_ns(last), under })
    }

    /// First and last time, ns.
    pub fn span_ns(&self) -> (u64, u64) {
        let end = |sample: Option<&ChartSample>| sample.map_or(self.start_ns, |sample| sample.time_ns);
        (end(self.samples.first()), end(self.samples.last()))
    }

    /// A time relative to the start of the impulse, s.
    pub fn trial_time_s(&self, time_ns: u64) -> f64 {
        (time_ns as f64 - self.start_ns as f64) / 1e9
    }

    /// The time of the cursor after `step` hundredths of the width from `cursor_ns`, or else from the start of the impulse.
    pub fn moved_cursor_ns(&self, cursor_ns: Option<u64>, step: i64) -> u64 {
        let (first, last) = self.span_ns();
        let step_ns = ((last - first) as i64 / 100).max(1) * step;
        let from_ns = cursor_ns.unwrap_or(self.start_ns);
        from_ns.saturating_add_signed(step_ns).clamp(first, last)
    }
}

/// The part of a trace from shortly before the impulse on.
fn fitted(trace: &[ChartSample]) -> &[ChartSample] {
    &trace[trace.partition_point(|sample| sample.trial_time_s < -BEFORE_IMPULSE_S)..]
}
