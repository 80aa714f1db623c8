//! Jumps with the controller on its own estimate, and the error of that estimate. Shared by
//! `tests/control/estimator.rs` and `benches/estimator.rs`.
#![allow(dead_code, reason = "test and bench each use their own part")]

use nalgebra::Vector2;
use quadfrog::config::Config;
use quadfrog::control::estimator::Estimator;
use quadfrog::control::leg::feet;
use quadfrog::control::settings::{ControlSettings, ObjectiveSource};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JOINTS, JointCommand, Joints, LEGS, PerLeg, Placement, Robot, RobotError, RobotState};
use quadfrog::session::objective;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::{ActuatorKind, SimConfig, Simulator};
use quadfrog::telemetry::{Tick, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, JumpParameters, MeasuredJump, ObjectiveRule, Task, Verdict};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The world in which the robot jumps; sensors have their configured errors in all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum World {
    /// Ideal motors, friction 1.0.
    Ideal,
    /// Motors with lag, friction and a torque-speed curve; friction 0.6, so that feet slip.
    HardwareLike,
    /// The same with calibration errors: see [`Imperfect`].
    Imperfect,
}

impl World {
    /// The shipped configuration with the errors of its sensors.
    pub fn config(self) -> SimConfig {
        let mut config = Config::load(None).unwrap().simulator;
        config.sensors.enabled = true;
        if self != World::Ideal {
            config.actuator.kind = ActuatorKind::HardwareLike;
            config.terrain.friction = 0.6;
        }
        config
    }
}

/// The shipped settings with the controller on the estimate.
pub fn settings(task: Task) -> ControlSettings {
    settings_of(task, ObjectiveSource::Estimate)
}

/// The shipped settings with the controller on `source`.
pub fn settings_of(task: Task, source: ObjectiveSource) -> ControlSettings {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, task, Backend::Simulator).unwrap();
    ControlSettings { objective: source, ..settings }
}

/// A simulator whose machine was badly calibrated: joint zeros off by 0.01 rad (5 mm at the foot), an accelerometer with 1 %
/// of scale error that clips at 8 g, joint velocities that lag by 3 ms, foot sensors with a gain of 0.7 to 1.3 and up to 5 N
/// of offset. The errors are drawn for every trial.
pub struct Imperfect {
    robot: Simulator,
    random: ChaCha8Rng,
    joint_zero: Joints,
    joint_velocity: Joints,
    accel_scale: f64,
    force_gain: PerLeg<f64>,
    force_offset: PerLeg<f64>,
    reported: RobotState,
}

impl Imperfect {
    pub fn new(robot: Simulator) -> Imperfect {
        Imperfect {
            robot,
            random: ChaCha8Rng::seed_from_u64(0),
            joint_zero: [0.0; JOINTS],
            joint_velocity: [0.0; JOINTS],
            accel_scale: 1.0,
            force_gain: [1.0; LEGS],
            force_offset: [0.0; LEGS],
            reported: RobotState::default(),
        }
    }

    /// Uniform in -1..1.
    fn draw(&mut self) -> f64 {
        2.0 * even(&mut self.random) - 1.0
    }

    fn look(&mut self) {
        let mut state = self.robot.read().unwrap();
        for (q, zero) in state.joint_position_rad.iter_mut().zip(&self.joint_zero) {
            *q += zero;
        }
        for (lagging, dq) in self.joint_velocity.iter_mut().zip(&mut state.joint_velocity_rad_s) {
            *lagging += (*dq - *lagging) * (1.0 - (-1.0_f64 / 3.0).exp());
            *dq = *lagging;
        }
        state.imu.accel_body = (state.imu.accel_body * self.accel_scale).map(|a| a.clamp(-80.0, 80.0));
        for (force, (gain, offset)) in state.foot_force_n.iter_mut().zip(self.force_gain.iter().zip(&self.force_offset))
        {
            *force = *force * gain + offset;
        }
        self.reported = state;
    }
}

impl Robot for Imperfect {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        Ok(self.reported)
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.robot.write(command)?;
        self.look();
        Ok(())
    }

    fn place(&mut self, placement: &Placement) -> bool {
        self.random = ChaCha8Rng::seed_from_u64(placement.seed);
        // The uniform distribution in -a..a has the standard deviation a / sqrt(3).
        self.joint_zero = std::array::from_fn(|_| 0.01 * 3.0_f64.sqrt() * self.draw());
        self.joint_velocity = [0.0; JOINTS];
        self.accel_scale = 1.0 + 0.01 * self.draw();
        self.force_gain = std::array::from_fn(|_| 1.0 + 0.3 * self.draw());
        self.force_offset = std::array::from_fn(|_| 5.0 * self.draw().abs());
        let placed = self.robot.place(placement);
        self.look();
        placed
    }
}

/// Uniform in 0..1.
fn even(random: &mut ChaCha8Rng) -> f64 {
    f64::from(random.next_u32()) / f64::from(u32::MAX)
}

/// Errors of the estimate over one jump that did not fall: estimate minus truth.
#[derive(Debug, Clone)]
pub struct JumpError {
    pub task: Task,
    pub truth: MeasuredJump,
    pub estimate: MeasuredJump,
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

/// Makes `count` jumps of the five tasks in turn, with uniform parameters within the shipped bounds. Returns those that landed, and
/// the ends of the others.
pub fn jumps(world: World, source: ObjectiveSource, count: u32, seed: u64) -> (Vec<JumpError>, Vec<TrialEnd>) {
    let robot = RobotDescription::embedded("go1").unwrap();
    let trials = jumps_on(source, count, seed, |_| {
        let simulator = Simulator::new(&robot, &world.config()).unwrap();
        let machine: Box<dyn Robot> = match world {
            World::Imperfect => Box::new(Imperfect::new(simulator)),
            World::Ideal | World::HardwareLike => Box::new(simulator),
        };
        machine
    });
    let (mut landed, mut fallen) = (Vec::new(), Vec::new());
    for (error, end) in trials {
        match objective::suggest(&end).0 {
            Verdict::Accept => landed.push(error),
            _ => fallen.push(end),
        }
    }
    (landed, fallen)
}

/// The same jumps on the machine that `machine` makes for each trial; returns every jump with its end.
pub fn jumps_on<R: Robot>(
    source: ObjectiveSource,
    count: u32,
    seed: u64,
    mut machine: impl FnMut(u64) -> R,
) -> Vec<(JumpError, TrialEnd)> {
    let config = Config::load(None).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut trials = Vec::new();
    for trial in 0..count {
        let task = Task::ALL[trial as usize % Task::ALL.len()];
        let mut draw = |name: &str| {
            let [low, high] = config.optimize.bounds[name];
            let chosen = config.optimize.parameters[task.name()].iter().any(|parameter| parameter == name);
            let share = even(&mut random);
            if chosen { low + share * (high - low) } else { 0.0 }
        };
        let jump =
            JumpParameters { f0_hz: draw("f0"), f1_hz: 0.0, fx_n: draw("Fx"), fy_n: draw("Fy"), fz_n: draw("Fz") };
        let seed = seed.wrapping_add(u64::from(trial));
        let spec = TrialSpec { trial, seed, ..config.task(task).trial(task, jump) };
        let settings = settings_of(task, source);
        let mut rollout = Rollout::new(machine(spec.seed), &settings);
        let (end, ticks) = rollout.run(&spec);
        // A trial that is refused or falls before its impulse measures nothing.
        let Some(estimate) = objective::measure(&ObjectiveRule::single(task), ticks) else { continue };
        let truth = objective::measure(&ObjectiveRule::single(task), &in_truth(ticks, &settings)).unwrap();
        trials.push((JumpError { task, truth, estimate }, end));
    }
    trials
}

/// The same ticks with the simulator's true state as the estimate.
pub fn in_truth(ticks: &[Tick], settings: &ControlSettings) -> Vec<Tick> {
    let settings = ControlSettings { objective: ObjectiveSource::Truth, ..*settings };
    let mut estimator = Estimator::default();
    let believed = ticks.iter().map(|tick| {
        let feet = feet(&settings.geometry, &tick.state.joint_position_rad);
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
