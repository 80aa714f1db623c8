//! The search for contacts with blocks by a grid, compared with a search over all blocks; blocks that slide and come to rest.

use nalgebra::{Vector2, Vector3};
use quadfrog::sim::terrain::{Terrain, TerrainBlock, TerrainContact};
use quadfrog::sim::{BlocksConfig, SimConfig, TerrainConfig, TerrainKind};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Returns the random numbers of `stream` of the seed, as the terrain draws them.
fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

/// Returns a uniform number in [low, high) with 53 random bits, as the terrain draws it.
fn between(low: f64, high: f64, random: &mut ChaCha8Rng) -> f64 {
    low + (high - low) * ((random.next_u64() >> 11) as f64 / (1u64 << 53) as f64)
}

fn config(count: u32, area_m: [f64; 4], edge_m: [f64; 2], layers: u32) -> TerrainConfig {
    let terrain = SimConfig::default().terrain;
    let blocks = BlocksConfig { count, area_m: Some(area_m), edge_m, layers, loose: true, ..terrain.blocks };
    TerrainConfig { kind: TerrainKind::Blocks, blocks, ..terrain }
}

/// Pushes a loose block with `impulse_world` (N s) in a step of 1 ms.
fn push_block(terrain: &mut Terrain, block: usize, impulse_world: &Vector3<f64>) {
    let mut block = terrain.loose_block(block, 0.001);
    block.push(impulse_world);
    terrain.move_block(&block);
}

/// Sparse and dense, small and large blocks, far more cells than blocks and a single cell.
fn configs() -> [TerrainConfig; 5] {
    [
        TerrainConfig { kind: TerrainKind::Blocks, ..SimConfig::default().terrain },
        config(3000, [-1.0, 20.0, -3.0, 3.0], [0.05, 0.5], 3),
        config(200, [-60.0, 60.0, -0.1, 0.1], [0.01, 0.02], 2),
        config(100, [0.5, 0.5, -0.5, 0.5], [0.3, 2.0], 10),
        config(400, [-1.0, 1.0, -1.0, 1.0], [0.1, 0.1], 10),
    ]
}

/// All blocks in order: the search without a grid. The ground is that of `config` and `seed`.
fn linear(
    terrain: &Terrain,
    (config, seed): (&TerrainConfig, u64),
    center: &Vector3<f64>,
    radius: f64,
    reach: f64,
) -> [Option<TerrainContact>; 2] {
    let gap = terrain.plane_gap(center, radius);
    let friction = config.friction_of(seed);
    let plane = TerrainContact { gap, normal_world: terrain.normal(), friction, block: None };
    let (mut floor, mut wall) = ((gap < reach).then_some(plane), None);
    for (i, block) in terrain.blocks().iter().enumerate() {
        let Some((gap, normal_world)) = block.nearest(center, radius, reach) else { continue };
        let loose = (config.blocks.loose).then_some(i);
        let slot: &mut Option<TerrainContact> = if normal_world.z > 0.999 { &mut floor } else { &mut wall };
        if slot.is_none_or(|other| gap < other.gap) {
            *slot = Some(TerrainContact { gap, normal_world, friction: block.friction, block: loose });
        }
    }
    [floor, wall]
}

/// Compares both searches at random points in and around the area; returns the number of contacts with blocks.
fn compare(terrain: &Terrain, ground: (&TerrainConfig, u64), random: &mut ChaCha8Rng) -> usize {
    let [x_from, x_to, y_from, y_to] = ground.0.blocks.area();
    let mut contacts = 0;
    for _ in 0..2000 {
        let x = between(x_from - 1.0, x_to + 1.0, random);
        let center = Vector3::new(x, between(y_from - 1.0, y_to + 1.0, random), between(-0.05, 0.4, random));
        for (radius, reach) in [(0.02, 0.005), (0.0, 0.0), (0.02, 0.3), (0.1, 5.0)] {
            let found = terrain.contacts(&center, radius, reach);
            assert_eq!(found, linear(terrain, ground, &center, radius, reach), "{center}, {radius}, {reach}");
            contacts += found.iter().flatten().filter(|contact| contact.block.is_some()).count();
        }
    }
    contacts
}

#[test]
fn the_grid_finds_the_contacts_of_a_search_over_all_blocks() {
    for (number, config) in configs().into_iter().enumerate() {
        let mut terrain = Terrain::new(&config);
        let mut random = stream(7, 9);
        for seed in 0..3 {
            terrain.reset(seed);
            assert!(terrain.blocks().len() >= 10, "configuration {number}: {} blocks", terrain.blocks().len());
            compare(&terrain, (&config, seed), &mut random);
        }
    }
}

#[test]
fn blocks_that_slide_stay_found_also_outside_the_area() {
    let mut contacts = 0;
    for config in &configs()[1..] {
        let mut terrain = Terrain::new(config);
        let mut random = stream(8, 9);
        for _ in 0..20 {
            for _ in 0..20 {
                let block = between(0.0, terrain.blocks().len() as f64, &mut random) as usize;
                let push = Vector3::new(between(-1.0, 1.0, &mut random), between(-1.0, 1.0, &mut random), 0.0);
                push_block(&mut terrain, block, &push);
            }
            for _ in 0..100 {
                terrain.advance(0.001);
            }
        }
        contacts += compare(&terrain, (config, 0), &mut random);
    }
    assert!(contacts > 1000, "{contacts} contacts with blocks");
}

#[test]
fn blocks_are_laid_as_by_a_search_over_all_blocks() {
    for config in configs() {
        let BlocksConfig { count, layers, thickness_m, edge_m, .. } = config.blocks;
        let [x_from, x_to, y_from, y_to] = config.blocks.area();
        let mut random = stream(3, 0);
        let mut uniform = |low: f64, high: f64| between(low, high, &mut random);
        let mut blocks: Vec<TerrainBlock> = Vec::new();
        for _ in 0..50 * count {
            let center = Vector2::new(uniform(x_from, x_to), uniform(y_from, y_to));
            let half = Vector2::new(uniform(edge_m[0], edge_m[1]), uniform(edge_m[0], edge_m[1])) / 2.0;
            let (sin, cos) = uniform(0.0, std::f64::consts::PI).sin_cos();
            let mut block = TerrainBlock::new(center, half, Vector2::new(cos, sin), 0.0);
            let under = blocks.iter().filter(|other| block.overlaps(other)).fold(0.0_f64, |z, b| z.max(b.top));
            block.top = under + thickness_m;
            if blocks.len() < count as usize && block.top < (f64::from(layers) + 0.5) * thickness_m {
                blocks.push(block);
            }
            if blocks.len() == count as usize {
                break;
            }
        }
        let mut terrain = Terrain::new(&config);
        terrain.reset(3);
        let places = |blocks: &[TerrainBlock]| blocks.iter().map(|b| (b.center, b.half, b.top)).collect::<Vec<_>>();
        assert_eq!(places(terrain.blocks()), places(&blocks));
    }
}

#[test]
fn of_two_equal_blocks_the_first_one_is_touched() {
    let laid = Terrain::new(&config(2, [-1.0, 1.0, -1.0, 1.0], [0.2, 0.2], 1));
    let first = laid.blocks()[0];
    let mut terrain = Terrain::new(&config(0, [-1.0, 1.0, -1.0, 1.0], [0.2, 0.2], 1));
    terrain.push(first);
    let mut second = first;
    second.friction = 0.1;
    terrain.push(second);
    let above = Vector3::new(first.center.x, first.center.y, first.top + 0.02);
    let floor = terrain.contacts(&above, 0.02, 0.01)[0].unwrap();
    assert_eq!((floor.block, floor.friction), (Some(0), first.friction));
}

/// Regression: of more than 64 loose blocks, some were not slowed by the floor while a foot pushed another one.
#[test]
fn every_block_that_no_foot_pushes_comes_to_rest() {
    let mut terrain = Terrain::new(&config(100, [-3.0, 3.0, -3.0, 3.0], [0.1, 0.2], 1));
    push_block(&mut terrain, 3, &Vector3::new(0.06, 0.0, 0.0));
    terrain.advance(0.001);
    assert!(terrain.block_velocity(3).x > 0.5);
    for _ in 0..1000 {
        push_block(&mut terrain, 67, &Vector3::new(0.0, 0.0, -0.01));
        terrain.advance(0.001);
    }
    assert_eq!(terrain.block_velocity(3), Vector3::zeros());
    assert!(terrain.moving_count() == 0);
}
