//! Stances in which the robot kneels: sagged under its weight, thigh or calf touch the ground before the foot.

use nalgebra::{Rotation3, Vector3};

use crate::robot::description::{CollisionShape, RobotDescription};
use crate::robot::{GRAVITY, LEGS, Leg};

/// Returns the height of the lowest point of thighs and calves above the ground, m, on level ground with the feet at `stance_leg` in
/// the leg frames (y mirrored for right legs) less the sag m g / (4 kp), stiffness `kp` in N/m; negative if they would be in the ground, or
/// if the legs cannot fold so far.
pub(super) fn clearance_m(robot: &RobotDescription, stance_leg: &Vector3<f64>, kp: f64) -> f64 {
    let sag = robot.total_mass() * GRAVITY / (LEGS as f64 * kp);
    let clearances = Leg::ALL.map(|leg| {
        let foot_leg = leg.mirrored(&(stance_leg + Vector3::new(0.0, 0.0, sag)));
        let Ok(q) = robot.leg_geometry.inverse(&foot_leg, leg.left_sign()) else { return -sag };
        let part = &robot.legs[leg as usize];
        let hip = Rotation3::from_axis_angle(&Vector3::x_axis(), q.x);
        let thigh = hip * Rotation3::from_axis_angle(&Vector3::y_axis(), q.y);
        let calf = thigh * Rotation3::from_axis_angle(&Vector3::y_axis(), q.z);
        let thigh_origin = hip * part.joint_origin[1];
        let calf_origin = thigh_origin + thigh * part.joint_origin[2];
        let ground = (calf_origin + calf * part.foot_origin).z - part.foot_radius;
        let lowest = |link: usize, origin: Vector3<f64>, rotation: Rotation3<f64>| {
            let shapes = part.bodies[link].collision.iter();
            shapes.map(|shape| origin.z + lowest_m(shape, &rotation)).fold(f64::INFINITY, f64::min)
        };
        lowest(1, thigh_origin, thigh).min(lowest(2, calf_origin, calf)) - ground
    });
    clearances.into_iter().fold(f64::INFINITY, f64::min)
}

/// Height of the lowest point of `shape` above its link's origin, m, for the link's `rotation`.
fn lowest_m(shape: &CollisionShape, rotation: &Rotation3<f64>) -> f64 {
    let up_link = rotation.inverse() * Vector3::z();
    match shape {
        CollisionShape::Sphere { center, radius } => up_link.dot(center) - radius,
        CollisionShape::Box { center, rotation, half_extents } => {
            up_link.dot(center) - (rotation.transpose() * up_link).abs().dot(half_extents)
        }
        CollisionShape::Cylinder { center, rotation, radius, half_length } => {
            let up = rotation.transpose() * up_link;
            up_link.dot(center) - up.z.abs() * half_length - up.xy().norm() * radius
        }
    }
}
