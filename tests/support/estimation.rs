//! Jumps that the controller makes on its own estimate, and how far the estimate was from the truth. Shared by
//! `tests/estimator.rs` and `benches/estimator.rs`.
#![allow(dead_code, reason = "test and bench each use their own part")]

use nalgebra::Vector2;
use quadfrog::config::{Backend, Config};
use quadfrog::control::estimator::Estimator;
use quadfrog::control::leg::feet;
use quadfrog::control::settings::{ObjectiveSource, Settings};
use quadfrog::realtime::command::{JumpParameters, Task, TrialSpec};
use quadfrog::realtime::telemetry::{Tick, TrialEnd};
use quadfrog::recording::record::{Measured, Verdict};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::objective;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::{ActuatorKind, SimConfig, Simulator};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The world in which the robot jumps; sensors have their configured errors in all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum World {
    /// Motors that give what is asked, friction 1.0.
    Ideal,
    /// Motors with lag, friction and a torque-speed curve; friction 0.6, so that feet slip.
    HardwareLike,
}

impl World {
    /// The shipped configuration with the errors of its sensors.
    pub fn config(self) -> SimConfig {
        let mut config = Config::load(None).unwrap().simulator;
        config.sensors.enabled = true;
        if self == World::HardwareLike {
            config.actuator.kind = ActuatorKind::HardwareLike;
            config.terrain.friction = 0.6;
        }
        config
    }
}

/// The shipped settings with the controller on the estimate.
pub fn settings(task: Task) -> Settings {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, task, Backend::Simulator).unwrap();
    Settings { objective: ObjectiveSource::Estimate, ..settings }
}

/// One jump that did not fall: what the estimate makes of it less what it was.
#[derive(Debug, Clone, Copy)]
pub struct JumpError {
    pub task: Task,
    pub truth: Measured,
    pub estimate: Measured,
}

impl JumpError {
    /// Length of the displacement's error, m.
    pub fn displacement_m(&self) -> f64 {
        let (a, b) = (&self.estimate, &self.truth);
        Vector2::new(a.dx_m - b.dx_m, a.dy_m - b.dy_m).norm()
    }

    /// Error of the turn, rad.
    pub fn yaw_rad(&self) -> f64 {
        (self.estimate.dyaw_rad - self.truth.dyaw_rad).abs()
    }

    /// Error of the apex, m.
    pub fn apex_m(&self) -> f64 {
        (self.estimate.apex_m - self.truth.apex_m).abs()
    }
}

/// Makes `count` jumps of the five tasks in turn, with parameters drawn evenly within the shipped bounds. Returns those that
/// landed, and how the others ended.
pub fn jumps(world: World, count: u32, seed: u64) -> (Vec<JumpError>, Vec<TrialEnd>) {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut landed, mut fallen) = (Vec::new(), Vec::new());
    for trial in 0..count {
        let task = Task::ALL[trial as usize % Task::ALL.len()];
        let mut draw = |name: &str| {
            let [low, high] = config.optimize.bounds[name];
            let chosen = config.optimize.parameters[task.name()].iter().any(|parameter| parameter == name);
            let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
            if chosen { low + share * (high - low) } else { 0.0 }
        };
        let jump =
            JumpParameters { f0_hz: draw("f0"), f1_hz: 0.0, fx_n: draw("Fx"), fy_n: draw("Fy"), fz_n: draw("Fz") };
        let control = config.task(task);
        let spec = TrialSpec {
            trial,
            task,
            jump,
            gains: control.gains(),
            stance_leg: control.stance_leg(),
            vmc: control.vmc,
            jumps: 1,
            seed: seed.wrapping_add(u64::from(trial)),
        };
        let settings = settings(task);
        let mut rollout = Rollout::new(Simulator::new(&robot, &world.config()).unwrap(), &settings);
        let (end, ticks) = rollout.run(&spec);
        if objective::suggest(&end).0 != Verdict::Accept {
            fallen.push(end);
            continue;
        }
        let truth = objective::measure(&in_truth(ticks, &settings)).unwrap();
        landed.push(JumpError { task, truth, estimate: objective::measure(ticks).unwrap() });
    }
    (landed, fallen)
}

/// The same ticks with the simulator's own knowledge as the estimate.
pub fn in_truth(ticks: &[Tick], settings: &Settings) -> Vec<Tick> {
    let settings = Settings { objective: ObjectiveSource::Truth, ..*settings };
    let mut estimator = Estimator::default();
    let believed = ticks.iter().map(|tick| {
        let feet = feet(&settings.geometry, &tick.state.joint_position);
        Tick { estimate: *estimator.update(&tick.state, &feet, &settings), ..*tick }
    });
    believed.collect()
}

/// The value below which `share` of `values` are, interpolated.
pub fn percentile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let place = (sorted.len() - 1) as f64 * share;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}
