//! The ground of the trials, for displays.

use nalgebra::Vector3;

use crate::config::Config;
use crate::recording::scene::{Ground, GroundBox};
use crate::session::experiment::next_seed;
use crate::sim::{TerrainConfig, TerrainKind};
use crate::trial::{Backend, TrialRecord};

/// The ground of a session's trials: simulated from their seeds, a plane under a real robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialGround {
    /// None under a real robot.
    terrain: Option<TerrainConfig>,
    /// Seed of the ground before the first trial.
    seed: u64,
}

impl TrialGround {
    /// Creates the ground of a session with the seed of its study.
    pub fn new(config: &Config, backend: Backend, seed: u64) -> TrialGround {
        TrialGround { terrain: (backend == Backend::Simulator).then_some(config.simulator.terrain), seed }
    }

    /// Returns the ground of the rollout of `trial` that runs or begins next, steps and blocks where they are at its start; of the
    /// session's start without a trial. None for a simulated trial of another program, whose seed is not known.
    pub fn of(&self, trial: Option<&TrialRecord>) -> Option<Ground> {
        let Some(terrain) = self.terrain else {
            return Some(Ground { normal_world: Vector3::z(), boxes: Vec::new() });
        };
        let (normal_world, boxes) = terrain.ground(trial.map_or(Some(self.seed), next_seed)?);
        let thickness_m = terrain.blocks.thickness_m;
        let on_ground = |top: f64| if terrain.kind == TerrainKind::Blocks { top - thickness_m } else { 0.0 };
        let boxes = boxes.iter().map(|shape| GroundBox {
            center_m: shape.center,
            edges_m: shape.half_edges.map(|half| 2.0 * half),
            yaw_rad: shape.axis[1].atan2(shape.axis[0]),
            z_m: [on_ground(shape.top), shape.top],
        });
        Some(Ground { normal_world, boxes: boxes.collect() })
    }
}
