//! Landing with a fault: after take-off the robot lands before it is damped, under the controller if the state is known, else with the
//! motors alone.

use super::Cycle;
use super::failsafes::WARNING_TICKS;
use crate::control::failsafe::MotionPhase;
use crate::control::fault_landing::FaultLanding;
use crate::control::ramp::PoseRamp;
use crate::control::settings::RampSettings;
use crate::robot::ticks_in;
use crate::telemetry::{FailsafeWarning, Fault, Mode};

/// Time in which the targets of the held stance move there from the last known joint angles, s: no step of the targets. The torque of the
/// last command ends at once.
const HOLD_RAMP_S: f64 = 0.1;

impl Cycle {
    /// Phase of the motion.
    pub(super) fn motion_phase(&self) -> MotionPhase {
        match (&self.trial, self.mode) {
            (Some(jump), Mode::Jump | Mode::Settle) => {
                let phase = jump.motion_phase(&self.tick.estimate, &self.settings);
                let lands = self.fault_landing.is_some() && phase == MotionPhase::Ground;
                if lands { MotionPhase::Landing } else { phase }
            }
            _ => MotionPhase::Ground,
        }
    }

    /// Whether the motors hold the stance without measured state.
    pub(super) fn holds_stance(&self) -> bool {
        self.fault_landing.is_some_and(|landing| landing.hold.is_some())
    }

    /// Begins a landing with a fault, or gives up the controller in one that is under way: `hold` is whether the motors hold the stance
    /// by themselves. The fault that came first is the one that is latched.
    pub(super) fn land_then_damp(&mut self, fault: Fault, hold: bool) {
        let Some(jump) = &mut self.trial else { return self.damp_and_latch(fault) };
        let known = self.fault_landing;
        if known.is_some_and(|landing| landing.hold.is_some() || !hold) {
            return;
        }
        jump.end_impulses();
        let limits = &self.settings.failsafe;
        let ramp = RampSettings {
            duration_s: HOLD_RAMP_S,
            kp: limits.hold_kp,
            kd: limits.hold_kd,
            tolerance_rad: 0.0,
            timeout_s: 0.0,
        };
        let pose = self.settings.geometry.stance(&jump.spec().stance_leg, &self.settings.lying_position);
        self.fault_landing = Some(FaultLanding {
            fault: known.map_or(fault, |landing| landing.fault),
            hold: hold.then(|| PoseRamp::begin(&self.tick.state, &pose, &ramp)),
            ticks: 0,
        });
    }

    /// Damps and latches the fault at the end of a landing with a fault; returns whether it did.
    ///
    /// 1. The motors hold the stance for a fixed time: the touchdown is not known.
    /// 2. The controller lands the robot until some time after the touchdown, twice that time at most.
    pub(super) fn follow_fault_landing(&mut self) -> bool {
        let Some(landing) = &mut self.fault_landing else { return false };
        landing.ticks += 1;
        self.warning = Some((FailsafeWarning::Landing(landing.fault), WARNING_TICKS));
        let limits = &self.settings.failsafe;
        let landed_s = self.trial.map_or(f64::INFINITY, |jump| jump.landed_s());
        let over = match landing.hold {
            Some(_) => landing.ticks > ticks_in(limits.hold_s),
            None => landed_s >= limits.land_s || landing.ticks > ticks_in(2.0 * limits.land_s),
        };
        if over {
            self.end_fault_landing();
        }
        over
    }

    /// Ends a landing with a fault: damping, latched.
    pub(super) fn end_fault_landing(&mut self) {
        if let Some(landing) = self.fault_landing.take() {
            self.damp_and_latch(landing.fault);
        }
    }
}
