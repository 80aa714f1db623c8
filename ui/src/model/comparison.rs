//! Two trials laid over each other, aligned where their impulses begin.

use quadfrog::telemetry::Tick;

use super::history::{ChartSample, SignalHistory};
use crate::message::{ComparedTrial, SideBySide};

/// Trials A and B on one axis, aligned where their impulses begin.
#[derive(Debug, Clone)]
pub struct Comparison {
    pub a: ComparedTrial,
    pub b: ComparedTrial,
    pub history_a: SignalHistory,
    pub trace_b: Vec<ChartSample>,
    /// Start of A's impulse, ns, on A's clock.
    pub start_ns: u64,
    /// The time under the cursor, ns, on A's clock.
    pub cursor_ns: u64,
}

impl Comparison {
    /// The traces of two trials; none where one of them has no recorded signals.
    pub fn new(history: &SignalHistory, a: ComparedTrial, b: ComparedTrial) -> Option<Comparison> {
        Comparison::of(history.jump(a.trial)?, history.jump(b.trial)?.to_vec(), a, b)
    }

    /// The traces of the ticks of two recorded trials; none without ticks of A.
    pub fn side_by_side(both: &SideBySide) -> Option<Comparison> {
        let trace = |ticks: &[Tick]| ticks.iter().map(ChartSample::from).collect::<Vec<_>>();
        Comparison::of(&trace(&both.ticks_a), trace(&both.ticks_b), both.a.clone(), both.b.clone())
    }

    fn of(
        trace_a: &[ChartSample],
        trace_b: Vec<ChartSample>,
        a: ComparedTrial,
        b: ComparedTrial,
    ) -> Option<Comparison> {
        let start_ns = impulse_start_ns(trace_a.last()?);
        Some(Comparison { a, b, history_a: SignalHistory::of_trace(trace_a), trace_b, start_ns, cursor_ns: start_ns })
    }

    /// Puts the cursor to a time at which A ran; another time leaves it.
    pub fn follow(&mut self, time_ns: u64) {
        let begin_ns = self.history_a.samples().next().map_or(u64::MAX, |sample| sample.time_ns);
        if (begin_ns..=self.history_a.newest_ns()).contains(&time_ns) {
            self.cursor_ns = time_ns;
        }
    }

    /// First and last time of both, ns, on A's clock.
    pub fn span_ns(&self) -> (u64, u64) {
        let on_a = |sample: &ChartSample| time_after(self.start_ns, sample.trial_time_s);
        let ends_a = self.history_a.samples().next().map(|s| s.time_ns).zip(Some(self.history_a.newest_ns()));
        let ends_b = self.trace_b.first().map(on_a).zip(self.trace_b.last().map(on_a));
        let ends = [ends_a, ends_b].into_iter().flatten();
        ends.fold((self.start_ns, self.start_ns), |(first, last), (from, to)| (first.min(from), last.max(to)))
    }
}

/// When the impulse of a sample's trial began, ns.
pub fn impulse_start_ns(sample: &ChartSample) -> u64 {
    time_after(sample.time_ns, -sample.trial_time_s)
}

/// A time some seconds after another, ns.
pub fn time_after(time_ns: u64, seconds: f32) -> u64 {
    (time_ns as f64 + f64::from(seconds) * 1e9).max(0.0) as u64
}
