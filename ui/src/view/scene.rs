//! The scene around the robot in the picture: the ground, the paths of the trial, and where the best one landed.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use quadfrog::recording::scene::{Ground, GroundBox};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{Leg, leg_of};
use quadfrog::telemetry::Tick;
use quadfrog::trial::Task;

use super::robot_shape::leg_points;
use crate::model::Model;
use crate::model::history::ChartSample;

/// Distance between the lines on the ground, m.
const GRID: f64 = 0.5;
/// A robot farther from the begin of its trial has been carried, m.
const CARRIED: f64 = 2.0;
/// Steps in which the picture gets wider with a robot that moves out of it, m.
const FRAME_STEP: f64 = 0.1;
/// Samples between two dots of a path.
const PATH_STEP: usize = 6;

/// The value in whole steps, so that noise below a step changes nothing.
pub fn steady(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

/// Place and heading of a robot on the ground at the begin of a trial: the frame of the picture, x forward, z up.
pub struct Start {
    /// World, m; z is the floor's height.
    origin_world: Vector3<f64>,
    /// Rad.
    pub yaw: f64,
}

impl Start {
    fn of(sample: &ChartSample, ground: Option<&Ground>) -> Start {
        let [x, y] = sample.position_world.map(f64::from);
        Start { origin_world: Vector3::new(x, y, floor_z(ground, x, y)), yaw: f64::from(sample.yaw) }
    }

    /// The present place, rounded: a robot that stands does not move in the picture.
    fn present(tick: &Tick, ground: Option<&Ground>) -> Start {
        let position = tick.estimate.position_world;
        let [x, y] = [position.x, position.y].map(|value| steady(value, 0.1));
        let yaw = steady(tick.estimate.roll_pitch_yaw.z, 0.1);
        Start { origin_world: Vector3::new(x, y, floor_z(ground, x, y)), yaw }
    }

    /// A place of the world in the picture's frame, m.
    pub fn place(&self, point_world: Vector3<f64>) -> Vector3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), -self.yaw) * (point_world - self.origin_world)
    }

    fn world(&self, point: Vector3<f64>) -> Vector3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), self.yaw) * point + self.origin_world
    }

    fn trunk(&self, sample: &ChartSample) -> Vector3<f64> {
        let [x, y] = sample.position_world;
        self.place(Vector3::new(x.into(), y.into(), sample.height.into()))
    }

    /// The feet that are not on the ground.
    fn feet_in_air(&self, sample: &ChartSample, robot: &RobotDescription) -> Vec<Vector3<f64>> {
        let trunk = self.trunk(sample);
        let [roll, pitch, yaw] = [sample.roll, sample.pitch, sample.yaw].map(f64::from);
        let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw - self.yaw);
        let joints = sample.joints.angle.map(f64::from);
        let in_air = Leg::ALL.into_iter().filter(|leg| !sample.contact[*leg as usize]);
        in_air.map(|leg| turned * leg_points(robot, leg, &leg_of(&joints, leg as usize))[3] + trunk).collect()
    }
}

/// Height of the plane of the ground at a place, world, m; of a level one where it is not known.
fn floor_z(ground: Option<&Ground>, x: f64, y: f64) -> f64 {
    let normal = ground.map_or(Vector3::z(), |ground| ground.normal_world);
    -(normal.x * x + normal.y * y) / normal.z
}

/// Parts of the picture beside the robot, in its frame.
pub struct Scene<'a> {
    pub start: Start,
    ground: Option<&'a Ground>,
    /// The trunk since the impulse began; empty without a trial.
    pub path: Vec<Vector3<f64>>,
    /// The feet while they were in the air.
    pub feet: Vec<Vector3<f64>>,
    /// Displacement of the best trial.
    pub best: Option<Vector3<f64>>,
    /// Highest trunk of the best trial over the ground, m; 0 without one.
    pub apex: f64,
}

impl<'a> Scene<'a> {
    pub fn of(model: &'a Model, robot: &RobotDescription) -> Scene<'a> {
        let (tick, ground) = (&model.snapshot.tick, model.ground.as_ref());
        let trial = tick.trial.or_else(|| model.session.under_review().map(|trial| trial.trial));
        let trace = trial.and_then(|trial| model.history.trace(trial)).and_then(from_impulse);
        let best = model.session.trials.best().and_then(|best| model.history.trace(best.trial)).and_then(from_impulse);
        let begin_of_best = best.and_then(|trace| trace.first()).map(|first| Start::of(first, ground));
        let of_best = |sample: &ChartSample| begin_of_best.as_ref().map(|start| start.trunk(sample));
        let apex = best.into_iter().flatten().filter_map(of_best).map(|trunk| trunk.z).fold(0.0, f64::max);
        let best = best.and_then(|trace| of_best(trace.last()?));
        let present = Start::present(tick, ground);
        let start = trace.and_then(|trace| trace.first()).map(|first| Start::of(first, ground));
        let near = |start: &Start| (start.origin_world - present.origin_world).xy().norm() < CARRIED;
        let (start, trace) = match start.filter(near).zip(trace) {
            Some((start, trace)) => (start, trace),
            None => (present, &[][..]),
        };
        let samples = || trace.iter().step_by(PATH_STEP);
        let path = samples().map(|sample| start.trunk(sample)).collect();
        let feet = samples().flat_map(|sample| start.feet_in_air(sample, robot)).collect();
        Scene { start, ground, path, feet, best, apex }
    }

    /// The displacement for which there is room in the picture: of the best trial, before there is one a usual one, or that of the
    /// present trial or of the `trunk` now if it is longer: a robot that fell rolls on after the trial.
    pub fn framed_jump(&self, task: Option<Task>, trunk: &Vector3<f64>) -> Vector3<f64> {
        let usual = match task {
            Some(Task::Forward) => Vector3::new(0.5, 0.0, 0.0),
            Some(Task::LateralLeft) => Vector3::new(0.0, 0.3, 0.0),
            Some(Task::LateralRight) => Vector3::new(0.0, -0.3, 0.0),
            Some(Task::TwistCcw | Task::TwistCw) | None => Vector3::zeros(),
        };
        let expected = self.best.unwrap_or(usual);
        let landed = self.path.last().copied().unwrap_or_default();
        let now = trunk.map(|length| steady(length, FRAME_STEP));
        [landed, now].into_iter().fold(
            expected,
            |longest, jump| {
                if jump.xy().norm() > longest.xy().norm() { jump } else { longest }
            },
        )
    }

    /// The point of the plane of the ground at a place.
    pub fn floor(&self, x: f64, y: f64) -> Vector3<f64> {
        let world = self.start.world(Vector3::new(x, y, 0.0));
        self.start.place(Vector3::new(world.x, world.y, floor_z(self.ground, world.x, world.y)))
    }

    /// Lines on the ground around a jump.
    pub fn floor_lines(&self, jump: &Vector3<f64>) -> Vec<[Vector3<f64>; 2]> {
        let [left, right, near, far] = floor_range(jump);
        let steps = |from: f64, to: f64| {
            let count = ((to - from) / GRID).round() as u32;
            (0..=count).map(move |index| from + f64::from(index) * GRID)
        };
        let along = steps(near, far).map(|y| [self.floor(left, y), self.floor(right, y)]);
        let across = steps(left, right).map(|x| [self.floor(x, near), self.floor(x, far)]);
        along.chain(across).collect()
    }

    /// The upper edges and the corners of steps and blocks around a jump, as far as the lines on the ground reach.
    pub fn box_lines(&self, jump: &Vector3<f64>) -> Vec<[Vector3<f64>; 2]> {
        let range = floor_range(jump);
        let boxes = self.ground.iter().flat_map(|ground| &ground.boxes);
        boxes.flat_map(|shape| self.edges_of(shape)).filter_map(|edge| clipped(edge, range)).collect()
    }

    fn edges_of(&self, shape: &GroundBox) -> [[Vector3<f64>; 2]; 8] {
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), shape.yaw_rad);
        let center = Vector3::new(shape.center_m[0], shape.center_m[1], 0.0);
        let corner = |index: usize, z: f64| {
            let (x, y) = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)][index % 4];
            let from_center = turned * Vector3::new(x * shape.edges_m[0], y * shape.edges_m[1], z);
            self.start.place(center + from_center)
        };
        let [bottom, top] = shape.z_m;
        std::array::from_fn(|edge| match edge {
            0..4 => [corner(edge, top), corner(edge + 1, top)],
            _ => [corner(edge, bottom), corner(edge, top)],
        })
    }
}

/// Ends of the lines on the ground around a jump: least and largest x, then y, m.
fn floor_range(jump: &Vector3<f64>) -> [f64; 4] {
    let range = |end: f64| [((end.min(0.0) / GRID).floor() - 1.0) * GRID, ((end.max(0.0) / GRID).ceil() + 1.0) * GRID];
    let ([left, right], [near, far]) = (range(jump.x), range(jump.y));
    [left, right, near, far]
}

/// The part of a line above a rectangle of the ground; none outside of it (Liang and Barsky, 1984).
fn clipped([from, to]: [Vector3<f64>; 2], [left, right, near, far]: [f64; 4]) -> Option<[Vector3<f64>; 2]> {
    let along = to - from;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let sides =
        [(-along.x, from.x - left), (along.x, right - from.x), (-along.y, from.y - near), (along.y, far - from.y)];
    for (step, room) in sides {
        if step < 0.0 {
            enter = enter.max(room / step);
        } else if step > 0.0 {
            leave = leave.min(room / step);
        } else if room < 0.0 {
            return None;
        }
    }
    (enter <= leave).then(|| [from + along * enter, from + along * leave])
}

/// The samples since the impulse began.
fn from_impulse(trace: &[ChartSample]) -> Option<&[ChartSample]> {
    let begun = &trace[trace.partition_point(|sample| sample.trial_time_s < 0.0)..];
    (!begun.is_empty()).then_some(begun)
}
