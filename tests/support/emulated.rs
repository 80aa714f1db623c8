//! An emulated Go1 behind its link, on a bench: every tick is followed by one millisecond of the robot.
#![allow(dead_code, reason = "each test uses its own part")]

use crate::bench::{Bench, shipped};
use crate::go1::{emulator, network};
use quadfrog::control::cycle::Cycle;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::emulator::Emulator;
use quadfrog::sim::{ActuatorKind, SimConfig};
use quadfrog::telemetry::Tick;
use quadfrog::trial::Backend;

/// An emulated robot behind its link. States may be changed, or lost on their way while commands arrive.
pub struct EmulatedGo1 {
    pub go1: Go1,
    pub emulator: Emulator,
    pub tamper: fn(&mut RobotState),
    /// Age of the newest state, ms, while all states are lost; zero while they arrive.
    pub deaf_ms: u32,
    /// Last command.
    pub sent: JointCommand,
}

impl Robot for EmulatedGo1 {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        let read = self.go1.read();
        if self.deaf_ms > 0 {
            self.deaf_ms += 1;
            return Err(RobotError::NoNewState { age_ms: self.deaf_ms - 1 });
        }
        let mut state = read?;
        (self.tamper)(&mut state);
        Ok(state)
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.sent = *command;
        self.go1.write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        self.go1.place(placement)
    }
    fn link(&self) -> Option<LinkStatus> {
        self.go1.link()
    }
}

pub type EmulatedBench = Bench<EmulatedGo1>;

/// A robot that lies, with the simulator's configuration changed and the seed of its random numbers.
pub fn emulated_on(backend: Backend, seed: u64, simulator: impl Fn(&mut SimConfig)) -> EmulatedBench {
    let (mut config, _, settings) = shipped(backend);
    simulator(&mut config.simulator);
    let emulator = emulator(&config.simulator, seed);
    let network = network(emulator.local_address().unwrap());
    let go1 = Go1::open(&network, false).unwrap();
    let robot = EmulatedGo1 { go1, emulator, tamper: |_| {}, deaf_ms: 0, sent: JointCommand::default() };
    Bench { after_tick: |robot| robot.emulator.step(), ..Bench::new(config, settings, robot) }
}

pub fn emulated(simulator: impl Fn(&mut SimConfig)) -> EmulatedBench {
    emulated_on(Backend::Hardware, 0, simulator)
}

/// Actuators, friction and sensors of the hardware-like model.
pub fn hardware_like(config: &mut SimConfig) {
    config.actuator.kind = ActuatorKind::HardwareLike;
    config.terrain.friction = 0.6;
    config.sensors.enabled = true;
}

impl EmulatedBench {
    /// The same robot that lies, with the countdown of the simulator in place of the hardware's: 2 s less of each jump.
    pub fn with_short_countdown(mut self) -> EmulatedBench {
        self.settings.countdown_s = self.config.control.countdown.simulator_s;
        self.cycle = Cycle::new(&self.settings);
        self
    }

    /// Injects a fault as the emulator's prompt parses it.
    pub fn inject(&mut self, line: &str) {
        self.robot.emulator.apply(line.parse().unwrap());
    }

    /// Ticks until the time of the trial, s.
    pub fn until_trial_time(&mut self, time_s: f64) -> Tick {
        while self.cycle.last().trial_time_s < time_s {
            self.tick(None);
        }
        *self.cycle.last()
    }
}
