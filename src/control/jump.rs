//! One trial: stand still, impulse, flight, landing, settle. ControlSettings are latched when it begins.

use super::foot_placement::{SHORTEST_FLIGHT_S, SwingLegs};
use super::force_profile::Oscillator;
use super::leg::LegTarget;
use super::limits::ticks;
use super::settings::{ControlSettings, PERIOD_S};
use crate::robot::{LEGS, PerLeg, RobotState};
use crate::telemetry::{Estimate, FallCause, Phase, TrialEnd, TrialSpec};
use nalgebra::Vector3;

/// How far a trial has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
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
pub struct Jump {
    spec: TrialSpec,
    oscillator: Oscillator,
    amplitudes_leg: PerLeg<Vector3<f64>>,
    /// Ticks since the trial began; the oscillator enters pi at `countdown`.
    elapsed: u32,
    countdown: u32,
    swing: SwingLegs,
    /// Whether it has flown and touched down again since the last impulse.
    flown: bool,
    /// Ticks since the touchdown after the last impulse.
    landed: u32,
    quiet: u32,
    phase: Phase,
    fall: FallWatch,
}

/// After an impulse that does not leave the ground within this time, the jump counts as landed.
const LATEST_TAKEOFF_S: f64 = 0.1;

impl Jump {
    /// Begins a trial: everything that it runs with is fixed from here on.
    pub fn begin(spec: &TrialSpec, settings: &ControlSettings) -> Jump {
        Jump {
            spec: *spec,
            oscillator: Oscillator {
                f0_hz: spec.jump.f0_hz,
                f1_hz: if spec.jumps > 1 { spec.jump.f1_hz } else { 0.0 },
            },
            amplitudes_leg: spec.jump.amplitudes_leg(spec.task),
            elapsed: 0,
            countdown: ticks(settings.countdown_s),
            swing: SwingLegs::default(),
            flown: false,
            landed: 0,
            quiet: 0,
            phase: Phase::Stance,
            fall: FallWatch::default(),
        }
    }

    /// What the trial runs with.
    pub fn spec(&self) -> &TrialSpec {
        &self.spec
    }

    /// Time since the oscillator entered pi, s; negative during the countdown.
    pub fn time_s(&self) -> f64 {
        (f64::from(self.elapsed) - f64::from(self.countdown)) * PERIOD_S
    }

    /// Time at which the last impulse ends, s.
    fn impulses_end_s(&self) -> f64 {
        let before = self.spec.jumps.saturating_sub(1);
        let waited = if before == 0 { 0.0 } else { f64::from(before) * self.oscillator.period_s() };
        waited + self.oscillator.impulse_s()
    }

    /// No further impulse after the one under way, or the one that has just been: the robot is to land.
    pub fn land(&mut self) {
        let period_s = self.oscillator.period_s();
        let begun =
            if self.time_s() < 0.0 || self.spec.jumps <= 1 { 1.0 } else { (self.time_s() / period_s).floor() + 1.0 };
        self.spec.jumps = self.spec.jumps.min(begun as u32);
    }

    /// How long it has been on the ground since the last flight, s; zero before it has landed.
    pub fn landed_s(&self) -> f64 {
        f64::from(self.landed) * PERIOD_S
    }

    /// Phase of the oscillator, rad; zero once the last impulse is over.
    pub fn theta_rad(&self) -> f64 {
        let time_s = self.time_s();
        if time_s < self.impulses_end_s() { self.oscillator.theta_rad(time_s) } else { 0.0 }
    }

    /// Where in the jump the robot is.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// What the legs are to do now.
    pub fn target(&self, estimate: &Estimate) -> LegTarget {
        let theta_rad = self.theta_rad();
        LegTarget {
            gains: self.spec.gains,
            stance_leg: self.spec.stance_leg,
            vmc: self.spec.vmc,
            attitude_rate_gain: self.spec.attitude_rate_gain,
            foot_offset_leg: self.swing.offsets_leg(
                self.spec.foot_placement_s,
                &estimate.orientation_world.inverse_transform_vector(&estimate.velocity_world),
            ),
            amplitudes_leg: self.amplitudes_leg,
            theta_rad,
        }
    }

    /// Takes note of the newest state and says how far the trial has come. Called once per tick, before `target`.
    pub fn observe(&mut self, state: &RobotState, estimate: &Estimate, settings: &ControlSettings) -> Progress {
        if let Some(cause) = self.fall.observe(state, estimate, settings) {
            return Progress::Over(TrialEnd::Fell(cause));
        }
        let time_s = self.time_s();
        if time_s < 0.0 {
            return Progress::Countdown;
        }
        let feet_down = estimate.contact.iter().filter(|&&down| down).count();
        self.flown |= feet_down > 0 && self.swing.airborne_ticks() >= ticks(SHORTEST_FLIGHT_S);
        self.swing.observe(&estimate.contact);
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
            return Progress::Jump;
        }
        let stayed = self.swing.airborne_ticks() == 0 && since_impulse_s > LATEST_TAKEOFF_S;
        if !self.flown && !stayed && since_impulse_s < settings.settle.cap_s {
            return Progress::Jump;
        }
        self.landed += 1;
        let quiet = feet_down == LEGS
            && estimate.velocity_world.norm() < settings.settle.speed_m_s
            && estimate.angular_velocity_body.norm() < settings.settle.rate_rad_s;
        self.quiet = if quiet { self.quiet + 1 } else { 0 };
        if self.quiet >= ticks(settings.settle.quiet_s) {
            Progress::Over(TrialEnd::Settled)
        } else if since_impulse_s >= settings.settle.cap_s {
            Progress::Over(TrialEnd::NotQuiet)
        } else {
            Progress::Settle
        }
    }

    /// One tick has passed.
    pub fn advance(&mut self) {
        self.elapsed += 1;
    }
}

/// Watches for a fall (`specs/method.md`, "fall").
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FallWatch {
    /// Ticks for which a part other than the feet has been on the ground.
    touching: u32,
}

impl FallWatch {
    /// Whether the robot has fallen by now, and by which sign. Called once per tick.
    pub fn observe(
        &mut self,
        state: &RobotState,
        estimate: &Estimate,
        settings: &ControlSettings,
    ) -> Option<FallCause> {
        self.look(state, estimate, settings, f64::INFINITY)
    }

    /// The same of a robot that has landed and only stands: tilted beyond what a standing robot may be, it is falling. Called
    /// once per tick.
    pub fn observe_standing(
        &mut self,
        state: &RobotState,
        estimate: &Estimate,
        settings: &ControlSettings,
    ) -> Option<FallCause> {
        self.look(state, estimate, settings, settings.watchdog.stance_tilt_rad)
    }

    fn look(
        &mut self,
        state: &RobotState,
        estimate: &Estimate,
        settings: &ControlSettings,
        most_rad: f64,
    ) -> Option<FallCause> {
        let touches = state.truth.is_some_and(|truth| truth.body_contact);
        self.touching = if touches { self.touching + 1 } else { 0 };
        let [roll, pitch, _] = estimate.roll_pitch_yaw.into();
        // In the air nothing can be put right any more: what is tilted there lands on its side.
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
        (self.touching >= ticks(settings.fall.body_contact_s)).then_some(FallCause::BodyContact)
    }
}
