//! Speed of the simulator, for `benches/simulator.rs` and `quadfrog bench`.
//!
//! A step with four contacts and three sweeps takes 10,700 floating-point operations, a step of flight 7,500 (each instruction of a step
//! counted by a debugger). On a core of a Xeon (3.7 GHz) that has AVX2 they take 0.91 us and 0.63 us: 11.8 and 11.9 Gflop/s, 40 % of the
//! 29.4 Gflop/s that two additions or multiplications of four lanes per cycle give. The rest is data movement between lanes and legs, and
//! the sweeps, which take one contact after the other. MuJoCo's standing step took 9.0 us there, 10.1 to 10.8 times as long (`quadfrog
//! bench --mujoco FILE`).

use std::time::Instant;

use super::{RobotModel, SimConfig, SimState, Simulator, TerrainKind};
use crate::robot::description::RobotDescription;
use crate::robot::{JointCommand, Joints, Leg, Placement, Robot};
use nalgebra::Vector3;

/// A scene with a known number of contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr)]
pub enum BenchScene {
    /// Free flight: 0 contacts.
    #[strum(serialize = "0 contacts (flight)")]
    Flight,
    /// Standing on four feet: 4 contacts.
    #[strum(serialize = "4 contacts (standing)")]
    Standing,
    /// Lying on the belly, on four feet and four corners of the trunk: 8 contacts.
    #[strum(serialize = "8 contacts (lying)")]
    Lying,
    /// Lying, with four hip cylinders on the ground too: 12 contacts.
    #[strum(serialize = "12 contacts (lying, hips down)")]
    Sprawling,
}

impl BenchScene {
    /// All scenes, by number of contacts.
    pub const ALL: [BenchScene; 4] =
        [BenchScene::Flight, BenchScene::Standing, BenchScene::Lying, BenchScene::Sprawling];

    /// Name in the bench's output.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Number of contacts.
    pub const fn contacts(self) -> usize {
        4 * self as usize
    }
}

/// Numbers of blocks whose cost is measured.
pub const BLOCK_COUNTS: [u32; 4] = [50, 500, 5000, 10_000];

/// Measured times on blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockTimes {
    /// Number of blocks.
    pub blocks: u32,
    /// One step of 1 ms of a robot that stands on them, s.
    pub step_s: f64,
    /// One layout, with the placement of the robot on it, s.
    pub layout_s: f64,
}

/// Measured times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatorTimes {
    /// One evaluation of the accelerations from torques, s.
    pub dynamics_s: f64,
    /// One step of 1 ms in each of [`BenchScene::ALL`], s.
    pub step_s: [f64; 4],
}

/// Bench of the simulator: a Go1 with ideal motors, one step per millisecond, default collision shapes.
#[derive(Debug)]
pub struct SimulatorBench {
    robot: RobotDescription,
    config: SimConfig,
}

/// Repeated evaluation of the accelerations.
#[derive(Debug)]
pub struct DynamicsRun {
    model: RobotModel,
    state: SimState,
    torque: Joints,
}

/// A scene at rest, to be stepped.
#[derive(Debug)]
pub struct SceneRun {
    simulator: Simulator,
    command: JointCommand,
    start: Option<SimState>,
    steps: u32,
}

impl Default for SimulatorBench {
    fn default() -> Self {
        Self::new()
    }
}

impl SimulatorBench {
    /// The Go1 on level ground.
    pub fn new() -> SimulatorBench {
        let mut config = SimConfig::default();
        config.step.contact_substeps = 1;
        SimulatorBench { robot: RobotDescription::embedded("go1").expect("go1 is embedded"), config }
    }

    /// Sets up the dynamics alone, of a robot in motion.
    pub fn dynamics(&self) -> DynamicsRun {
        let state = SimState {
            joint_position: std::array::from_fn(|i| [0.1, 0.8, -1.6][i % 3]),
            joint_velocity: std::array::from_fn(|i| 0.3 * i as f64 - 1.5),
            velocity_body: Vector3::new(0.5, -0.2, 1.0),
            angular_velocity_body: Vector3::new(0.3, 1.0, -0.4),
            ..SimState::default()
        };
        DynamicsRun { model: RobotModel::new(&self.robot), state, torque: [1.0; 12] }
    }

    /// Sets up a robot that stands on `count` blocks, 7 a square metre in two layers, in a corridor of 8 m.
    pub fn blocks(&self, count: u32) -> SceneRun {
        let mut config = self.config.clone();
        config.terrain.kind = TerrainKind::Blocks;
        config.terrain.blocks.count = count;
        let length_m = f64::from(count) / 7.0 / 8.0;
        config.terrain.blocks.area_m = Some([-0.5 * length_m, 0.5 * length_m, -4.0, 4.0]);
        let mut simulator = Simulator::new(&self.robot, &config).expect("the count is within its range");
        let folded = self.robot.lying_position;
        let joint_position = self.robot.leg_geometry.stance(&Vector3::new(0.0, 0.14, -0.25), &folded);
        simulator.place(&Placement { joint_position, lying: false, seed: 0 });
        let mut run =
            SceneRun { simulator, command: JointCommand::hold(&joint_position, 60.0, 2.0), start: None, steps: 0 };
        for _ in 0..500 {
            run.step();
        }
        run
    }

    /// Measures steps on blocks and their layout, each for about `seconds`.
    pub fn measure_blocks(&self, seconds: f64) -> [BlockTimes; 4] {
        BLOCK_COUNTS.map(|blocks| {
            let mut run = self.blocks(blocks);
            let step_s = time(seconds, || run.step());
            let (start, mut layouts) = (Instant::now(), 0_u32);
            while layouts == 0 || start.elapsed().as_secs_f64() < seconds {
                run.lay_blocks(u64::from(layouts));
                layouts += 1;
            }
            BlockTimes { blocks, step_s, layout_s: start.elapsed().as_secs_f64() / f64::from(layouts) }
        })
    }

    /// Sets up `scene` and simulates half a second.
    pub fn scene(&self, scene: BenchScene) -> SceneRun {
        let mut simulator = Simulator::new(&self.robot, &self.config).expect("the shipped configuration is valid");
        let folded = self.robot.lying_position;
        let joint_position = match scene {
            // Feet 0.14 m beside and 0.25 m below the hips.
            BenchScene::Flight | BenchScene::Standing => {
                self.robot.leg_geometry.stance(&Vector3::new(0.0, 0.14, -0.25), &folded)
            }
            BenchScene::Lying => folded,
            // Hips inwards until their cylinders touch, feet folded behind.
            BenchScene::Sprawling => std::array::from_fn(|i| match i % 3 {
                0 => -0.113 * Leg::ALL[i / 3].left_sign(),
                1 => 2.6,
                _ => -2.75,
            }),
        };
        simulator.place(&Placement { joint_position, lying: scene != BenchScene::Standing, seed: 0 });
        let mut command = JointCommand::hold(&joint_position, 60.0, 2.0);
        let mut start = None;
        if scene == BenchScene::Flight {
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

    /// Measures dynamics and all scenes for about `seconds` in all.
    pub fn measure(&self, seconds: f64) -> SimulatorTimes {
        let share = seconds / 5.0;
        let mut dynamics = self.dynamics();
        SimulatorTimes {
            dynamics_s: time(share, || dynamics.run()),
            step_s: BenchScene::ALL.map(|scene| {
                let mut run = self.scene(scene);
                time(share, || run.step())
            }),
        }
    }
}

impl DynamicsRun {
    /// Evaluates the accelerations once; the result changes the next state, so that no call can be optimized away.
    pub fn run(&mut self) {
        let a = self.model.forward_dynamics(&self.state, &self.torque);
        self.state.joint_velocity[0] = a.joint[0].clamp(-1.0, 1.0);
    }
}

impl SceneRun {
    /// Simulates one millisecond.
    pub fn step(&mut self) {
        // The fall restarts before it is fast.
        if let Some(start) = self.start
            && self.steps.is_multiple_of(256)
        {
            self.simulator.set_state(&start);
        }
        self.steps = self.steps.wrapping_add(1);
        // The simulator's write never fails.
        let _ = self.simulator.write(&self.command);
    }

    /// Lays the blocks of `seed` and places the robot on them.
    pub fn lay_blocks(&mut self, seed: u64) {
        let joint_position = self.simulator.state().joint_position;
        self.simulator.place(&Placement { joint_position, lying: false, seed });
    }

    /// Number of contacts in the last step.
    pub fn contacts(&self) -> usize {
        self.simulator.contact_count()
    }
}

/// Returns the mean time of one call of `f` over about `seconds`.
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
