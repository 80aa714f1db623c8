//! The robot in perspective, from behind on its right, on the ground where the trial began: near legs bright, far legs dim, the
//! front crossed, the path of the trunk, and where this and the best trial landed.

use nalgebra::{Point2, Rotation3, UnitQuaternion, Vector3};
use quadfrog::robot::description::{CollisionShape, RobotDescription};
use quadfrog::robot::kinematics::LegGeometry;
use quadfrog::robot::{Leg, leg_of};
use quadfrog::telemetry::Tick;
use quadfrog::trial::Task;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::dots::DotGrid;
use super::draw::heading;
use crate::model::Model;
use crate::model::history::ChartSample;
use crate::theme::{Role, Theme};

/// Half of the picture's width without a jump, m: the robot with its legs stretched.
const REACH: f64 = 0.45;
/// Lower and upper edge of the picture over the ground, m: room for the near feet, and for a trunk in the air.
const BOTTOM: f64 = -0.15;
const TOP: f64 = 0.9;
/// Room above the highest trunk of the best jump, m.
const ABOVE_TRUNK: f64 = 0.15;
/// Direction in which the camera looks: angle from the robot's left to its front, and downward, rad.
const AZIMUTH: f64 = 0.45;
const ELEVATION: f64 = 0.35;
/// Distance of the camera, in halves of the picture's width.
const DISTANCE: f64 = 4.0;
/// Distance between the lines on the ground, m.
const GRID: f64 = 0.5;
/// A robot farther from the begin of its trial has been carried, m.
const CARRIED: f64 = 2.0;
/// Samples between two dots of the path.
const PATH_STEP: usize = 6;

/// Steps in which the robot is drawn, m and rad: smaller than a dot, and larger than the noise of an estimator, which would change
/// cells of a robot that stands.
const SMALLEST_LENGTH: f64 = 0.005;
const SMALLEST_ANGLE: f64 = 0.01;

fn steady(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

/// Place and heading of a robot on the ground at the begin of a trial: the frame of the picture, x forward, z up.
struct Start {
    x_world: f64,
    y_world: f64,
    yaw: f64,
}

impl Start {
    fn of(sample: &ChartSample) -> Start {
        let [x_world, y_world] = sample.position_world.map(f64::from);
        Start { x_world, y_world, yaw: f64::from(sample.yaw) }
    }

    /// The present place, rounded: a robot that stands does not move in the picture.
    fn present(tick: &Tick) -> Start {
        let position = tick.estimate.position_world;
        let [x_world, y_world] = [position.x, position.y].map(|value| steady(value, 0.1));
        Start { x_world, y_world, yaw: steady(tick.estimate.roll_pitch_yaw.z, 0.1) }
    }

    /// A place of the world in the picture's frame, m.
    fn place(&self, x_world: f64, y_world: f64, z_world: f64) -> Vector3<f64> {
        let from_start = Vector3::new(x_world - self.x_world, y_world - self.y_world, z_world);
        Rotation3::from_axis_angle(&Vector3::z_axis(), -self.yaw) * from_start
    }

    fn place_of(&self, sample: &ChartSample) -> Vector3<f64> {
        let [x, y] = sample.position_world;
        self.place(x.into(), y.into(), sample.height.into())
    }
}

/// What the picture shows beside the robot, in its frame.
struct Scene {
    start: Start,
    /// The trunk since the impulse began; empty without a trial.
    path: Vec<Vector3<f64>>,
    /// Displacement of the best trial.
    best: Option<Vector3<f64>>,
    /// Highest trunk of the best trial over the ground, m; 0 without one.
    apex: f64,
}

impl Scene {
    fn of(model: &Model) -> Scene {
        let tick = &model.snapshot.tick;
        let trial = tick.trial.or_else(|| model.session.under_review().map(|trial| trial.trial));
        let trace = trial.and_then(|trial| model.history.trace(trial)).and_then(from_impulse);
        let best = model.session.trials.best().and_then(|best| model.history.trace(best.trial)).and_then(from_impulse);
        let apex = best.into_iter().flatten().map(|sample| f64::from(sample.height)).fold(0.0, f64::max);
        let best = best.and_then(|trace| Some(Start::of(trace.first()?).place_of(trace.last()?)));
        let present = Start::present(tick);
        let start = trace.and_then(|trace| trace.first()).map(Start::of);
        let near = |start: &Start| (start.x_world - present.x_world).hypot(start.y_world - present.y_world) < CARRIED;
        match (start.filter(near), trace) {
            (Some(start), Some(trace)) => {
                let path = trace.iter().step_by(PATH_STEP).map(|sample| start.place_of(sample)).collect();
                Scene { start, path, best, apex }
            }
            _ => Scene { start: present, path: Vec::new(), best, apex },
        }
    }
}

/// The samples since the impulse began.
fn from_impulse(trace: &[ChartSample]) -> Option<&[ChartSample]> {
    let begun = &trace[trace.partition_point(|sample| sample.trial_time_s < 0.0)..];
    (!begun.is_empty()).then_some(begun)
}

/// A camera that looks at a point of the picture's frame.
struct Camera {
    target: Vector3<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
    forward: Vector3<f64>,
    distance: f64,
}

impl Camera {
    fn at(target: Vector3<f64>, half_width: f64) -> Camera {
        let level = Vector3::new(AZIMUTH.sin(), AZIMUTH.cos(), 0.0);
        let forward = level * ELEVATION.cos() - Vector3::z() * ELEVATION.sin();
        let right = level.cross(&Vector3::z());
        Camera { target, right, up: right.cross(&forward), forward, distance: DISTANCE * half_width }
    }

    /// Right and up in the plane of the target, m; none behind the camera.
    fn project(&self, point: &Vector3<f64>) -> Option<Point2<f64>> {
        let from_target = point - self.target;
        let depth = self.distance + self.forward.dot(&from_target);
        let scale = self.distance / depth;
        (depth > 0.1).then(|| Point2::new(scale * self.right.dot(&from_target), scale * self.up.dot(&from_target)))
    }
}

/// The area of the picture with its camera.
struct Canvas<'a> {
    area: Rect,
    theme: &'a Theme,
    camera: Camera,
    /// Columns for a metre in the plane of the target; a row is as high as two columns are wide.
    per_metre: f64,
}

impl Canvas<'_> {
    /// Draws lines, of whose dots every `step`-th is set, over what is there.
    fn lines(&self, frame: &mut Frame, role: Role, step: usize, lines: &[[Vector3<f64>; 2]]) {
        let mut dots = DotGrid::new(self.area, self.theme.glyphs);
        for [from, to] in lines {
            if let (Some(from), Some(to)) = (self.place(from, dots.size), self.place(to, dots.size)) {
                dots.dotted(from, to, step);
            }
        }
        // Over other lines: nothing of their style stays.
        dots.draw(frame.buffer_mut(), self.area, Style::reset().patch(self.theme.style(role)));
    }

    /// Writes a character at a place.
    fn mark(&self, frame: &mut Frame, role: Role, at: &Vector3<f64>, character: char) {
        let size = (usize::from(self.area.width), usize::from(self.area.height));
        let Some((x, y)) = self.place(at, size) else { return };
        let inside = x >= 0.0 && y >= 0.0 && x < f64::from(self.area.width) && y < f64::from(self.area.height);
        let cell = (self.area.x.saturating_add(x as u16), self.area.y.saturating_add(y as u16));
        if let Some(cell) = frame.buffer_mut().cell_mut(cell).filter(|_| inside) {
            cell.set_char(character).set_style(Style::reset().patch(self.theme.style(role)));
        }
    }

    /// The place of a point in a grid of `size` over the area.
    fn place(&self, point: &Vector3<f64>, size: (usize, usize)) -> Option<(f64, f64)> {
        let at = self.camera.project(point)?;
        let (width, height) = (f64::from(self.area.width), 2.0 * f64::from(self.area.height));
        let x = (0.5 * width + at.x * self.per_metre) / width * size.0 as f64;
        let y = (0.5 * height - at.y * self.per_metre) / height * size.1 as f64;
        Some((x, y))
    }
}

pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let (theme, tick) = (&model.theme, &model.snapshot.tick);
    let contacts =
        Leg::ALL.map(|leg| format!("{}{}", leg.name(), theme.contact_indicator(tick.estimate.contact[leg as usize])));
    let area = heading(frame, area, theme, "Robot", &contacts.join(" "));
    let Some(robot) = &model.robot else { return };
    if area.height < 4 || area.width < 20 {
        return;
    }
    let scene = Scene::of(model);
    let jump = framed_jump(&scene, model.session.info.task);
    let half_width = REACH + jump.xy().norm() / 2.0;
    let top = TOP.max(scene.apex + ABOVE_TRUNK);
    let target = Vector3::new(jump.x / 2.0, jump.y / 2.0, (top + BOTTOM) / 2.0);
    let (width, height) = (f64::from(area.width), 2.0 * f64::from(area.height));
    let per_metre = (width / (2.0 * half_width)).min(height / (top - BOTTOM));
    let canvas = Canvas { area, theme, camera: Camera::at(target, half_width), per_metre };

    canvas.lines(frame, Role::Quiet, 4, &ground(&jump));
    let rpy = tick.estimate.roll_pitch_yaw.map(|angle| steady(angle, SMALLEST_ANGLE));
    let turned = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z - scene.start.yaw);
    let position = tick.estimate.position_world.map(|length| steady(length, SMALLEST_LENGTH));
    let trunk = scene.start.place(position.x, position.y, position.z);
    let of_body = |point: Vector3<f64>| turned * point + trunk;
    let legs_of = |legs: [Leg; 2]| -> Vec<[Vector3<f64>; 2]> {
        let angles = |leg| leg_of(&tick.state.joint_position_rad, leg).map(|angle| steady(angle, SMALLEST_ANGLE));
        let points = legs.map(|leg| leg_points(robot, leg, &angles(leg as usize)));
        points.iter().flat_map(|leg| leg.windows(2).map(|pair| [of_body(pair[0]), of_body(pair[1])])).collect()
    };
    canvas.lines(frame, Role::Quiet, 1, &legs_of([Leg::FL, Leg::RL]));
    let path: Vec<_> = scene.path.iter().map(|point| [*point, *point]).collect();
    canvas.lines(frame, Role::SeriesB, 1, &path);
    canvas.lines(frame, Role::SeriesA, 1, &trunk_edges(robot).map(|edge| edge.map(of_body)));
    canvas.lines(frame, Role::Text, 1, &legs_of([Leg::FR, Leg::RR]));
    let on_ground = |point: &Vector3<f64>| Vector3::new(point.x, point.y, 0.0);
    if let Some(best) = &scene.best {
        canvas.mark(frame, Role::Good, &on_ground(best), 'o');
    }
    if let Some(landed) = scene.path.last().filter(|_| tick.trial.is_none()) {
        canvas.mark(frame, Role::Key, &on_ground(landed), 'x');
    }
}

/// The displacement for which there is room in the picture: of the best trial, before there is one a usual one, or of the present
/// trial if that is longer.
fn framed_jump(scene: &Scene, task: Option<Task>) -> Vector3<f64> {
    let usual = match task {
        Some(Task::Forward) => Vector3::new(0.5, 0.0, 0.0),
        Some(Task::LateralLeft) => Vector3::new(0.0, 0.3, 0.0),
        Some(Task::LateralRight) => Vector3::new(0.0, -0.3, 0.0),
        Some(Task::TwistCcw | Task::TwistCw) | None => Vector3::zeros(),
    };
    let expected = scene.best.unwrap_or(usual);
    let present = scene.path.last().copied().unwrap_or_default();
    if present.xy().norm() > expected.xy().norm() { present } else { expected }
}

/// Hip, thigh joint, knee and foot of a leg in the body frame, m: the forward kinematics with the links beyond a joint
/// left out.
fn leg_points(robot: &RobotDescription, leg: Leg, q: &Vector3<f64>) -> [Vector3<f64>; 4] {
    let geometry = &robot.leg_geometry;
    let hip = robot.legs[leg as usize].joint_origin[0];
    let end = |thigh, calf| hip + LegGeometry { thigh, calf, ..*geometry }.foot(q, leg.left_sign()).position_leg;
    [hip, end(0.0, 0.0), end(geometry.thigh, 0.0), end(geometry.thigh, geometry.calf)]
}

/// The edges of the trunk's box in the body frame, and a cross on its front. Without a box, of the plane of the hips.
fn trunk_edges(robot: &RobotDescription) -> [[Vector3<f64>; 2]; 14] {
    let shape = robot.trunk.collision.iter().find_map(|shape| match shape {
        CollisionShape::Box { center, rotation, half_extents } => Some((*center, *rotation, *half_extents)),
        _ => None,
    });
    let hip = robot.legs[Leg::FL as usize].joint_origin[0];
    let flat = || (Vector3::zeros(), nalgebra::Matrix3::identity(), Vector3::new(hip.x, hip.y, 0.0));
    let (center, rotation, half) = shape.unwrap_or_else(flat);
    let corner = |x: f64, y: f64, z: f64| center + rotation * half.component_mul(&Vector3::new(x, y, z));
    let ends = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    std::array::from_fn(|edge| {
        let (a, b) = ends[edge % 4];
        match edge / 4 {
            0 => [corner(-1.0, a, b), corner(1.0, a, b)],
            1 => [corner(a, -1.0, b), corner(a, 1.0, b)],
            2 => [corner(a, b, -1.0), corner(a, b, 1.0)],
            // The diagonals of the front.
            _ => [corner(1.0, a, -1.0), corner(1.0, -a, 1.0)]
                .map(|end| if edge == 12 { end } else { mirrored(end, &center) }),
        }
    })
}

/// The point on the other side of the middle plane of the trunk.
fn mirrored(point: Vector3<f64>, center: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(point.x, 2.0 * center.y - point.y, point.z)
}

/// Lines on the ground around a jump.
fn ground(jump: &Vector3<f64>) -> Vec<[Vector3<f64>; 2]> {
    let range = |end: f64| ((end.min(0.0) / GRID).floor() - 1.0, (end.max(0.0) / GRID).ceil() + 1.0);
    let ((left, right), (near, far)) = (range(jump.x), range(jump.y));
    let steps = |from: f64, to: f64| (from as i64..=to as i64).map(|index| index as f64 * GRID);
    let along = steps(near, far).map(|y| [Vector3::new(left * GRID, y, 0.0), Vector3::new(right * GRID, y, 0.0)]);
    let across = steps(left, right).map(|x| [Vector3::new(x, near * GRID, 0.0), Vector3::new(x, far * GRID, 0.0)]);
    along.chain(across).collect()
}
