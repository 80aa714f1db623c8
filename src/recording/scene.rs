//! Shapes for viewers in three dimensions: the robot's bodies in the frames of their links, the ground with its steps or
//! blocks in the world.

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, Pose, SceneEntity, SceneEntityDeletion, SceneUpdate, SpherePrimitive,
    scene_entity_deletion,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::coordinate_frames::{WORLD, pose_of, vector};
use super::tick::timestamp;
use crate::robot::description::{CollisionShape, RobotDescription};

/// The ground of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Ground {
    /// Normal of the plane through the world's origin.
    pub normal_world: Vector3<f64>,
    /// Steps or blocks, where they are when the trial begins.
    pub boxes: Vec<GroundBox>,
}

/// An upright box on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundBox {
    /// Centre in the world's horizontal plane, m.
    pub center_m: [f64; 2],
    /// Lengths of the two horizontal edges, m.
    pub edges_m: [f64; 2],
    /// Direction of the first edge, rad from world x.
    pub yaw_rad: f64,
    /// Height of the lower and of the upper face above the world's origin, m.
    pub z_m: [f64; 2],
}

/// Edge of the drawn ground, m.
const GROUND_EDGE_M: f64 = 40.0;
/// Thickness of the drawn ground, m.
const GROUND_THICKNESS_M: f64 = 0.01;

const BODY: Color = Color { r: 0.75, g: 0.76, b: 0.78, a: 1.0 };
const FOOT: Color = Color { r: 0.15, g: 0.15, b: 0.15, a: 1.0 };
const FLOOR: Color = Color { r: 0.45, g: 0.5, b: 0.45, a: 1.0 };
const BLOCK: Color = Color { r: 0.62, g: 0.5, b: 0.36, a: 1.0 };

/// Returns the shapes of all bodies; they move with the frames of `/tf`.
pub fn robot(robot: &RobotDescription, log_time: u64) -> SceneUpdate {
    let bodies = std::iter::once(&robot.trunk).chain(robot.legs.iter().flat_map(|leg| &leg.bodies));
    let mut entities: Vec<SceneEntity> = bodies
        .map(|body| {
            let mut entity = entity(&body.name, &body.name, log_time);
            body.collision.iter().for_each(|shape| add(&mut entity, shape));
            entity
        })
        .collect();
    for leg in &robot.legs {
        let calf = &leg.bodies[2].name;
        let mut foot = entity(&format!("{calf} foot"), calf, log_time);
        foot.spheres.push(sphere(&leg.foot_origin, leg.foot_radius, FOOT));
        entities.push(foot);
    }
    SceneUpdate { deletions: Vec::new(), entities }
}

/// Returns the ground in place of the one before.
pub fn ground(ground: &Ground, log_time: u64) -> SceneUpdate {
    let all = SceneEntityDeletion {
        timestamp: Some(timestamp(log_time)),
        r#type: scene_entity_deletion::Type::All as i32,
        id: String::new(),
    };
    let turned =
        UnitQuaternion::rotation_between(&Vector3::z(), &ground.normal_world).unwrap_or_else(UnitQuaternion::identity);
    let center = turned * Vector3::new(0.0, 0.0, -GROUND_THICKNESS_M / 2.0);
    let mut floor = entity("ground", WORLD, log_time);
    let size = Vector3::new(GROUND_EDGE_M, GROUND_EDGE_M, GROUND_THICKNESS_M);
    floor.cubes.push(cube(pose_of(&center, &turned), &size, FLOOR));
    let mut blocks = entity("blocks", WORLD, log_time);
    blocks.cubes.extend(ground.boxes.iter().map(|shape| {
        let [bottom, top] = shape.z_m;
        let center = Vector3::new(shape.center_m[0], shape.center_m[1], (bottom + top) / 2.0);
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), shape.yaw_rad);
        let size = Vector3::new(shape.edges_m[0], shape.edges_m[1], top - bottom);
        cube(pose_of(&center, &turned), &size, BLOCK)
    }));
    let entities = if ground.boxes.is_empty() { vec![floor] } else { vec![floor, blocks] };
    SceneUpdate { deletions: vec![all], entities }
}

/// An entity that stays until it is replaced and moves with its frame.
fn entity(id: &str, frame: &str, log_time: u64) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(log_time)),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..SceneEntity::default()
    }
}

fn add(entity: &mut SceneEntity, shape: &CollisionShape) {
    let turned = |rotation: &Matrix3<f64>| UnitQuaternion::from_matrix(rotation);
    match shape {
        CollisionShape::Sphere { center, radius } => entity.spheres.push(sphere(center, *radius, BODY)),
        CollisionShape::Box { center, rotation, half_extents } => {
            entity.cubes.push(cube(pose_of(center, &turned(rotation)), &(2.0 * half_extents), BODY));
        }
        CollisionShape::Cylinder { center, rotation, radius, half_length } => {
            entity.cylinders.push(CylinderPrimitive {
                pose: Some(pose_of(center, &turned(rotation))),
                size: Some(vector(&Vector3::new(2.0 * radius, 2.0 * radius, 2.0 * half_length))),
                bottom_scale: 1.0,
                top_scale: 1.0,
                color: Some(BODY),
            });
        }
    }
}

fn cube(pose: Pose, size: &Vector3<f64>, color: Color) -> CubePrimitive {
    CubePrimitive { pose: Some(pose), size: Some(vector(size)), color: Some(color) }
}

fn sphere(center: &Vector3<f64>, radius: f64, color: Color) -> SpherePrimitive {
    let size = Vector3::repeat(2.0 * radius);
    SpherePrimitive {
        pose: Some(pose_of(center, &UnitQuaternion::identity())),
        size: Some(vector(&size)),
        color: Some(color),
    }
}
