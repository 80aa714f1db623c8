//! Collision detection: points of the robot that are near the ground.
//!
//! Every shape meets the ground at spheres (of radius zero for corners): a foot at one, a box at its corners, a
//! cylinder at the lowest point of each rim. Against a plane this is exact. Against the edges of steps and blocks the
//! long edges of a box are sampled [`EDGE_SPACING`] apart: a narrower edge of a block can pass between two samples.

use nalgebra::{Matrix3, Vector3};

use super::config::{BodyKind, SimConfig, TerrainKind};
use super::contact::{ContactPoint, ContactSolver};
use super::dynamics::LegDynamics;
use super::motion::{GeneralizedVelocity, StepContext, TRUNK};
use super::six::split;
use super::state::SimState;
use super::terrain::{MAX_TERRAIN_CONTACTS, Terrain, TerrainContact};
use crate::robot::description::{CollisionShape, RigidBody, RobotDescription};
use crate::robot::{LEGS, Leg, PerLeg};

/// Largest distance of two samples along an edge, for contact between boxes, m.
const EDGE_SPACING: f64 = 0.1;
/// Speed that impulses of the same step may add to a point, m/s.
const SPEED_MARGIN: f64 = 2.0;

/// Geometry that can touch the ground.
#[derive(Debug, Clone, Copy)]
enum ProbeShape {
    /// Its radius is zero for a corner.
    Sphere { radius: f64 },
    /// A circle about `axis` (link axes).
    Rim { radius: f64, axis: Vector3<f64> },
}

/// A sphere or rim of a link that can touch the ground.
#[derive(Debug, Clone, Copy)]
struct Probe {
    /// Leg, or [`TRUNK`].
    leg: usize,
    link: usize,
    /// Centre in the link's frame, m.
    center: Vector3<f64>,
    shape: ProbeShape,
}

/// The sphere of a probe at the current state.
struct ProbeSphere {
    center_body: Vector3<f64>,
    center_world: Vector3<f64>,
    radius: f64,
}

/// Bounds of a run of probes on one link: a box along the link's axes that holds their centres, and the largest radius about them.
#[derive(Debug, Clone, Copy)]
struct ProbeBounds {
    leg: usize,
    link: usize,
    center: Vector3<f64>,
    half_extents: Vector3<f64>,
    radius: f64,
    /// First probe, and number of probes.
    first: usize,
    count: usize,
}

/// All collision geometry of the robot.
#[derive(Debug, Clone)]
pub(super) struct Collider {
    /// The feet first, one per leg.
    probes: Vec<Probe>,
    bounds: Vec<ProbeBounds>,
    /// Whether contact of each probe is a sign of a fall.
    falls: Vec<bool>,
    /// Upper bound of the distance of a point from the trunk's origin or from a joint that moves it, m.
    extent: f64,
}

impl Collider {
    pub fn new(description: &RobotDescription, config: &SimConfig) -> Collider {
        let mut collider = Collider { probes: Vec::new(), bounds: Vec::new(), falls: Vec::new(), extent: 0.0 };
        let spacing = match config.terrain.kind {
            TerrainKind::Flat | TerrainKind::Slope => f64::INFINITY,
            TerrainKind::Steps | TerrainKind::Blocks => EDGE_SPACING,
        };
        for (leg, part) in description.legs.iter().enumerate() {
            let shape = ProbeShape::Sphere { radius: part.foot_radius };
            collider.probes.push(Probe { leg, link: 2, center: part.foot_origin, shape });
            collider.add_bound(leg);
        }
        let touches = |kind| config.contact.bodies.contains(&kind);
        if touches(BodyKind::Trunk) {
            collider.add_body(&description.trunk, TRUNK, 0, spacing);
        }
        for (leg, part) in description.legs.iter().enumerate() {
            for (link, kind) in [BodyKind::Hip, BodyKind::Thigh, BodyKind::Calf].into_iter().enumerate() {
                if touches(kind) {
                    collider.add_body(&part.bodies[link], leg, link, spacing);
                }
            }
        }
        collider.falls = (collider.probes.iter().enumerate().map(|(i, probe)| {
            let kind = match (probe.leg, probe.link) {
                (TRUNK, _) => BodyKind::Trunk,
                (_, 0) => BodyKind::Hip,
                (_, 1) => BodyKind::Thigh,
                _ => BodyKind::Calf,
            };
            i >= LEGS && config.contact.fall_bodies.contains(&kind)
        }))
        .collect();
        // The length of the stretched leg, plus the shape at its end.
        for bound in &collider.bounds {
            let origins = description.legs.get(bound.leg).map_or(&[][..], |leg| &leg.joint_origin[..=bound.link]);
            let leg: f64 = origins.iter().map(|origin| origin.norm()).sum();
            collider.extent = collider.extent.max(leg + bound.center.norm() + bound.half_extents.norm() + bound.radius);
        }
        collider
    }

    /// Number of warm-start impulses.
    pub fn warm_start_slots(&self) -> usize {
        self.probes.len() * MAX_TERRAIN_CONTACTS
    }

    /// Leg whose foot has the warm-start impulse `slot`; none for other parts.
    pub fn foot_of(slot: usize) -> Option<Leg> {
        Leg::ALL.get(slot / MAX_TERRAIN_CONTACTS).copied()
    }

    /// Whether contact of the part with the warm-start impulse `slot` is a sign of a fall.
    pub fn signals_fall(&self, slot: usize) -> bool {
        self.falls[slot / MAX_TERRAIN_CONTACTS]
    }

    fn add_body(&mut self, body: &RigidBody, leg: usize, link: usize, spacing: f64) {
        for shape in &body.collision {
            let first = self.probes.len();
            match *shape {
                CollisionShape::Sphere { center, radius } => {
                    self.probes.push(Probe { leg, link, center, shape: ProbeShape::Sphere { radius } });
                }
                CollisionShape::Box { center, rotation, half_extents } => {
                    for point in edge_points(&half_extents, spacing) {
                        let shape = ProbeShape::Sphere { radius: 0.0 };
                        self.probes.push(Probe { leg, link, center: center + rotation * point, shape });
                    }
                }
                CollisionShape::Cylinder { center, rotation, radius, half_length } => {
                    let axis: Vector3<f64> = rotation.column(2).into();
                    for end in [-half_length, half_length] {
                        let shape = ProbeShape::Rim { radius, axis };
                        self.probes.push(Probe { leg, link, center: center + axis * end, shape });
                    }
                }
            }
            self.add_bound(first);
        }
    }

    /// Adds the bounds of the probes from `first` on, which belong to one link.
    fn add_bound(&mut self, first: usize) {
        let probes = &self.probes[first..];
        let fold = |f: fn(f64, f64) -> f64| probes.iter().map(|p| p.center).reduce(|a, b| a.zip_map(&b, f));
        let (low, high) = (fold(f64::min).unwrap_or_default(), fold(f64::max).unwrap_or_default());
        let Probe { leg, link, .. } = probes[0];
        self.bounds.push(ProbeBounds {
            leg,
            link,
            center: (low + high) * 0.5,
            half_extents: (high - low) * 0.5,
            radius: probes.iter().map(|p| p.shape.radius()).fold(0.0, f64::max),
            first,
            count: probes.len(),
        });
    }

    /// Adds to `solver` every point that can touch in the step.
    pub fn find(&self, step: &StepContext, solver: &mut ContactSolver) {
        let reach = step.h * (self.fastest(step.free_velocity) + SPEED_MARGIN);
        let velocity = GeneralizedVelocity::of(step.state);
        self.near(step.legs, step.state, step.terrain, step.world_from_body, reach, |probe, i, sphere| {
            for (k, contact) in
                step.terrain.contacts(&sphere.center_world, sphere.radius, reach).into_iter().enumerate()
            {
                if let Some(contact) = contact {
                    add_contact(step, &velocity, probe, MAX_TERRAIN_CONTACTS * i + k, &sphere, &contact, solver);
                }
            }
        });
    }

    /// Upper bound of the speed of any point: |v| + r |w| + l (|dq_1| + |dq_2| + |dq_3|), m/s.
    fn fastest(&self, v: &GeneralizedVelocity) -> f64 {
        let (linear, angular) = split(&v.trunk);
        let legs = v.legs.iter().fold(0.0, |most: f64, dq| most.max(dq.abs().sum()));
        linear.norm() + self.extent * (angular.norm() + legs)
    }

    /// Smallest distance of a probe to the ground, m.
    pub fn smallest_gap(&self, legs: &PerLeg<LegDynamics>, state: &SimState, terrain: &Terrain) -> f64 {
        let world_from_body = state.world_from_body.to_rotation_matrix().into_inner();
        let mut smallest = f64::INFINITY;
        self.near(
            legs,
            state,
            terrain,
            &world_from_body,
            f64::INFINITY,
            |_, _, ProbeSphere { center_world, radius, .. }| {
                smallest = smallest.min(terrain.plane_gap(&center_world, radius));
                // Of the blocks only one nearer than the smallest gap so far counts.
                for contact in terrain.contacts(&center_world, radius, smallest.max(0.0)).into_iter().flatten() {
                    smallest = smallest.min(contact.gap);
                }
            },
        );
        smallest
    }

    /// Calls `visit` with every probe whose height is less than `reach` above the highest ground.
    #[inline]
    fn near(
        &self,
        legs: &PerLeg<LegDynamics>,
        state: &SimState,
        terrain: &Terrain,
        world_from_body: &Matrix3<f64>,
        reach: f64,
        mut visit: impl FnMut(&Probe, usize, ProbeSphere),
    ) {
        let up_body = world_from_body.tr_mul(&terrain.normal());
        let base = terrain.clearance(&state.position_world);
        // Height of a point p of a link: height of its frame's origin + up . p in link axes.
        let links: PerLeg<[(f64, Vector3<f64>); 3]> = std::array::from_fn(|leg| {
            let leg: &LegDynamics = &legs[leg];
            let up_links = leg.in_links(&up_body);
            std::array::from_fn(|link| (base + up_body.dot(&leg.origin_body[link]), up_links[link]))
        });
        for bound in &self.bounds {
            let (height, up_link) = match bound.leg {
                TRUNK => (base, up_body),
                leg => links[leg][bound.link],
            };
            // Height of the box's lowest corner, less the radius about it.
            let half = &bound.half_extents;
            let depth = up_link.x.abs() * half.x + up_link.y.abs() * half.y + up_link.z.abs() * half.z;
            if height + up_link.dot(&bound.center) - depth > bound.radius + reach {
                continue;
            }
            let probes = &self.probes[bound.first..bound.first + bound.count];
            for (i, probe) in (bound.first..).zip(probes) {
                if height + up_link.dot(&probe.center) > probe.shape.radius() + reach {
                    continue;
                }
                let (center_link, radius) = probe.shape.lowest(&probe.center, &up_link);
                let center_body = match bound.leg {
                    TRUNK => center_link,
                    leg => legs[leg].in_body(bound.link, &center_link),
                };
                let center_world = state.position_world + world_from_body * center_body;
                visit(probe, i, ProbeSphere { center_body, center_world, radius });
            }
        }
    }
}

impl ProbeShape {
    fn radius(&self) -> f64 {
        match *self {
            ProbeShape::Sphere { radius } | ProbeShape::Rim { radius, .. } => radius,
        }
    }

    /// Centre and radius of the sphere that meets the ground, link axes; of a rim, its lowest point with radius zero.
    #[inline]
    fn lowest(&self, center: &Vector3<f64>, up: &Vector3<f64>) -> (Vector3<f64>, f64) {
        match *self {
            ProbeShape::Sphere { radius } => (*center, radius),
            ProbeShape::Rim { radius, axis } => {
                // The direction against the ground's normal in the plane of the rim.
                let out = axis * axis.dot(up) - up;
                let size = out.norm();
                (if size > 1e-9 { center + out * (radius / size) } else { *center }, 0.0)
            }
        }
    }
}

/// Adds a contact to `solver` if its gap can close within the step.
#[inline]
fn add_contact(
    step: &StepContext,
    velocity: &GeneralizedVelocity,
    probe: &Probe,
    warm_start_slot: usize,
    sphere: &ProbeSphere,
    contact: &TerrainContact,
    solver: &mut ContactSolver,
) {
    let StepContext { legs, terrain, world_from_body, h, .. } = *step;
    let normal_body = world_from_body.tr_mul(&contact.normal_world);
    let position_body = sphere.center_body - normal_body * (sphere.radius + contact.gap.min(0.0));
    let leg_jacobian = match probe.leg {
        TRUNK => Matrix3::zeros(),
        leg => legs[leg].point_jacobian(probe.link, &position_body),
    };
    let ground_velocity_body = match contact.block {
        Some(block) => world_from_body.tr_mul(&terrain.block_velocity(block)),
        None => Vector3::zeros(),
    };
    let free_velocity_body =
        point_velocity(step.free_velocity, probe.leg, &leg_jacobian, &position_body) - ground_velocity_body;
    if contact.gap + h * (normal_body.dot(&free_velocity_body) - SPEED_MARGIN) > 0.0 {
        return;
    }
    let point = ContactPoint {
        leg: probe.leg,
        warm_start_slot,
        position_body,
        normal_body,
        leg_jacobian,
        gap: contact.gap,
        friction: contact.friction,
        velocity_body: point_velocity(velocity, probe.leg, &leg_jacobian, &position_body) - ground_velocity_body,
        free_velocity_body,
        block: contact.block,
    };
    solver.add_point(step, &point);
}

/// Returns the velocity of a point at `p_body` on `leg`, body axes: v + w x p + J_l dq.
#[inline]
fn point_velocity(
    v: &GeneralizedVelocity,
    leg: usize,
    leg_jacobian: &Matrix3<f64>,
    p_body: &Vector3<f64>,
) -> Vector3<f64> {
    let (linear, angular) = split(&v.trunk);
    let trunk = linear + angular.cross(p_body);
    if leg == TRUNK { trunk } else { trunk + leg_jacobian * v.legs[leg] }
}

/// Returns the corners of a box, and points along its edges no farther apart than `spacing`.
fn edge_points(half: &Vector3<f64>, spacing: f64) -> Vec<Vector3<f64>> {
    let mut points: Vec<Vector3<f64>> = Vec::new();
    for corner in 0..8 {
        let sign = |axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
        points.push(Vector3::new(sign(0) * half.x, sign(1) * half.y, sign(2) * half.z));
    }
    for axis in 0..3 {
        let parts = (2.0 * half[axis] / spacing).ceil().max(1.0) as usize;
        for edge in 0..4 {
            for part in 1..parts {
                let mut point = Vector3::zeros();
                point[axis] = half[axis] * (2.0 * part as f64 / parts as f64 - 1.0);
                for (bit, other) in [(axis + 1) % 3, (axis + 2) % 3].into_iter().enumerate() {
                    point[other] = if edge >> bit & 1 == 0 { -half[other] } else { half[other] };
                }
                points.push(point);
            }
        }
    }
    debug_assert!(LEGS == TRUNK && points.len() >= 8);
    points
}
