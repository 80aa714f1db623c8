//! Actions of the failsafes: damping, landing, sitting down.

use super::{Cycle, TickInputs};
use crate::control::failsafe::{self, FailsafeAction, FailsafeInputs, Trip};
use crate::control::mode::Trigger;
use crate::control::running_trial::FallWatch;
use crate::robot::Robot;
use crate::robot::ticks_in;
use crate::telemetry::{Fault, Mode, Tick, TransitionCause};

/// Ticks for which a warning stays set; the session reads it at 10 Hz.
pub(super) const WARNING_TICKS: u32 = 1000;

impl Cycle {
    /// Applies, in this order:
    ///
    /// 1. The strictest row of the failsafe table that trips. DAMP ends the list, also at the end of a landing with a fault.
    /// 2. Landing, after the end of the session.
    /// 3. Damping for a fall in REVIEW. It is no fault, so the verdict is asked for as after any other fall.
    /// 4. Sitting down in REVIEW, after LAND during the trial or the operator's request during jumps in a row.
    /// 5. Sitting down, after too long a wait in READY or REVIEW.
    pub(super) fn run_failsafes<R: Robot + ?Sized>(&mut self, inputs: &TickInputs, restarted: bool, robot: &R) {
        self.period_watch.begin(inputs.time_ns, inputs.lateness_ns, &self.settings);
        let failsafe_inputs = FailsafeInputs {
            mode: self.mode,
            phase: self.motion_phase(),
            state: &self.tick.state,
            estimate: &self.tick.estimate,
            state_age_ms: self.state_age_ms,
            restarted,
            link: robot.link(),
            delay_growth_ms: self.link_quality.delay_growth_ms(),
            loss_share: self.link_quality.loss_share(),
            lateness_ns: inputs.lateness_ns,
            period: self.period_watch,
            send_error: self.send_error.take(),
            operator_silent_ms: inputs.operator_silent_ms,
            events_lost: inputs.events_lost,
            consistency: &self.consistency,
            accelerometer_fault: self.estimator.accelerometer_fault(&self.settings.consistency),
            suspended_ms: inputs.suspended_ms,
            guard_silent_ms: inputs.guard_silent_ms,
            remote_silent_ms: self.remote_silent_ms,
        };
        let trip = failsafe::check(&failsafe_inputs, &self.settings);
        self.warning = match (failsafe::warning(&failsafe_inputs, &self.settings), self.warning) {
            (Some(warning), _) => Some((warning, WARNING_TICKS)),
            (None, Some((warning, left))) if left > 1 => Some((warning, left - 1)),
            _ => None,
        };
        self.tripped = None;
        match trip {
            Some(trip) if trip.action == FailsafeAction::Damp => {
                self.tripped = Some(trip.fault);
                self.damp_and_latch(trip.fault);
                return;
            }
            Some(Trip { action: FailsafeAction::LandThenDamp, fault }) => self.land_then_damp(fault, false),
            Some(Trip { action: FailsafeAction::HoldThenDamp, fault }) => self.land_then_damp(fault, true),
            Some(trip) => self.land_and_sit_down(trip.fault),
            None if self.session_left => self.land_and_sit_down(Fault::OperatorLeft),
            None if self.mode == Mode::Ready => self.landing = None,
            None => {}
        }
        if self.follow_fault_landing() {
            return;
        }
        let Tick { state, estimate, .. } = &self.tick;
        let stance_tilt_rad = self.settings.failsafe.stance_tilt_rad;
        if self.mode != Mode::Review {
            self.fall = FallWatch::default();
        } else if let Some(cause) = self.fall.update(state, estimate, &self.settings, stance_tilt_rad) {
            self.trigger(Trigger::Fell, TransitionCause::Fell(cause));
        }
        if self.mode == Mode::Review
            && let Some(cause) = self.sits_down_after.take()
        {
            self.trigger(Trigger::SitDown, cause);
        }
        let allowed_s = self.settings.idle_s;
        if matches!(self.mode, Mode::Ready | Mode::Review) && allowed_s > 0.0 && self.mode_ticks > ticks_in(allowed_s) {
            self.trigger(Trigger::SitDown, TransitionCause::Idle { allowed_s });
        }
    }

    /// Damps and latches the fault. A latched fault keeps its name, unless a fault of another kind voids confirmations: that one
    /// is reported too.
    pub(super) fn damp_and_latch(&mut self, fault: Fault) {
        let kind = std::mem::discriminant::<Fault>;
        let reported = matches!(self.cause, TransitionCause::Fault(latched) if kind(&latched) == kind(&fault));
        if self.mode != Mode::Fault {
            self.trigger(Trigger::Fault, TransitionCause::Fault(fault));
        } else if !reported && fault.voids_confirmations() {
            self.change(Mode::Fault, TransitionCause::Fault(fault));
        }
    }

    /// Sits down at once, or in a jump after the landing, also if the cause is gone by then. SETTLE runs to its end, so that
    /// the trial can be measured.
    fn land_and_sit_down(&mut self, fault: Fault) {
        match self.mode {
            Mode::StandUp | Mode::Ready | Mode::Countdown | Mode::Review => {
                self.trigger(Trigger::SitDown, TransitionCause::Fault(fault));
            }
            Mode::Jump => {
                let first = *self.landing.get_or_insert(fault);
                self.sits_down_after = Some(TransitionCause::Fault(first));
                if let Some(jump) = &mut self.trial {
                    jump.land();
                }
            }
            Mode::Settle => self.sits_down_after = Some(TransitionCause::Fault(self.landing.unwrap_or(fault))),
            _ => {}
        }
    }
}
