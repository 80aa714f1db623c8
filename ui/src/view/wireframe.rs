//! The robot in perspective, from behind on its right, on the ground where the trial began: near legs bright, far legs dim, the
//! front crossed, the paths of the trunk and of feet in the air, and where this and the best trial landed.

use nalgebra::{Point2, UnitQuaternion, Vector3};
use quadfrog::robot::{Leg, leg_of};
use quadfrog::trial::Backend;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;

use super::draw::{NO_STATE, heading, span};
use super::drawing::Drawing;
use super::robot_shape::{leg_points, trunk_edges};
use super::scene::{Scene, steady};
use crate::model::Model;
use crate::model::history::ChartSample;
use crate::theme::Role;

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
/// Steps in which the robot is drawn, m and rad: smaller than a dot, and larger than the noise of an estimator, which would change
/// cells of a robot that stands.
const SMALLEST_LENGTH: f64 = 0.005;
const SMALLEST_ANGLE: f64 = 0.01;

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

/// Collects the picture: lines and marks of the scene, as the camera shows them.
struct Canvas {
    drawing: Drawing,
    camera: Camera,
    /// The width and the height of the area, m in the plane of the target.
    extent_m: (f64, f64),
}

impl Canvas {
    /// Adds lines, of whose dots every `step`-th is set.
    fn lines(&mut self, role: Role, step: usize, lines: &[[Vector3<f64>; 2]]) {
        let placed = |[from, to]: &[Vector3<f64>; 2]| Some([self.place(from)?, self.place(to)?]);
        let lines = lines.iter().filter_map(placed).collect();
        self.drawing.lines(role, step, lines);
    }

    /// Adds a character at a place.
    fn mark(&mut self, role: Role, at: &Vector3<f64>, character: char) {
        if let Some(at) = self.place(at) {
            self.drawing.mark(role, at, character);
        }
    }

    /// The place of a point in shares of the area.
    fn place(&self, point: &Vector3<f64>) -> Option<Point2<f64>> {
        let at = self.camera.project(point)?;
        Some(Point2::new(0.5 + at.x / self.extent_m.0, 0.5 - at.y / self.extent_m.1))
    }
}

/// The part of the panel below its heading, where the picture is; none without room.
pub fn picture_area(panel: Rect) -> Option<Rect> {
    let area = Rect { y: panel.y.saturating_add(1), height: panel.height.saturating_sub(1), ..panel };
    (area.height >= 4 && area.width >= 20).then_some(area)
}

pub fn render(frame: &mut Frame, panel: Rect, model: &Model) {
    let (theme, tick) = (&model.theme, &model.snapshot.tick);
    let contacts =
        Leg::ALL.map(|leg| format!("{}{}", leg.name(), theme.contact_indicator(tick.estimate.contact[leg as usize])));
    let simulated = model.session.info.backend == Some(Backend::Simulator);
    let contacts = match (model.robot_is_silent(), simulated && ChartSample::from(tick).is_before_footing()) {
        (true, _) => String::new(),
        (false, true) => "being placed".to_owned(),
        (false, false) => contacts.join(" "),
    };
    // The charts beside it show another time.
    let past = model.landed().is_some() || model.live.frozen.is_some() || model.live.comparison.is_some();
    heading(frame, panel, theme, if past { "Robot now" } else { "Robot" }, &contacts);
    let Some(area) = picture_area(panel) else { return };
    if model.robot_is_silent() {
        frame.render_widget(Line::from(span(theme, Role::Quiet, NO_STATE)), area);
    }
    if let Some(drawing) = drawing(area, 2.0, model) {
        drawing.draw_cells(frame, area, theme);
    }
}

/// The picture for an area whose rows are as high as `row_height` columns are wide; none where the robot is not known or sends no
/// states.
pub fn drawing(area: Rect, row_height: f64, model: &Model) -> Option<Drawing> {
    let (tick, robot) = (&model.snapshot.tick, model.robot.as_ref().filter(|_| !model.robot_is_silent())?);
    let scene = Scene::of(model, robot);
    let trunk = scene.start.place(tick.estimate.position_world).map(|length| steady(length, SMALLEST_LENGTH));
    let jump = scene.framed_jump(model.session.info.task, &trunk);
    let half_width = REACH + jump.xy().norm() / 2.0;
    let top = TOP.max(scene.apex + ABOVE_TRUNK);
    let target = Vector3::new(jump.x / 2.0, jump.y / 2.0, (top + BOTTOM) / 2.0);
    let (width, height) = (f64::from(area.width), row_height * f64::from(area.height));
    // Columns for a metre in the plane of the target.
    let per_metre = (width / (2.0 * half_width)).min(height / (top - BOTTOM));
    let camera = Camera::at(target, half_width);
    let mut canvas = Canvas { drawing: Drawing::default(), camera, extent_m: (width / per_metre, height / per_metre) };

    canvas.lines(Role::Quiet, 4, &scene.floor_lines(&jump));
    canvas.lines(Role::Quiet, 2, &scene.box_lines(&jump));
    let rpy = tick.estimate.roll_pitch_yaw.map(|angle| steady(angle, SMALLEST_ANGLE));
    let turned = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z - scene.start.yaw);
    let of_body = |point: Vector3<f64>| turned * point + trunk;
    let legs_of = |legs: [Leg; 2]| -> Vec<[Vector3<f64>; 2]> {
        let angles = |leg| leg_of(&tick.state.joint_position_rad, leg).map(|angle| steady(angle, SMALLEST_ANGLE));
        let points = legs.map(|leg| leg_points(robot, leg, &angles(leg as usize)));
        points.iter().flat_map(|leg| leg.windows(2).map(|pair| [of_body(pair[0]), of_body(pair[1])])).collect()
    };
    let dots = |points: &[Vector3<f64>]| -> Vec<_> { points.iter().map(|point| [*point, *point]).collect() };
    canvas.lines(Role::Quiet, 1, &legs_of([Leg::FL, Leg::RL]));
    canvas.lines(Role::Ghost, 1, &dots(&scene.feet));
    canvas.lines(Role::SeriesB, 1, &dots(&scene.path));
    canvas.lines(Role::SeriesA, 1, &trunk_edges(robot).map(|edge| edge.map(of_body)));
    canvas.lines(Role::Text, 1, &legs_of([Leg::FR, Leg::RR]));
    if let Some(best) = &scene.best {
        canvas.mark(Role::Good, &scene.floor(best.x, best.y), 'o');
    }
    if let Some(landed) = scene.path.last().filter(|_| tick.trial.is_none()) {
        canvas.mark(Role::Key, &scene.floor(landed.x, landed.y), 'x');
    }
    Some(canvas.drawing)
}
