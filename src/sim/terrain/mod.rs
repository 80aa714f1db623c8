//! The ground: a plane, optionally with upright boxes on it (stairs, blocks).

mod block;
mod grid;
mod loose_block;

use nalgebra::{Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use super::config::{BlocksConfig, TerrainConfig, TerrainKind};
use super::streams;
use grid::BlockGrid;

pub use block::TerrainBlock;
pub use loose_block::LooseBlock;

/// Length and half of the width of a step: each extends to the far end, below all later ones, m.
const FAR_M: f64 = 100.0;

/// Most contacts of one sphere at a time: a floor and a wall.
pub const MAX_TERRAIN_CONTACTS: usize = 2;

/// Contact of a sphere with the ground, or one within reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TerrainContact {
    /// Distance between the surfaces, m; negative inside.
    pub gap: f64,
    /// Out of the ground, world.
    pub normal_world: Vector3<f64>,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Index of the loose block; none for the plane, a step and a fixed block.
    pub block: Option<usize>,
}

/// A step or block on the ground: an upright box, for displays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TerrainBox {
    /// Centre in the world's horizontal plane, m.
    pub center: [f64; 2],
    /// Half of the two edges, m.
    pub half_edges: [f64; 2],
    /// Direction of the first edge.
    pub axis: [f64; 2],
    /// Height of the top, m.
    pub top: f64,
}

/// The ground.
#[derive(Debug, Clone)]
pub struct Terrain {
    config: TerrainConfig,
    /// Normal of the plane through the world's origin.
    normal: Vector3<f64>,
    /// Coulomb coefficient of the plane and of steps.
    friction: f64,
    blocks: Vec<TerrainBlock>,
    grid: BlockGrid,
    /// Loose blocks that the robot touches or that move.
    moving: Vec<u32>,
    /// Largest height of the ground above the plane, m.
    highest: f64,
}

impl Terrain {
    /// The ground of `config` in a trial with seed 0.
    pub fn new(config: &TerrainConfig) -> Terrain {
        let angle = if config.kind == TerrainKind::Slope { config.slope.angle_rad } else { 0.0 };
        let (sin, cos) = libm::sincos(angle);
        let (heading_sin, heading_cos) = libm::sincos(config.slope.heading_rad);
        let normal = Vector3::new(-sin * heading_cos, -sin * heading_sin, cos);
        let (capacity, grid) = match config.kind {
            TerrainKind::Flat | TerrainKind::Slope => (0, BlockGrid::new([0.0; 4], 1.0, 0)),
            // One cell: every step reaches the far end.
            TerrainKind::Steps => {
                let count = config.steps.count as usize;
                (count, BlockGrid::new([0.0; 4], FAR_M, count))
            }
            TerrainKind::Blocks => {
                let count = config.blocks.count as usize;
                (count, BlockGrid::new(config.blocks.area(), config.blocks.edge_m[1], count))
            }
        };
        let mut terrain = Terrain {
            config: *config,
            normal,
            friction: config.friction,
            blocks: Vec::with_capacity(capacity),
            grid,
            moving: Vec::with_capacity(capacity),
            highest: 0.0,
        };
        terrain.reset(0);
        terrain
    }

    /// Builds the ground; random parts depend on `seed` alone.
    pub fn reset(&mut self, seed: u64) {
        self.blocks.clear();
        self.grid.clear();
        self.moving.clear();
        self.highest = 0.0;
        self.friction = self.config.friction_of(seed);
        match self.config.kind {
            TerrainKind::Flat | TerrainKind::Slope => {}
            TerrainKind::Steps => self.build_steps(),
            TerrainKind::Blocks => self.lay_blocks(seed),
        }
        if let (TerrainKind::Blocks, Some([low, high])) = (self.config.kind, self.config.blocks.friction_range) {
            let mut random = streams::random(seed, streams::BLOCK_FRICTION);
            for block in &mut self.blocks {
                block.friction = between(low, high, &mut random);
            }
        }
    }

    /// Adds a step or block; allocates beyond the configured number.
    pub fn push(&mut self, block: TerrainBlock) {
        self.grid.push(&block.center, block.extent_m());
        self.highest = self.highest.max(block.top);
        self.blocks.push(block);
    }

    fn build_steps(&mut self) {
        let steps = self.config.steps;
        for i in 0..steps.count {
            let start = steps.start_m + f64::from(i) * steps.run_m;
            let center = Vector2::new(start + FAR_M / 2.0, 0.0);
            let step = TerrainBlock::new(center, Vector2::new(FAR_M / 2.0, FAR_M), Vector2::x(), self.friction);
            self.push(TerrainBlock { top: f64::from(i + 1) * steps.rise_m, ..step });
        }
    }

    fn lay_blocks(&mut self, seed: u64) {
        let BlocksConfig { count, layers, thickness_m, edge_m, friction, .. } = self.config.blocks;
        let [x_from, x_to, y_from, y_to] = self.config.blocks.area();
        let mut random = streams::random(seed, streams::BLOCKS);
        let mut uniform = |low: f64, high: f64| between(low, high, &mut random);
        let mut tries = 0;
        while self.blocks.len() < count as usize && tries < 50 * count {
            tries += 1;
            let center = Vector2::new(uniform(x_from, x_to), uniform(y_from, y_to));
            let half = Vector2::new(uniform(edge_m[0], edge_m[1]), uniform(edge_m[0], edge_m[1])) / 2.0;
            let (sin, cos) = libm::sincos(uniform(0.0, std::f64::consts::PI));
            let mut block = TerrainBlock::new(center, half, Vector2::new(cos, sin), friction);
            // A block lies on the highest one below it; a block that would be too high is drawn again.
            let mut under = 0.0_f64;
            self.grid.near(&center, block.extent_m(), |i| {
                let other = &self.blocks[i];
                if other.top > under && block.overlaps(other) {
                    under = other.top;
                }
            });
            block.top = under + thickness_m;
            if block.top < (f64::from(layers) + 0.5) * thickness_m {
                self.push(block);
            }
        }
    }

    /// Height of a point above the highest ground, m.
    #[inline]
    pub fn clearance(&self, point_world: &Vector3<f64>) -> f64 {
        self.normal.dot(point_world) - self.highest
    }

    /// Distance of a sphere from the plane, m; negative inside.
    #[inline]
    pub fn plane_gap(&self, center_world: &Vector3<f64>, radius: f64) -> f64 {
        self.normal.dot(center_world) - radius
    }

    /// Contacts of a sphere within `reach` of the ground: highest floor and nearest wall.
    pub fn contacts(
        &self,
        center_world: &Vector3<f64>,
        radius: f64,
        reach: f64,
    ) -> [Option<TerrainContact>; MAX_TERRAIN_CONTACTS] {
        let height = self.plane_gap(center_world, radius);
        let plane = (height < reach).then_some(TerrainContact {
            gap: height,
            normal_world: self.normal,
            friction: self.friction,
            block: None,
        });
        if self.blocks.is_empty() || height > self.highest + reach {
            return [plane, None];
        }
        // The top of a box replaces the floor under it; of all boxes the highest top and the nearest wall count. Of equal
        // ones the first box counts, and the plane before all boxes: the order of the search has no effect.
        let loose = self.config.kind == TerrainKind::Blocks && self.config.blocks.loose;
        let (mut floor, mut wall) = ((plane, 0), (None::<TerrainContact>, 0));
        self.grid.near(&center_world.xy(), radius + reach, |i| {
            let block = &self.blocks[i];
            let Some((gap, normal_world)) = block.nearest(center_world, radius, reach) else { return };
            let (slot, first) = if normal_world.z > 0.999 { &mut floor } else { &mut wall };
            if slot.is_none_or(|other| gap < other.gap || (gap == other.gap && i < *first)) {
                let friction = block.friction;
                *slot = Some(TerrainContact { gap, normal_world, friction, block: loose.then_some(i) });
                *first = i;
            }
        });
        [floor.0, wall.0]
    }

    /// Normal of the plane, world.
    pub fn normal(&self) -> Vector3<f64> {
        self.normal
    }

    /// Velocity of loose block `block`, world, m/s.
    pub fn block_velocity(&self, block: usize) -> Vector3<f64> {
        let v = self.blocks[block].velocity;
        Vector3::new(v.x, v.y, 0.0)
    }

    /// Whether there are steps or blocks that do not give way.
    pub fn has_fixed_walls(&self) -> bool {
        let loose = self.config.kind == TerrainKind::Blocks && self.config.blocks.loose;
        !self.blocks.is_empty() && !loose
    }

    /// Number of loose blocks that the robot touches or that move.
    pub fn moving_count(&self) -> usize {
        self.moving.len()
    }

    /// The steps or blocks, each at its index.
    pub fn blocks(&self) -> &[TerrainBlock] {
        &self.blocks
    }

    /// The steps or blocks, for displays.
    pub fn boxes(&self) -> impl Iterator<Item = TerrainBox> + '_ {
        self.blocks.iter().map(|b| TerrainBox {
            center: b.center.into(),
            half_edges: b.half.into(),
            axis: b.axis.into(),
            top: b.top,
        })
    }

    /// Returns loose block `block` at the start of a step of `h` seconds.
    pub fn loose_block(&self, block: usize, h: f64) -> LooseBlock {
        LooseBlock::new(block, &self.config.blocks, self.blocks[block].velocity, h)
    }

    /// Gives a loose block its velocity at the end of the step.
    pub fn move_block(&mut self, moved: &LooseBlock) {
        let block = &mut self.blocks[moved.index];
        block.velocity = moved.velocity;
        block.moved = true;
        if !std::mem::replace(&mut block.listed, true) {
            self.moving.push(moved.index as u32);
        }
    }

    /// Advances the loose blocks by `h` seconds; those that have no velocity from [`Terrain::move_block`] since the last call are
    /// slowed by friction on the floor.
    pub fn advance(&mut self, h: f64) {
        let mut listed = 0;
        while listed < self.moving.len() {
            let i = self.moving[listed] as usize;
            if !std::mem::replace(&mut self.blocks[i].moved, false) {
                self.blocks[i].velocity = self.loose_block(i, h).velocity;
            }
            let block = &mut self.blocks[i];
            block.center += block.velocity * h;
            self.grid.relocate(i, &block.center);
            if block.velocity == Vector2::zeros() {
                block.listed = false;
                self.moving.swap_remove(listed);
            } else {
                listed += 1;
            }
        }
    }
}

impl TerrainConfig {
    /// Returns the ground of a trial with `seed`, for displays: the normal of the plane through the world's origin, and the steps
    /// or blocks where they are at the start.
    pub fn ground(&self, seed: u64) -> (Vector3<f64>, Vec<TerrainBox>) {
        let mut terrain = Terrain::new(self);
        terrain.reset(seed);
        (terrain.normal, terrain.boxes().collect())
    }

    /// Returns the Coulomb coefficient of the ground in a trial with `seed`, blocks excepted.
    pub fn friction_of(&self, seed: u64) -> f64 {
        match self.friction_range {
            None => self.friction,
            Some([low, high]) => between(low, high, &mut streams::random(seed, streams::FRICTION)),
        }
    }
}

/// Returns a uniform number in [low, high).
fn between(low: f64, high: f64, random: &mut ChaCha8Rng) -> f64 {
    low + (high - low) * unit_interval(random)
}

/// Returns a uniform number in [0, 1) with 53 random bits.
pub(super) fn unit_interval(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}
