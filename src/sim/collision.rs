//! Collision detection: points of the robot that are near the ground.
//!
//! Every shape meets the ground at spheres (of radius zero for corners): a foot at one, a box at its corners, a
//! cylinder at the lowest point of each rim. Against a plane this is exact. Against the edges of steps and blocks the
//! long edges of a box are sampled [`EDGE_SPACING`] apart: a narrower edge of a block can pass between two samples.

use fearless_simd::Simd;
use nalgebra::{Matrix3, Vector3};

use super::config::{BodyKind, SimConfig, TerrainKind};
use super::contact::{ContactCandidate, ContactSolver, SPEED_MARGIN};
use super::dynamics::Dynamics;
use super::lanes::{Lanes, Quad, with_lanes};
use super::motion::{GeneralizedVelocity, StepContext, TRUNK};
use super::six::split;
use super::spatial::{AxisRotation, inner};
use super::state::SimState;
use super::terrain::{MAX_TERRAIN_CONTACTS, Terrain};
use crate::robot::description::{CollisionShape, RigidBody, RobotDescription};
use crate::robot::{LEGS, Leg, PerLeg};

/// Largest distance of two samples along an edge, for contact between boxes, m.
const EDGE_SPACING: f64 = 0.1;

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

/// Bounds on the same link of every leg, one per leg.
#[derive(Debug, Clone, Copy)]
struct LegBounds {
    link: usize,
    center: Vector3<Quad>,
    half_extents: Vector3<Quad>,
    /// Negative infinity for a leg without such bounds.
    radius: Quad,
}

/// Heights of the legs at the current state.
struct LegSurvey {
    /// Centres of the feet, body axes, m.
    foot_body: PerLeg<Vector3<f64>>,
    /// Heights of their centres above the highest ground, m.
    foot_height: PerLeg<f64>,
    /// Whether a link of a leg can be within reach of the ground.
    links_are_near: bool,
}

/// All collision geometry of the robot.
#[derive(Debug, Clone)]
pub(super) struct Collider {
    /// The feet first, one per leg.
    probes: Vec<Probe>,
    /// Those of trunk and links; the feet have none.
    bounds: Vec<ProbeBounds>,
    /// Those of `bounds` that belong to legs, four at a time.
    leg_bounds: Vec<LegBounds>,
    /// Centres of the feet in the calves' frames, m.
    feet: Vector3<Quad>,
    /// Whether contact of each probe is a sign of a fall.
    falls: Vec<bool>,
    /// Upper bound of the distance of a point from the trunk's origin or from a joint that moves it, m.
    extent: f64,
}

impl Collider {
    pub fn new(description: &RobotDescription, config: &SimConfig) -> Collider {
        let parts = description.legs.each_ref();
        let mut collider = Collider {
            probes: Vec::new(),
            bounds: Vec::new(),
            leg_bounds: Vec::new(),
            feet: Quad::vectors(&parts.map(|leg| leg.foot_origin)),
            falls: Vec::new(),
            extent: 0.0,
        };
        let spacing = match config.terrain.kind {
            TerrainKind::Flat | TerrainKind::Slope => f64::INFINITY,
            TerrainKind::Steps | TerrainKind::Blocks => EDGE_SPACING,
        };
        for (leg, part) in description.legs.iter().enumerate() {
            let shape = ProbeShape::Sphere { radius: part.foot_radius };
            collider.probes.push(Probe { leg, link: 2, center: part.foot_origin, shape });
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
        collider.leg_bounds = (0..3).flat_map(|link| leg_bounds(&collider.bounds, link)).collect();
        // The length of the stretched leg, plus the shape at its end.
        let length = |leg: usize, link: usize| {
            let origins = description.legs.get(leg).map_or(&[][..], |leg| &leg.joint_origin[..=link]);
            origins.iter().map(|origin| origin.norm()).sum::<f64>()
        };
        let feet = parts.iter().enumerate().map(|(i, leg)| length(i, 2) + leg.foot_origin.norm() + leg.foot_radius);
        let bodies = collider.bounds.iter().map(|bound| {
            length(bound.leg, bound.link) + bound.center.norm() + bound.half_extents.norm() + bound.radius
        });
        collider.extent = feet.chain(bodies).fold(0.0, f64::max);
        collider
    }

    /// Upper bound of the distance of a point of the robot from the trunk's origin, m.
    pub fn extent(&self) -> f64 {
        self.extent
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
        self.near(step.dynamics, step.state, step.terrain, step.world_from_body, reach, |probe, i, sphere| {
            for (k, ground) in step.terrain.contacts(&sphere.center_world, sphere.radius, reach).into_iter().enumerate()
            {
                if let Some(ground) = ground {
                    solver.add_candidate(
                        step,
                        ContactCandidate {
                            leg: probe.leg,
                            link: probe.link,
                            warm_start_slot: MAX_TERRAIN_CONTACTS * i + k,
                            center_body: sphere.center_body,
                            radius: sphere.radius,
                            ground,
                        },
                    );
                }
            }
        });
        solver.add_contacts(step);
    }

    /// Upper bound of the speed of any point: |v| + r |w| + l (|dq_1| + |dq_2| + |dq_3|), m/s.
    fn fastest(&self, v: &GeneralizedVelocity) -> f64 {
        let (linear, angular) = split(&v.trunk);
        let legs = v.legs.iter().fold(0.0, |most: f64, dq| most.max(dq.abs().sum()));
        linear.norm() + self.extent * (angular.norm() + legs)
    }

    /// Smallest distance of a probe to the ground, m.
    pub fn smallest_gap(&self, dynamics: &Dynamics, state: &SimState, terrain: &Terrain) -> f64 {
        let world_from_body = state.world_from_body.to_rotation_matrix().into_inner();
        let mut smallest = f64::INFINITY;
        self.near(
            dynamics,
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
        dynamics: &Dynamics,
        state: &SimState,
        terrain: &Terrain,
        world_from_body: &Matrix3<f64>,
        reach: f64,
        mut visit: impl FnMut(&Probe, usize, ProbeSphere),
    ) {
        let up_body = world_from_body.tr_mul(&terrain.normal());
        let base = terrain.clearance(&state.position_world);
        let survey = with_lanes!(dynamics.instructions(), simd => self.survey(simd, dynamics, &up_body, base, reach));
        for (i, probe) in self.probes[..LEGS].iter().enumerate() {
            let radius = probe.shape.radius();
            if survey.foot_height[i] <= radius + reach {
                let center_body = survey.foot_body[i];
                let center_world = state.position_world + world_from_body * center_body;
                visit(probe, i, ProbeSphere { center_body, center_world, radius });
            }
        }
        let legs = survey.links_are_near.then(|| dynamics.legs());
        for bound in &self.bounds {
            // Height of a point p of a link: height of its frame's origin + up . p in link axes.
            let (height, up_link) = match (bound.leg, &legs) {
                (TRUNK, _) => (base, up_body),
                (_, None) => continue,
                (leg, Some(legs)) => {
                    let leg = &legs[leg];
                    (base + up_body.dot(&leg.origin_body[bound.link]), leg.in_links(&up_body)[bound.link])
                }
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
                let center_body = match (bound.leg, &legs) {
                    (leg, Some(legs)) if leg != TRUNK => legs[leg].in_body(bound.link, &center_link),
                    _ => center_link,
                };
                let center_world = state.position_world + world_from_body * center_body;
                visit(probe, i, ProbeSphere { center_body, center_world, radius });
            }
        }
    }

    /// Finds the heights of feet and links above the highest ground, above which the trunk's origin is by `base`.
    #[inline(always)]
    fn survey<S: Simd>(
        &self,
        simd: S,
        dynamics: &Dynamics,
        up_body: &Vector3<f64>,
        base: f64,
        reach: f64,
    ) -> LegSurvey {
        let (factors, [thigh, calf]) = (dynamics.leg_factors(), dynamics.link_rotations());
        let load = |rotation| AxisRotation::load(simd, rotation);
        let (hip, thigh, calf) = (load(factors.hip), load(thigh), load(calf));
        let splat = |x: f64| Lanes::splat(simd, x);
        let up = Vector3::new(splat(up_body.x), splat(up_body.y), splat(up_body.z));
        let up_hip = hip.unrotate_x(&up);
        let up_links = [up_hip, thigh.unrotate_y(&up_hip), calf.unrotate_y(&up_hip)];
        let height = |link: usize| splat(base) + inner(&up, &Lanes::vector(simd, &factors.origin_body[link]));
        let heights = [height(0), height(1), height(2)];

        let foot = Lanes::vector(simd, &self.feet);
        let foot_height = heights[2] + inner(&up_links[2], &foot);
        let foot_body = Lanes::vector(simd, &factors.origin_body[2]) + hip.rotate_x(&calf.rotate_y(&foot));
        let mut links_are_near = false;
        for bounds in &self.leg_bounds {
            let (up, half) = (&up_links[bounds.link], Lanes::vector(simd, &bounds.half_extents));
            let depth = up.x.abs() * half.x + up.y.abs() * half.y + up.z.abs() * half.z;
            let lowest = heights[bounds.link] + inner(up, &Lanes::vector(simd, &bounds.center))
                - depth
                - Lanes::load(simd, bounds.radius);
            // More than the rounding by which the heights of single bounds differ from these.
            links_are_near |= lowest.store().0.iter().any(|gap| *gap <= reach + 1e-9);
        }
        let [x, y, z] = [foot_body.x.store().0, foot_body.y.store().0, foot_body.z.store().0];
        LegSurvey {
            foot_body: std::array::from_fn(|leg| Vector3::new(x[leg], y[leg], z[leg])),
            foot_height: foot_height.store().0,
            links_are_near,
        }
    }
}

/// Returns the bounds on the link `link` of every leg, four at a time.
fn leg_bounds(bounds: &[ProbeBounds], link: usize) -> Vec<LegBounds> {
    let of_leg = |leg: usize| bounds.iter().filter(|b| (b.leg, b.link) == (leg, link)).copied().collect::<Vec<_>>();
    let legs: PerLeg<Vec<ProbeBounds>> = std::array::from_fn(of_leg);
    let most = legs.iter().map(Vec::len).max().unwrap_or_default();
    (0..most)
        .map(|n| {
            let bounds = legs.each_ref().map(|leg| leg.get(n).copied());
            let vectors = |f: fn(&ProbeBounds) -> Vector3<f64>| {
                Quad::vectors(&bounds.map(|bound| bound.as_ref().map_or(Vector3::zeros(), f)))
            };
            LegBounds {
                link,
                center: vectors(|bound| bound.center),
                half_extents: vectors(|bound| bound.half_extents),
                radius: Quad(bounds.map(|bound| bound.map_or(f64::NEG_INFINITY, |bound| bound.radius))),
            }
        })
        .collect()
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
    points
}
