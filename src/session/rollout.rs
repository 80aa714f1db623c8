//! The control cycle and the simulator on simulated time: without a thread, as fast as possible, bit-for-bit repeatable for a
//! seed.

use crate::control::cycle::{Cycle, TickInputs};
use crate::control::settings::ControlSettings;
use crate::realtime::clock::SimulatedClock;
use crate::recording::record::Transition;
use crate::robot::ticks_in;
use crate::robot::{CONTROL_PERIOD_S, Placement, Robot};
use crate::telemetry::{Command, Event, Fault, Permit, Tick, TrialEnd, TrialSpec};

/// A robot in simulated time.
pub struct Rollout<R: Robot> {
    robot: R,
    settings: ControlSettings,
    ticks: Vec<Tick>,
    /// Changes of mode of the last trial, with their times on the ticks' clock, ns.
    transitions: Vec<(u64, Transition)>,
}

impl<R: Robot> Rollout<R> {
    /// A rollout of `robot`, which must support [`Robot::place`].
    pub fn new(robot: R, settings: &ControlSettings) -> Rollout<R> {
        Rollout { robot, settings: *settings, ticks: Vec::new(), transitions: Vec::new() }
    }

    /// Ticks of the last trial, countdown included.
    pub fn ticks(&self) -> &[Tick] {
        &self.ticks
    }

    /// Cause of the last change of mode in the last trial; none if the mode did not change.
    pub fn last_transition_cause(&self) -> Option<&str> {
        self.transitions.last().map(|(_, transition)| transition.cause.as_str())
    }

    /// Ticks of the last trial, countdown included, which may be taken, and its changes of mode with their times on the ticks'
    /// clock, ns.
    pub fn recorded(&mut self) -> (&mut Vec<Tick>, &[(u64, Transition)]) {
        (&mut self.ticks, &self.transitions)
    }

    /// The settings of the control cycle.
    pub fn settings(&self) -> &ControlSettings {
        &self.settings
    }

    /// Runs one trial from the start pose. Returns its end and its ticks, countdown included.
    pub fn run(&mut self, spec: &TrialSpec) -> (TrialEnd, &[Tick]) {
        // The last trial may have left the robot fallen.
        self.robot.place(&Placement { joint_position: self.settings.lying_position, lying: true, seed: spec.seed });
        let mut cycle = Cycle::ready(&self.settings);
        let mut inputs =
            TickInputs { command: Some(Command::RunTrial(*spec, Permit::default())), ..TickInputs::default() };
        self.ticks.clear();
        self.transitions.clear();
        // The cycle ends a trial `cap_s` after its last impulse at the latest; a longer one is an error of this program.
        let pause_s = 0.5 / spec.jump.f1_hz.max(0.05) + spec.landing_wait_s;
        let profile_s = f64::from(spec.jumps) * (spec.jump.impulse_s() + pause_s);
        let most = ticks_in(self.settings.countdown_s + profile_s + self.settings.settle.cap_s + 1.0);
        for number in 0..most {
            inputs.time_ns = u64::from(number) * (CONTROL_PERIOD_S * 1e9) as u64;
            self.ticks.push(*cycle.tick(&inputs, &SimulatedClock, &mut self.robot));
            inputs.command = None;
            self.transitions.extend(cycle.events().iter().filter_map(|event| match event {
                Event::Mode { from, to, cause, time_ns } => {
                    Some((time_ns, Transition { from, to, cause: cause.to_string() }))
                }
                _ => None,
            }));
            let ended = cycle.events().iter().find_map(|event| match event {
                Event::TrialEnded { end, .. } => Some(end),
                Event::Refused { because, .. } => Some(because.into()),
                Event::Mode { .. } | Event::SetUpright => None,
            });
            if let Some(end) = ended {
                return (end, &self.ticks);
            }
        }
        let silent = TrialEnd::Fault(Fault::StateAge { age_ms: most, allowed_ms: most });
        (silent, &self.ticks)
    }
}
