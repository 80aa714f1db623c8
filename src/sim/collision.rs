//! Which points of the machine are near the ground.
//!
//! Every shape meets the ground at spheres (of radius zero for corners): a foot at one, a box at its corners, a cylinder at
//! the lowest point of each rim. Against a plane this is exact. Against the edges of steps and blocks the long edges of a
//! box are seen at points [`EDGE_SPACING`] apart: an edge of a block narrower than that can be missed between them.

use nalgebra::{Matrix3, Vector3};

use super::config::{BodyKind, SimConfig, TerrainKind};
use super::contact::{ContactPoint, ContactSolver, TRUNK, Velocity};
use super::dynamics::Dynamics;
use super::state::State;
use super::terrain::{MAX_TOUCHES, Terrain, Touch};
use crate::robot::description::{Body, RobotDescription, Shape};
use crate::robot::{LEGS, Leg};

/// Where boxes are to meet boxes, points along an edge are at most this far apart, m.
const EDGE_SPACING: f64 = 0.1;
/// Contacts are looked for as if points could be faster than they are by this much, m/s: what impulses of the same step may add.
const SPEED_MARGIN: f64 = 2.0;
/// No point of the machine moves faster than this when contacts are looked for, m/s.
const SPEED_LIMIT: f64 = 20.0;

/// A sphere or rim of the machine that can touch.
#[derive(Debug, Clone, Copy)]
enum Outline {
    Sphere {
        radius: f64,
    },
    /// A circle about `axis` (link axes).
    Rim {
        radius: f64,
        axis: Vector3<f64>,
    },
}

#[derive(Debug, Clone, Copy)]
struct Probe {
    /// Leg, or [`TRUNK`].
    leg: usize,
    link: usize,
    /// Centre in the link's frame, m.
    center: Vector3<f64>,
    outline: Outline,
}

/// A sphere of the machine where it is now.
struct Place {
    center_body: Vector3<f64>,
    center_world: Vector3<f64>,
    radius: f64,
}

/// A run of probes in one ball.
#[derive(Debug, Clone, Copy)]
struct Ball {
    leg: usize,
    link: usize,
    center: Vector3<f64>,
    radius: f64,
    first: usize,
    count: usize,
}

/// A step that is about to be made.
pub(super) struct Moment<'a> {
    pub dynamics: &'a Dynamics,
    pub state: &'a State,
    pub terrain: &'a Terrain,
    pub world_from_body: &'a Matrix3<f64>,
    /// Velocity that it would end with without contact.
    pub free: &'a Velocity,
    /// Its length, s.
    pub h: f64,
}

/// All that can touch.
#[derive(Debug, Clone)]
pub(super) struct Collider {
    /// The feet come first, one per leg.
    probes: Vec<Probe>,
    balls: Vec<Ball>,
}

impl Collider {
    pub fn new(description: &RobotDescription, config: &SimConfig) -> Collider {
        let mut collider = Collider { probes: Vec::new(), balls: Vec::new() };
        let spacing = match config.terrain.kind {
            TerrainKind::Flat | TerrainKind::Slope => f64::INFINITY,
            TerrainKind::Steps | TerrainKind::Blocks => EDGE_SPACING,
        };
        for (leg, part) in description.legs.iter().enumerate() {
            let outline = Outline::Sphere { radius: part.foot_radius };
            collider.probes.push(Probe { leg, link: 2, center: part.foot_origin, outline });
            collider.add_ball(leg);
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
        collider
    }

    /// How many impulses are to be remembered.
    pub fn memories(&self) -> usize {
        self.probes.len() * MAX_TOUCHES
    }

    /// The leg whose foot this contact is; none for other parts.
    pub fn foot_of(point: &ContactPoint) -> Option<Leg> {
        Leg::ALL.get(point.memory / MAX_TOUCHES).copied()
    }

    fn add_body(&mut self, body: &Body, leg: usize, link: usize, spacing: f64) {
        for shape in &body.collision {
            let first = self.probes.len();
            match *shape {
                Shape::Sphere { center, radius } => {
                    self.probes.push(Probe { leg, link, center, outline: Outline::Sphere { radius } });
                }
                Shape::Box { center, rotation, half_extents } => {
                    for point in edge_points(&half_extents, spacing) {
                        let outline = Outline::Sphere { radius: 0.0 };
                        self.probes.push(Probe { leg, link, center: center + rotation * point, outline });
                    }
                }
                Shape::Cylinder { center, rotation, radius, half_length } => {
                    let axis: Vector3<f64> = rotation.column(2).into();
                    for end in [-half_length, half_length] {
                        let outline = Outline::Rim { radius, axis };
                        self.probes.push(Probe { leg, link, center: center + axis * end, outline });
                    }
                }
            }
            self.add_ball(first);
        }
    }

    /// A ball around the probes from `first` on, which belong to one link.
    fn add_ball(&mut self, first: usize) {
        let probes = &self.probes[first..];
        let center = probes.iter().map(|p| p.center).sum::<Vector3<f64>>() / probes.len() as f64;
        let reach = |p: &Probe| {
            let radius = match p.outline {
                Outline::Sphere { radius } | Outline::Rim { radius, .. } => radius,
            };
            (p.center - center).norm() + radius
        };
        let radius = probes.iter().map(reach).fold(0.0, f64::max);
        let Probe { leg, link, .. } = probes[0];
        self.balls.push(Ball { leg, link, center, radius, first, count: probes.len() });
    }

    /// Adds to `solver` every point that may touch in the step.
    pub fn find(&self, moment: &Moment, solver: &mut ContactSolver) {
        let reach = SPEED_LIMIT * moment.h;
        let now = Velocity::of(moment.state);
        self.near(moment.dynamics, moment.state, moment.terrain, moment.world_from_body, reach, |probe, i, place| {
            for (k, touch) in moment.terrain.touches(&place.center_world, place.radius, reach).into_iter().enumerate() {
                if let Some(touch) = touch {
                    add_touch(moment, &now, probe, MAX_TOUCHES * i + k, &place, &touch, solver);
                }
            }
        });
    }

    /// The smallest gap of any probe to the ground, m.
    pub fn smallest_gap(&self, dynamics: &Dynamics, state: &State, terrain: &Terrain) -> f64 {
        let world_from_body = state.orientation_world.to_rotation_matrix().into_inner();
        let mut smallest = f64::INFINITY;
        self.near(dynamics, state, terrain, &world_from_body, f64::INFINITY, |_, _, place| {
            for touch in terrain.touches(&place.center_world, place.radius, f64::INFINITY).into_iter().flatten() {
                smallest = smallest.min(touch.gap);
            }
        });
        smallest
    }

    /// Calls `see` with every probe that is nearer than `reach` to the height of the highest ground.
    #[inline]
    fn near(
        &self,
        dynamics: &Dynamics,
        state: &State,
        terrain: &Terrain,
        world_from_body: &Matrix3<f64>,
        reach: f64,
        mut see: impl FnMut(&Probe, usize, Place),
    ) {
        let up_body = world_from_body.tr_mul(&terrain.normal());
        let base = terrain.clearance(&state.position_world);
        for ball in &self.balls {
            // Height of a point p of the link: that of its frame's origin and up . p in the link's axes.
            let (origin_body, up_link) = match ball.leg {
                TRUNK => (Vector3::zeros(), up_body),
                leg => (dynamics.legs[leg].origin_body[ball.link], dynamics.legs[leg].into_link(ball.link, &up_body)),
            };
            let height = base + up_body.dot(&origin_body);
            if height + up_link.dot(&ball.center) > ball.radius + reach {
                continue;
            }
            for (i, probe) in self.probes.iter().enumerate().skip(ball.first).take(ball.count) {
                if height + up_link.dot(&probe.center) > probe.outline.radius() + reach {
                    continue;
                }
                let (center_link, radius) = probe.outline.lowest(&probe.center, &up_link);
                let center_body = match ball.leg {
                    TRUNK => center_link,
                    leg => dynamics.legs[leg].in_body(ball.link, &center_link),
                };
                let center_world = state.position_world + world_from_body * center_body;
                see(probe, i, Place { center_body, center_world, radius });
            }
        }
    }
}

impl Outline {
    fn radius(&self) -> f64 {
        match *self {
            Outline::Sphere { radius } | Outline::Rim { radius, .. } => radius,
        }
    }

    /// Centre and radius of the sphere that meets the ground, link axes: for a rim its lowest point.
    #[inline]
    fn lowest(&self, center: &Vector3<f64>, up: &Vector3<f64>) -> (Vector3<f64>, f64) {
        match *self {
            Outline::Sphere { radius } => (*center, radius),
            Outline::Rim { radius, axis } => {
                // From the centre against the ground's normal, in the rim's plane.
                let out = axis * axis.dot(up) - up;
                let size = out.norm();
                (if size > 1e-9 { center + out * (radius / size) } else { *center }, 0.0)
            }
        }
    }
}

/// Adds a touch to `solver` if it may close within the step.
#[inline]
fn add_touch(
    moment: &Moment,
    now: &Velocity,
    probe: &Probe,
    memory: usize,
    place: &Place,
    touch: &Touch,
    solver: &mut ContactSolver,
) {
    let Moment { dynamics, terrain, world_from_body, free, h, .. } = *moment;
    let normal_body = world_from_body.tr_mul(&touch.normal_world);
    let position_body = place.center_body - normal_body * (place.radius + touch.gap.min(0.0));
    let leg_jacobian = match probe.leg {
        TRUNK => Matrix3::zeros(),
        leg => dynamics.legs[leg].point_jacobian(probe.link, &position_body),
    };
    let ground_velocity_body = match touch.block {
        Some(block) => world_from_body.tr_mul(&terrain.block_velocity(block)),
        None => Vector3::zeros(),
    };
    let free_velocity_body = point_velocity(free, probe.leg, &leg_jacobian, &position_body) - ground_velocity_body;
    if touch.gap + h * (normal_body.dot(&free_velocity_body) - SPEED_MARGIN) > 0.0 {
        return;
    }
    let point = ContactPoint {
        leg: probe.leg,
        memory,
        position_body,
        normal_body,
        leg_jacobian,
        gap: touch.gap,
        friction: touch.friction,
        slip_body: point_velocity(now, probe.leg, &leg_jacobian, &position_body) - ground_velocity_body,
        free_slip_body: free_velocity_body,
        block: touch.block,
    };
    solver.add_point(dynamics, point, world_from_body, h);
}

/// Velocity of a point at `p_body` on `leg`, body axes: v + w x p + J_l dq.
#[inline]
fn point_velocity(v: &Velocity, leg: usize, leg_jacobian: &Matrix3<f64>, p_body: &Vector3<f64>) -> Vector3<f64> {
    let linear = Vector3::new(v.trunk[0], v.trunk[1], v.trunk[2]);
    let angular = Vector3::new(v.trunk[3], v.trunk[4], v.trunk[5]);
    let trunk = linear + angular.cross(p_body);
    if leg == TRUNK { trunk } else { trunk + leg_jacobian * v.legs[leg] }
}

/// The corners of a box, and points along its edges no farther apart than `spacing`.
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
