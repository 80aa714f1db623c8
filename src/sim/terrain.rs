//! The ground: a plane, optionally with upright boxes on it (stairs, blocks).

use nalgebra::{Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::config::{BlocksConfig, TerrainConfig, TerrainKind};
use crate::robot::GRAVITY;

/// Most contacts of one sphere at a time: a floor and a wall.
pub(super) const MAX_TERRAIN_CONTACTS: usize = 2;

/// Contact of a sphere with the ground, or one within reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TerrainContact {
    /// Distance between the surfaces, m; negative inside.
    pub gap: f64,
    /// Out of the ground, world.
    pub normal_world: Vector3<f64>,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Index of the loose block.
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

/// An upright box on the ground, with its velocity.
#[derive(Debug, Clone, Copy)]
struct TerrainBlock {
    center: Vector2<f64>,
    half: Vector2<f64>,
    /// Direction of the box's x in the world.
    axis: Vector2<f64>,
    top: f64,
    velocity: Vector2<f64>,
}

/// The ground.
#[derive(Debug, Clone)]
pub(super) struct Terrain {
    config: TerrainConfig,
    /// Normal of the plane through the world's origin.
    normal: Vector3<f64>,
    blocks: Vec<TerrainBlock>,
    /// Largest height of the ground above the plane, m.
    highest: f64,
}

impl Terrain {
    pub fn new(config: &TerrainConfig) -> Terrain {
        let angle = if config.kind == TerrainKind::Slope { config.slope.angle_rad } else { 0.0 };
        let (sin, cos) = angle.sin_cos();
        let (heading_sin, heading_cos) = config.slope.heading_rad.sin_cos();
        let normal = Vector3::new(-sin * heading_cos, -sin * heading_sin, cos);
        let capacity = config.blocks.count.max(config.steps.count) as usize;
        let mut terrain = Terrain { config: *config, normal, blocks: Vec::with_capacity(capacity), highest: 0.0 };
        terrain.reset(0);
        terrain
    }

    /// Builds the ground; random parts depend on `seed` alone.
    pub fn reset(&mut self, seed: u64) {
        self.blocks.clear();
        match self.config.kind {
            TerrainKind::Flat | TerrainKind::Slope => {}
            TerrainKind::Steps => self.build_steps(),
            TerrainKind::Blocks => self.lay_blocks(seed),
        }
        self.highest = self.blocks.iter().fold(0.0, |highest, block| block.top.max(highest));
    }

    fn build_steps(&mut self) {
        let steps = &self.config.steps;
        // Each step extends to the far end, below all later ones.
        let far = 100.0;
        for i in 0..steps.count {
            let start = steps.start_m + f64::from(i) * steps.run_m;
            self.blocks.push(TerrainBlock {
                center: Vector2::new(start + far / 2.0, 0.0),
                half: Vector2::new(far / 2.0, far),
                axis: Vector2::x(),
                top: f64::from(i + 1) * steps.rise_m,
                velocity: Vector2::zeros(),
            });
        }
    }

    fn lay_blocks(&mut self, seed: u64) {
        let BlocksConfig { count, layers, thickness_m, edge_m, reach_m, .. } = self.config.blocks;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = |low: f64, high: f64| low + (high - low) * unit_interval(&mut random);
        let mut tries = 0;
        while self.blocks.len() < count as usize && tries < 50 * count {
            tries += 1;
            let center = Vector2::new(uniform(-reach_m, reach_m), uniform(-reach_m, reach_m));
            let half = Vector2::new(uniform(edge_m[0], edge_m[1]), uniform(edge_m[0], edge_m[1])) / 2.0;
            let (sin, cos) = uniform(0.0, std::f64::consts::PI).sin_cos();
            let mut block =
                TerrainBlock { center, half, axis: Vector2::new(cos, sin), top: 0.0, velocity: Vector2::zeros() };
            // A block lies on the highest one below it; a block that would be too high is drawn again.
            let under = self.blocks.iter().filter(|other| block.overlaps(other)).fold(0.0_f64, |z, b| z.max(b.top));
            block.top = under + thickness_m;
            if block.top < (f64::from(layers) + 0.5) * thickness_m {
                self.blocks.push(block);
            }
        }
    }

    /// Height of a point above the highest ground, m.
    #[inline]
    pub fn clearance(&self, point_world: &Vector3<f64>) -> f64 {
        self.normal.dot(point_world) - self.highest
    }

    /// Contacts of a sphere within `reach` of the ground: highest floor and nearest wall.
    pub fn contacts(
        &self,
        center_world: &Vector3<f64>,
        radius: f64,
        reach: f64,
    ) -> [Option<TerrainContact>; MAX_TERRAIN_CONTACTS] {
        let height = self.normal.dot(center_world) - radius;
        let plane = (height < reach).then_some(TerrainContact {
            gap: height,
            normal_world: self.normal,
            friction: self.config.friction,
            block: None,
        });
        if self.blocks.is_empty() || height > self.highest + reach {
            return [plane, None];
        }
        // The top of a box replaces the floor under it; of all boxes the highest top and the nearest wall count.
        let (mut floor, mut wall): (Option<TerrainContact>, Option<TerrainContact>) = (plane, None);
        for (i, block) in self.blocks.iter().enumerate() {
            let Some((gap, normal_world)) = block.nearest(center_world, radius, reach) else { continue };
            let blocks = &self.config.blocks;
            let is_block = self.config.kind == TerrainKind::Blocks;
            let contact = TerrainContact {
                gap,
                normal_world,
                friction: if is_block { blocks.friction } else { self.config.friction },
                block: (is_block && blocks.loose).then_some(i),
            };
            let slot = if normal_world.z > 0.999 { &mut floor } else { &mut wall };
            if slot.is_none_or(|other| gap < other.gap) {
                *slot = Some(contact);
            }
        }
        [floor, wall]
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

    /// The steps or blocks.
    pub fn boxes(&self) -> impl Iterator<Item = TerrainBox> + '_ {
        self.blocks.iter().map(|b| TerrainBox {
            center: b.center.into(),
            half_edges: b.half.into(),
            axis: b.axis.into(),
            top: b.top,
        })
    }

    /// Applies a foot's impulse (world, N s) to loose block `block` in a step of `h` seconds, less the friction on the
    /// floor.
    pub fn push_block(&mut self, block: usize, impulse_world: &Vector3<f64>, h: f64) {
        let BlocksConfig { mass_kg, floor_friction, .. } = self.config.blocks;
        let block = &mut self.blocks[block];
        // Coulomb: the floor takes at most mu (m g h + normal impulse) of the momentum.
        let momentum = block.velocity * mass_kg + impulse_world.xy();
        let most = floor_friction * (mass_kg * GRAVITY * h - impulse_world.z.min(0.0));
        let size = momentum.norm();
        block.velocity = if size <= most { Vector2::zeros() } else { momentum * ((1.0 - most / size) / mass_kg) };
    }

    /// Advances the loose blocks by `h` seconds; blocks for which `pushed` is false are slowed by friction on the
    /// floor.
    pub fn advance(&mut self, pushed: impl Fn(usize) -> bool, h: f64) {
        if !self.config.blocks.loose || self.config.kind != TerrainKind::Blocks {
            return;
        }
        for i in 0..self.blocks.len() {
            if !pushed(i) {
                self.push_block(i, &Vector3::zeros(), h);
            }
            let step = self.blocks[i].velocity * h;
            self.blocks[i].center += step;
        }
    }
}

impl TerrainBlock {
    /// Rotates a vector from the world's horizontal plane to the box's axes.
    #[inline]
    fn local(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.axis.dot(&v), self.axis.x * v.y - self.axis.y * v.x)
    }

    #[inline]
    fn world(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.axis.x * v.x - self.axis.y * v.y, self.axis.y * v.x + self.axis.x * v.y)
    }

    /// Whether the outlines of two blocks overlap (separating axes).
    fn overlaps(&self, other: &TerrainBlock) -> bool {
        let separated = |a: &TerrainBlock, b: &TerrainBlock| {
            let center = a.local(b.center - a.center);
            let axis = a.local(b.axis);
            let reach = Vector2::new(
                (axis.x * b.half.x).abs() + (axis.y * b.half.y).abs(),
                (axis.y * b.half.x).abs() + (axis.x * b.half.y).abs(),
            );
            center.x.abs() >= a.half.x + reach.x || center.y.abs() >= a.half.y + reach.y
        };
        !separated(self, other) && !separated(other, self)
    }

    /// Gap and normal between a sphere and this box, if nearer than `reach`.
    fn nearest(&self, center: &Vector3<f64>, radius: f64, reach: f64) -> Option<(f64, Vector3<f64>)> {
        let p = self.local(center.xy() - self.center);
        let outside = Vector2::new(p.x.abs() - self.half.x, p.y.abs() - self.half.y);
        let above = center.z - self.top;
        let far = radius + reach;
        if outside.x > far || outside.y > far || above > far {
            return None;
        }
        let sideways = |v: Vector2<f64>| {
            let w = self.world(v);
            Vector3::new(w.x, w.y, 0.0)
        };
        let out_x = sideways(Vector2::new(1.0_f64.copysign(p.x), 0.0));
        let out_y = sideways(Vector2::new(0.0, 1.0_f64.copysign(p.y)));
        if outside.x <= 0.0 && outside.y <= 0.0 && above <= 0.0 {
            // The centre is inside: the normal of the nearest face.
            let nearest = above.max(outside.x).max(outside.y);
            let normal = match nearest {
                n if n == above => Vector3::z(),
                n if n == outside.x => out_x,
                _ => out_y,
            };
            return Some((nearest - radius, normal));
        }
        let away = out_x * outside.x.max(0.0) + out_y * outside.y.max(0.0) + Vector3::z() * above.max(0.0);
        let distance = away.norm();
        (distance < far).then(|| (distance - radius, away / distance))
    }
}

/// Returns a uniform number in [0, 1) with 53 random bits.
pub(super) fn unit_interval(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}
