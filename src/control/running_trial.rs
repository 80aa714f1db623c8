//! One trial: countdown, impulse, flight, landing, settle. Its settings are latched when it begins.

use super::failsafe_inputs::MotionPhase;
use super::foot_placement::{SHORTEST_FLIGHT_S, SwingLegs};
use super::force_profile::{Oscillator, amplitudes_leg};
use super::landing::LandingLegs;
use super::leg::LegTarget;
use super::settings::ControlSettings;
use crate::robot::ticks_in;
use crate::robot::{CONTROL_PERIOD_S, PerLeg, RobotState};
use crate::telemetry::{Estimate, FallCause, Phase, TrialEnd, TrialSpec};
use nalgebra::Vector3;

/// Progress of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TrialProgress {
    /// Standing still before the impulse.
    Countdown,
    /// Impulse or flight.
    Jump,
    /// Feet down, not yet quiet.
    Settle,
    /// Over.
    Over(TrialEnd),
}

/// A running trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunningTrial {
    spec: TrialSpec,
    oscillator: Oscillator,
    amplitudes_leg: PerLeg<Vector3<f64>>,
    /// Ticks since the trial began; the oscillator enters pi at `countdown`.
    elapsed: u32,
    countdown: u32,
    /// Whether the trial began with several jumps; the further ones may have been dropped.
    in_a_row: bool,
    /// Impulses that have begun.
    begun: u32,
    /// Ticks for which the oscillator has waited at the end of the present pause, and of all pauses.
    waiting: u32,
    waited: u32,
    swing: SwingLegs,
    landing: LandingLegs,
    /// Whether the robot has flown and touched down since the last impulse.
    flown: bool,
    /// Ticks since the touchdown after the last impulse.
    landed: u32,
    quiet: u32,
    phase: Phase,
    fall: FallWatch,
    /// Time at which the impulses were cut off, s.
    cut_s: Option<f64>,
}

/// An impulse without take-off within this time counts as landed, s.
const LATEST_TAKEOFF_S: f64 = 0.1;

impl RunningTrial {
    /// Begins a trial with latched settings.
    pub fn begin(spec: &TrialSpec, settings: &ControlSettings) -> RunningTrial {
        RunningTrial {
            spec: *spec,
            oscillator: Oscillator {
                f0_hz: spec.jump.f0_hz,
                f1_hz: if spec.jumps > 1 { spec.jump.f1_hz } else { 0.0 },
            },
            amplitudes_leg: amplitudes_leg(&spec.jump, spec.task),
            elapsed: 0,
            countdown: ticks_in(settings.countdown_s),
            in_a_row: spec.jumps > 1,
            begun: 0,
            waiting: 0,
            waited: 0,
            swing: SwingLegs::default(),
            landing: LandingLegs::default(),
            flown: false,
            landed: 0,
            quiet: 0,
            phase: Phase::Stance,
            fall: FallWatch::default(),
            cut_s: None,
        }
    }

    /// Settings of the trial.
    pub fn spec(&self) -> &TrialSpec {
        &self.spec
    }

    /// Time since the oscillator entered pi, s; negative during the countdown.
    pub fn time_s(&self) -> f64 {
        (f64::from(self.elapsed) - f64::from(self.countdown)) * CONTROL_PERIOD_S
    }

    /// Time of the oscillator since it entered pi, s: the time without that of its waits.
    fn oscillator_s(&self) -> f64 {
        (f64::from(self.elapsed) - f64::from(self.countdown) - f64::from(self.waited)) * CONTROL_PERIOD_S
    }

    /// Time at which the last impulse ends, s.
    fn impulses_end_s(&self) -> f64 {
        let before = self.spec.jumps.saturating_sub(1);
        let passed_s = if before == 0 { 0.0 } else { f64::from(before) * self.oscillator.period_s() };
        let end_s = passed_s + self.oscillator.impulse_s() + f64::from(self.waited) * CONTROL_PERIOD_S;
        self.cut_s.map_or(end_s, |cut_s| end_s.min(cut_s))
    }

    /// Ends the impulse that is under way and drops all others.
    pub fn end_impulses(&mut self) {
        self.cut_s = self.cut_s.or(Some(self.time_s().max(0.0)));
    }

    /// Phase of the motion, for the failsafes.
    pub fn motion_phase(&self, estimate: &Estimate, settings: &ControlSettings) -> MotionPhase {
        let airborne = estimate.contact.iter().all(|&down| !down);
        let rising = self.phase == Phase::Impulse && estimate.velocity_world.z >= settings.failsafe.takeoff_speed_m_s;
        match self.phase {
            _ if self.time_s() <= 0.0 => MotionPhase::Ground,
            _ if airborne || rising => MotionPhase::Air,
            // In the tick of the touchdown the phase is still that of the last tick.
            Phase::Flight | Phase::Landing => MotionPhase::Landing,
            // An impulse without a flight counts as landed after a time.
            _ if self.landed > 0 => MotionPhase::Landing,
            _ => MotionPhase::Ground,
        }
    }

    /// Drops all impulses that have not begun, so that the robot lands. Returns whether there were any.
    pub fn land(&mut self) -> bool {
        let dropped = self.has_further_impulses();
        self.spec.jumps = self.spec.jumps.min(self.begun.max(1));
        dropped
    }

    /// Whether the trial began with several jumps.
    pub fn is_in_a_row(&self) -> bool {
        self.in_a_row
    }

    /// Whether an impulse is to begin after the present one.
    pub fn has_further_impulses(&self) -> bool {
        self.spec.jumps > self.begun.max(1) && self.cut_s.is_none()
    }

    /// Counts the impulse that begins in this tick. Before it the oscillator waits for all feet down and quiet, if it may; an
    /// impulse beyond the duration of the trial is dropped.
    fn begin_impulse(&mut self, estimate: &Estimate, settings: &ControlSettings) {
        let due =
            if self.spec.jumps <= 1 { 1.0 } else { (self.oscillator_s() / self.oscillator.period_s()).floor() + 1.0 };
        if due <= f64::from(self.begun) || due > f64::from(self.spec.jumps) {
            return;
        }
        let may_wait = self.begun > 0 && self.waiting < ticks_in(self.spec.landing_wait_s);
        if may_wait && !settings.settle.is_quiet(estimate) {
            self.waiting += 1;
            self.waited += 1;
        } else if self.begun > 0 && self.time_s() >= self.spec.duration_s {
            self.spec.jumps = self.begun;
        } else {
            self.begun += 1;
            self.waiting = 0;
        }
    }

    /// Time on the ground since the last flight, s; zero before the landing.
    pub fn landed_s(&self) -> f64 {
        f64::from(self.landed) * CONTROL_PERIOD_S
    }

    /// Phase of the oscillator, rad; zero once the last impulse is over.
    pub fn theta_rad(&self) -> f64 {
        let time_s = self.time_s();
        if time_s < self.impulses_end_s() { self.oscillator.theta_rad(self.oscillator_s()) } else { 0.0 }
    }

    /// Phase of the jump.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Target of the legs in this tick.
    pub fn target(&self, estimate: &Estimate) -> LegTarget {
        let theta_rad = self.theta_rad();
        let velocity_body = estimate.world_from_body.inverse_transform_vector(&estimate.velocity_world);
        let placement_leg = self.swing.offsets_leg(self.spec.foot_placement_s, &velocity_body);
        let spread_leg = self.landing.spread_leg(&self.spec.landing);
        let cut_off = self.landing.cut_off(&self.spec.landing, theta_rad);
        LegTarget {
            gains: self.spec.gains,
            stance_leg: self.spec.stance_leg,
            vmc: self.spec.vmc,
            attitude_rate_gain: self.spec.attitude_rate_gain,
            foot_offset_leg: std::array::from_fn(|i| placement_leg[i] + spread_leg[i]),
            amplitudes_leg: std::array::from_fn(|i| if cut_off[i] { Vector3::zeros() } else { self.amplitudes_leg[i] }),
            theta_rad,
        }
    }

    /// Advances phase and progress with the newest state. To be called once per tick, before `target`.
    pub fn update(&mut self, state: &RobotState, estimate: &Estimate, settings: &ControlSettings) -> TrialProgress {
        if let Some(cause) = self.fall.update(state, estimate, settings, f64::INFINITY) {
            return TrialProgress::Over(TrialEnd::Fell(cause));
        }
        let time_s = self.time_s();
        if time_s < 0.0 {
            return TrialProgress::Countdown;
        }
        self.begin_impulse(estimate, settings);
        let feet_down = estimate.contact.iter().filter(|&&down| down).count();
        self.flown |= feet_down > 0 && self.swing.airborne_ticks() >= ticks_in(SHORTEST_FLIGHT_S);
        self.swing.update(&estimate.contact);
        self.landing.update(&estimate.contact, self.swing.legs());
        let impulse = self.theta_rad() >= std::f64::consts::PI;
        if impulse {
            self.flown = false;
        }
        self.phase = match (impulse, feet_down, self.flown) {
            (true, _, _) => Phase::Impulse,
            (false, 0, _) => Phase::Flight,
            (false, _, true) => Phase::Landing,
            (false, _, false) => Phase::Stance,
        };
        let since_impulse_s = time_s - self.impulses_end_s();
        if since_impulse_s < 0.0 {
            return TrialProgress::Jump;
        }
        let stayed = self.swing.airborne_ticks() == 0 && since_impulse_s > LATEST_TAKEOFF_S;
        if !self.flown && !stayed && since_impulse_s < settings.settle.cap_s {
            return TrialProgress::Jump;
        }
        self.landed += 1;
        self.quiet = if settings.settle.is_quiet(estimate) { self.quiet + 1 } else { 0 };
        if self.quiet >= ticks_in(settings.settle.quiet_s) {
            TrialProgress::Over(TrialEnd::Settled)
        } else if since_impulse_s >= settings.settle.cap_s {
            TrialProgress::Over(TrialEnd::NotQuiet)
        } else {
            TrialProgress::Settle
        }
    }

    /// Counts one tick.
    pub fn advance(&mut self) {
        self.elapsed += 1;
    }
}

/// Fall detection (`docs/method.md`, "Fall").
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FallWatch {
    /// Ticks in a row in which a part other than the feet touches the ground.
    touching: u32,
}

impl FallWatch {
    /// Returns the cause of a fall; `most_rad` is a limit of the tilt beside those of a trial. To be called once per tick.
    pub fn update(
        &mut self,
        state: &RobotState,
        estimate: &Estimate,
        settings: &ControlSettings,
        most_rad: f64,
    ) -> Option<FallCause> {
        let touches = state.truth.is_some_and(|truth| truth.body_contact);
        self.touching = if touches { self.touching + 1 } else { 0 };
        let [roll, pitch, _] = estimate.roll_pitch_yaw.into();
        // Tilt in the air cannot be corrected before the landing.
        let airborne = estimate.contact.iter().all(|&down| !down);
        let in_flight_rad = if airborne { settings.flight_tilt_rad } else { f64::INFINITY };
        let allowed = |limit: f64| limit.min(in_flight_rad).min(most_rad);
        let (allowed_roll, allowed_pitch) = (allowed(settings.fall.roll_rad), allowed(settings.fall.pitch_rad));
        if roll.abs() > allowed_roll {
            return Some(FallCause::Roll { measured_rad: roll, allowed_rad: allowed_roll });
        }
        if pitch.abs() > allowed_pitch {
            return Some(FallCause::Pitch { measured_rad: pitch, allowed_rad: allowed_pitch });
        }
        (self.touching >= ticks_in(settings.fall.body_contact_s)).then_some(FallCause::BodyContact)
    }
}
