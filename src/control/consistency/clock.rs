//! The robot's clock against this computer's: steps both ways, and drift.

use super::inputs::ConsistencyInputs;
use crate::control::settings::ConsistencyLimits;
use crate::robot::{robot_time_passed, ticks_in};

/// Time between two readings that are compared, s: a drift of 0.5 % is 50 ms. Also a robot time of at most 49 days.
const COMPARED_S: f64 = 10.0;
/// Time for which the last step stays the measured value of the arming check, s.
const REMEMBERED_S: f64 = 1.0;
/// Ticks in a row without a new state in which only older states arrive: the robot's clock stepped back by less than
/// a restart. Overtaken states arrive beside newer ones.
const OLDER_ONLY: u32 = 10;

/// Readings of both clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reading {
    robot_time_ms: u32,
    now_ns: u64,
}

/// Comparison of the clocks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ClockComparison {
    reference: Option<Reading>,
    /// The robot's clock less this computer's since the reference, ms.
    error_ms: f64,
    /// The last step, ms, and the ticks since it.
    step: Option<(f64, u32)>,
    /// States older than the newest one up to the last tick, and ticks in a row in which nothing else arrived.
    older: u64,
    older_only: u32,
}

impl ClockComparison {
    pub fn update(&mut self, inputs: &ConsistencyInputs, limits: &ConsistencyLimits) {
        if let Some((_, ticks)) = &mut self.step {
            *ticks = ticks.saturating_add(1);
        }
        if self.error_ms.abs() > limits.clock_step_ms {
            // Reported in the last tick: compare from here on.
            self.step = Some((self.error_ms, 0));
            self.reference = None;
            self.error_ms = 0.0;
            self.older_only = 0;
        }
        let (older, older_by_ms) =
            inputs.link.map_or((0, 0.0), |link| (link.out_of_order + link.duplicate, f64::from(link.older_by_ms)));
        let is_older = older > self.older && older_by_ms > limits.clock_step_ms;
        self.older = older;
        let now = Reading { robot_time_ms: inputs.state.robot_time_ms, now_ns: inputs.now_ns };
        if inputs.is_new {
            self.older_only = 0;
            match self.reference.filter(|_| !inputs.restarted) {
                Some(reference) => {
                    let ours_ms = (now.now_ns as f64 - reference.now_ns as f64) * 1e-6;
                    let robots_ms = f64::from(robot_time_passed(now.robot_time_ms, reference.robot_time_ms));
                    self.error_ms = robots_ms - ours_ms;
                    if ours_ms > COMPARED_S * 1e3 && self.error_ms.abs() <= limits.clock_step_ms {
                        self.reference = Some(now);
                    }
                }
                None => {
                    self.reference = Some(now);
                    self.error_ms = 0.0;
                }
            }
        } else if is_older {
            self.older_only += 1;
            if self.older_only >= OLDER_ONLY {
                self.error_ms = -older_by_ms;
            }
        }
    }

    pub fn error_ms(&self) -> f64 {
        self.error_ms
    }

    /// The error, or the last step if it is recent.
    pub fn recent_error_ms(&self) -> f64 {
        match self.step {
            Some((step_ms, ticks)) if ticks < ticks_in(REMEMBERED_S) => step_ms,
            _ => self.error_ms,
        }
    }
}
