//! A loose block while the robot touches it: a body that slides on the floor, solved together with the contacts on it.
//!
//! A block is lighter than a leg. A contact that took it for fixed within a step would give it the momentum of the leg and many times
//! its speed, and the block would return that to the robot in the next step.

use nalgebra::{Vector2, Vector3};

use crate::robot::GRAVITY;
use crate::sim::config::BlocksConfig;

/// A loose block in one step.
#[derive(Debug, Clone, Copy)]
pub struct LooseBlock {
    /// Index in the terrain.
    pub index: usize,
    mass_kg: f64,
    /// Coulomb coefficient of block and floor.
    floor_friction: f64,
    /// m g h, N s.
    weight_impulse: f64,
    /// Largest impulse of the floor's friction, N s.
    most: f64,
    /// At the start of the step, world, m/s.
    start_velocity: Vector2<f64>,
    /// Impulse of the robot, world, N s.
    impulse: Vector3<f64>,
    /// At the end of the step under this impulse and the floor's friction, world, m/s.
    pub velocity: Vector2<f64>,
}

impl LooseBlock {
    /// A block with `velocity` (world, m/s) at the start of a step of `h` seconds.
    pub fn new(index: usize, config: &BlocksConfig, velocity: Vector2<f64>, h: f64) -> LooseBlock {
        let BlocksConfig { mass_kg, floor_friction, .. } = *config;
        let weight_impulse = mass_kg * GRAVITY * h;
        let (start_velocity, impulse, most) = (velocity, Vector3::zeros(), 0.0);
        let mut block =
            LooseBlock { index, mass_kg, floor_friction, weight_impulse, most, start_velocity, impulse, velocity };
        block.limit_floor_friction();
        block
    }

    /// Sets the limit of the floor's friction to that of the robot's present impulse (Coulomb): mu (m g h + normal impulse).
    pub fn limit_floor_friction(&mut self) {
        self.most = self.floor_friction * (self.weight_impulse - self.impulse.z.min(0.0));
        self.push(&Vector3::zeros());
    }

    /// Adds an impulse of the robot, world, N s. The floor takes of the momentum what its limit allows.
    pub fn push(&mut self, impulse_world: &Vector3<f64>) {
        self.impulse += impulse_world;
        let momentum = self.momentum();
        let size = momentum.norm();
        self.velocity =
            if size <= self.most { Vector2::zeros() } else { momentum * ((1.0 - self.most / size) / self.mass_kg) };
    }

    /// Whether the floor's friction holds the block with `impulse_world` (N s) in addition.
    pub fn rests_with(&self, impulse_world: &Vector3<f64>) -> bool {
        (self.momentum() + impulse_world.xy()).norm() <= self.most
    }

    /// At the end of the step without the floor, N s.
    fn momentum(&self) -> Vector2<f64> {
        self.start_velocity * self.mass_kg + self.impulse.xy()
    }

    /// Change of the velocity over the step, world, m/s.
    pub fn velocity_change_world(&self) -> Vector3<f64> {
        (self.velocity - self.start_velocity).push(0.0)
    }

    /// That change if the block is at rest at the end, world, m/s.
    pub fn stop_world(&self) -> Vector3<f64> {
        -self.start_velocity.push(0.0)
    }

    /// Change of the velocity per impulse while the block slides, 1/kg.
    pub fn mobility(&self) -> f64 {
        1.0 / self.mass_kg
    }
}
