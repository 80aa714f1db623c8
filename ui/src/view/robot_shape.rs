//! The robot as lines in the frame of its body.

use nalgebra::Vector3;
use quadfrog::robot::Leg;
use quadfrog::robot::description::{CollisionShape, RobotDescription};
use quadfrog::robot::kinematics::LegGeometry;

/// Hip, thigh joint, knee and foot of a leg in the body frame, m: the forward kinematics with the links beyond a joint
/// left out.
pub fn leg_points(robot: &RobotDescription, leg: Leg, q: &Vector3<f64>) -> [Vector3<f64>; 4] {
    let geometry = &robot.leg_geometry;
    let hip = robot.legs[leg as usize].joint_origin[0];
    let end = |thigh, calf| hip + LegGeometry { thigh, calf, ..*geometry }.foot(q, leg.left_sign()).position_leg;
    [hip, end(0.0, 0.0), end(geometry.thigh, 0.0), end(geometry.thigh, geometry.calf)]
}

/// The edges of the trunk's box in the body frame, and a cross on its front. Without a box, of the plane of the hips.
pub fn trunk_edges(robot: &RobotDescription) -> [[Vector3<f64>; 2]; 14] {
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
