//! The robot as a wireframe, from the side and from above.

use nalgebra::{UnitQuaternion, Vector3};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::kinematics::LegGeometry;
use quadfrog::robot::{LEGS, Leg, leg_of};
use quadfrog::telemetry::Tick;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};

use super::dots::DotGrid;
use super::draw::heading;
use crate::theme::{Role, Theme};

/// Half of the width of a picture, m: the robot with its legs stretched.
const REACH: f64 = 0.45;

/// Hip, thigh joint, knee and foot of a leg in the body frame, m: the forward kinematics with the links beyond a joint
/// left out.
fn leg_points(robot: &RobotDescription, leg: Leg, q: &Vector3<f64>) -> [Vector3<f64>; 4] {
    let geometry = &robot.leg_geometry;
    let hip = robot.legs[leg as usize].joint_origin[0];
    let end = |thigh, calf| hip + LegGeometry { thigh, calf, ..*geometry }.foot(q, leg.left_sign()).position_leg;
    [hip, end(0.0, 0.0), end(geometry.thigh, 0.0), end(geometry.thigh, geometry.calf)]
}

pub fn render(frame: &mut Frame, area: Rect, robot: Option<&RobotDescription>, tick: &Tick, theme: &Theme) {
    let contacts =
        Leg::ALL.map(|leg| format!("{}{}", leg.name(), theme.contact_indicator(tick.estimate.contact[leg as usize])));
    let body = heading(frame, area, theme, "Robot", &contacts.join(" "));
    let Some(robot) = robot else { return };
    if body.height < 4 || body.width < 20 {
        return;
    }
    let [side, above] = Layout::horizontal([Constraint::Fill(1); 2]).spacing(1).areas(body);
    // Without the yaw: the pictures turn with the robot.
    let rpy = tick.estimate.roll_pitch_yaw;
    let tilt = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, 0.0);
    let height = tick.estimate.position_world.z;
    let mut lines: Vec<[Vector3<f64>; 2]> = Vec::with_capacity(4 * LEGS + 5);
    let legs = Leg::ALL
        .map(|leg| leg_points(robot, leg, &leg_of(&tick.state.joint_position_rad, leg as usize)).map(|p| tilt * p));
    for points in &legs {
        lines.extend(points.windows(2).map(|pair| [pair[0], pair[1]]));
    }
    // The trunk: its hips joined around, FR FL RL RR.
    for (from, to) in [(0, 1), (1, 3), (3, 2), (2, 0)] {
        lines.push([legs[from][0], legs[to][0]]);
    }
    draw(frame, side, theme, &lines, |p| (p.x, p.z), Some(-height));
    // From above: forward up, left to the left.
    draw(frame, above, theme, &lines, |p| (-p.y, p.x), None);
}

/// Draws lines projected to (right, up), in m around the trunk; `floor` is the height of the ground there.
fn draw(
    frame: &mut Frame,
    area: Rect,
    theme: &Theme,
    lines: &[[Vector3<f64>; 2]],
    project: impl Fn(&Vector3<f64>) -> (f64, f64),
    floor: Option<f64>,
) {
    let mut dots = DotGrid::new(area, theme.glyphs);
    let (across, down) = (dots.size.0 as f64, dots.size.1 as f64);
    // A character is about twice as high as wide, so the area is `width` by `2 height` in the same unit.
    let (width, height) = (f64::from(area.width), 2.0 * f64::from(area.height));
    let per_metre = (width / (2.0 * REACH)).min(height / (2.0 * REACH));
    // From the side there is more below the trunk than above it.
    let middle = if floor.is_some() { 0.35 } else { 0.5 };
    let place = |(right, up): (f64, f64)| {
        let x = (0.5 * width + right * per_metre) / width * across;
        let y = (middle * height - up * per_metre) / height * down;
        (x, y)
    };
    if let Some(floor) = floor {
        let y = place((0.0, floor)).1 as i64;
        for x in (0..dots.size.0).step_by(3) {
            dots.set(x as i64, y);
        }
    }
    for [from, to] in lines {
        dots.line(place(project(from)), place(project(to)));
    }
    dots.draw(frame.buffer_mut(), area, theme.style(Role::SeriesA));
}
