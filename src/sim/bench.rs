//! The simulator's speed, measured the same way by `benches/simulator.rs` and by the program's own bench.
//!
//! A step on four contacts that takes three sweeps does 11,800 floating-point operations in 22,800 instructions (callgrind, x86-64
//! without extensions: two lanes). At 1.8 us that is 6.6 of the 12 Gflop/s that two such additions or multiplications a
//! cycle give at 3 GHz: about half of the machine's limit. The rest is moving numbers between lanes and legs.

use std::time::Instant;

use super::{Model, SimConfig, Simulator, State};
use crate::robot::description::RobotDescription;
use crate::robot::kinematics::LegGeometry;
use crate::robot::{JointCommand, Joints, Leg, MotorCommand, Placement, Robot};
use nalgebra::Vector3;

/// A situation with a known number of contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// Free flight: none.
    Flight,
    /// Standing on four feet.
    Standing,
    /// Lying on the belly: four feet and four corners of the trunk.
    Lying,
    /// The same with the hips turned down: four hip cylinders more.
    Sprawling,
}

impl Scene {
    /// All of them, by number of contacts.
    pub const ALL: [Scene; 4] = [Scene::Flight, Scene::Standing, Scene::Lying, Scene::Sprawling];

    /// What it shows.
    pub const fn name(self) -> &'static str {
        match self {
            Scene::Flight => "0 contacts (flight)",
            Scene::Standing => "4 contacts (standing)",
            Scene::Lying => "8 contacts (lying)",
            Scene::Sprawling => "12 contacts (lying, hips down)",
        }
    }

    /// How many contacts it has.
    pub const fn contacts(self) -> usize {
        match self {
            Scene::Flight => 0,
            Scene::Standing => 4,
            Scene::Lying => 8,
            Scene::Sprawling => 12,
        }
    }
}

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// One evaluation of the accelerations from torques, s.
    pub dynamics_s: f64,
    /// One step of 1 ms in each of [`Scene::ALL`], s.
    pub step_s: [f64; 4],
}

/// Sets scenes up for measuring; a Go1, ideal motors, one step per millisecond, only the default shapes.
#[derive(Debug)]
pub struct Speed {
    robot: RobotDescription,
    config: SimConfig,
}

/// Accelerations from torques, ready to be run.
#[derive(Debug)]
pub struct DynamicsRun {
    model: Model,
    state: State,
    torque: Joints,
}

/// A scene that has come to rest.
#[derive(Debug)]
pub struct SceneRun {
    simulator: Simulator,
    command: JointCommand,
    start: Option<State>,
    steps: u32,
}

impl Default for Speed {
    fn default() -> Self {
        Self::new()
    }
}

impl Speed {
    /// The Go1 on level ground.
    pub fn new() -> Speed {
        let mut config = SimConfig::default();
        config.step.contact_substeps = 1;
        Speed { robot: RobotDescription::embedded("go1").expect("go1 is embedded"), config }
    }

    /// The dynamics alone, in motion.
    pub fn dynamics(&self) -> DynamicsRun {
        let state = State {
            joint_position: std::array::from_fn(|i| [0.1, 0.8, -1.6][i % 3]),
            joint_velocity: std::array::from_fn(|i| 0.3 * i as f64 - 1.5),
            velocity_body: Vector3::new(0.5, -0.2, 1.0),
            angular_velocity_body: Vector3::new(0.3, 1.0, -0.4),
            ..State::default()
        };
        DynamicsRun { model: Model::new(&self.robot), state, torque: [1.0; 12] }
    }

    /// `scene`, half a second after it was set up.
    pub fn scene(&self, scene: Scene) -> SceneRun {
        let mut simulator = Simulator::new(&self.robot, &self.config).expect("the shipped configuration is valid");
        let folded = self.robot.lying_position;
        let joint_position = match scene {
            Scene::Flight | Scene::Standing => standing(&self.robot.leg_geometry),
            Scene::Lying => folded,
            // Hips turned inwards until their cylinders touch, feet folded up behind.
            Scene::Sprawling => std::array::from_fn(|i| match i % 3 {
                0 => -0.113 * Leg::ALL[i / 3].side(),
                1 => 2.6,
                _ => -2.75,
            }),
        };
        simulator.place(&Placement { joint_position, lying: scene != Scene::Standing, seed: 0 });
        let mut command = JointCommand::default();
        for (motor, position) in command.motor.iter_mut().zip(joint_position) {
            *motor = MotorCommand { position, kp: 60.0, kd: 2.0, ..MotorCommand::default() };
        }
        let mut start = None;
        if scene == Scene::Flight {
            let mut state = *simulator.state();
            state.position_world.z += 5.0;
            simulator.set_state(&state);
            start = Some(state);
            command = JointCommand::default();
        }
        let mut run = SceneRun { simulator, command, start, steps: 0 };
        for _ in 0..500 {
            run.step();
        }
        run
    }

    /// Measures everything for about `seconds` in all.
    pub fn measure(&self, seconds: f64) -> Figures {
        let share = seconds / 5.0;
        let mut dynamics = self.dynamics();
        Figures {
            dynamics_s: time(share, || dynamics.run()),
            step_s: Scene::ALL.map(|scene| {
                let mut run = self.scene(scene);
                time(share, || run.step())
            }),
        }
    }
}

impl DynamicsRun {
    /// Accelerations once; the result moves the next state a little, so that nothing can be left out.
    pub fn run(&mut self) {
        let a = self.model.forward_dynamics(&self.state, &self.torque);
        self.state.joint_velocity[0] = a.joint[0].clamp(-1.0, 1.0);
    }
}

impl SceneRun {
    /// One millisecond.
    pub fn step(&mut self) {
        // Falling starts anew before it gets fast.
        if let Some(start) = self.start
            && self.steps.is_multiple_of(256)
        {
            self.simulator.set_state(&start);
        }
        self.steps = self.steps.wrapping_add(1);
        // The simulator's write never fails.
        let _ = self.simulator.write(&self.command);
    }

    /// How many points touched in the last step.
    pub fn contacts(&self) -> usize {
        self.simulator.contact_count()
    }
}

/// The feet under the hips, 0.14 m out and 0.25 m down.
fn standing(geometry: &LegGeometry) -> Joints {
    let mut joints = Joints::default();
    for leg in Leg::ALL {
        let foot = Vector3::new(0.0, leg.side() * 0.14, -0.25);
        let q = geometry.inverse(&foot, leg.side()).expect("the stance is within reach");
        joints[3 * leg as usize..][..3].copy_from_slice(q.as_slice());
    }
    joints
}

/// Mean time of one call of `f` over about `seconds`.
fn time(seconds: f64, mut f: impl FnMut()) -> f64 {
    let start = Instant::now();
    let mut calls = 0u32;
    while start.elapsed().as_secs_f64() < seconds {
        for _ in 0..256 {
            f();
        }
        calls += 256;
    }
    start.elapsed().as_secs_f64() / f64::from(calls)
}
