//! The robot as frames, for viewers in three dimensions: world -> base -> hip -> thigh -> calf -> foot.

use foxglove::messages::{FrameTransform, FrameTransforms, Pose, PoseInFrame, Quaternion, Vector3 as Vector};
use nalgebra::{UnitQuaternion, Vector3};

use super::tick::timestamp;
use crate::robot::description::RobotDescription;
use crate::robot::{JOINT_NAMES, Leg};
use crate::telemetry::Tick;

/// Returns the trunk's pose in the world: the simulator's truth, else the estimate.
fn base(tick: &Tick) -> (Vector3<f64>, UnitQuaternion<f64>) {
    match &tick.state.truth {
        Some(truth) => (truth.position_world, truth.world_from_body),
        None => (tick.estimate.position_world, tick.estimate.world_from_body),
    }
}

/// Returns the trunk's pose in the world as a message.
pub fn pose(tick: &Tick, log_time: u64) -> PoseInFrame {
    let (position, orientation) = base(tick);
    PoseInFrame {
        timestamp: Some(timestamp(log_time)),
        frame_id: "world".into(),
        pose: Some(Pose { position: Some(vector(&position)), orientation: Some(quaternion(&orientation)) }),
    }
}

/// Returns seventeen frames: the trunk and, of each leg, hip, thigh, calf and foot.
pub fn transforms(tick: &Tick, robot: &RobotDescription, log_time: u64) -> FrameTransforms {
    let frame =
        |parent: String, child: String, translation: &Vector3<f64>, rotation: &UnitQuaternion<f64>| FrameTransform {
            timestamp: Some(timestamp(log_time)),
            parent_frame_id: parent,
            child_frame_id: child,
            translation: Some(vector(translation)),
            rotation: Some(quaternion(rotation)),
        };
    let (position, orientation) = base(tick);
    let mut transforms = vec![frame("world".into(), "base".into(), &position, &orientation)];
    for leg in Leg::ALL {
        let link = |name: &str| format!("{}_{name}", leg.name());
        let description = &robot.legs[leg as usize];
        let mut parent = String::from("base");
        for (joint, name) in JOINT_NAMES.iter().enumerate() {
            // Hip about x, thigh and calf about y.
            let axis = if joint == 0 { Vector3::x_axis() } else { Vector3::y_axis() };
            let angle = tick.state.joint_position_rad[3 * leg as usize + joint];
            let rotation = UnitQuaternion::from_axis_angle(&axis, angle);
            transforms.push(frame(parent, link(name), &description.joint_origin[joint], &rotation));
            parent = link(name);
        }
        transforms.push(frame(parent, link("foot"), &description.foot_origin, &UnitQuaternion::identity()));
    }
    FrameTransforms { transforms }
}

fn vector(v: &Vector3<f64>) -> Vector {
    Vector { x: v.x, y: v.y, z: v.z }
}

fn quaternion(q: &UnitQuaternion<f64>) -> Quaternion {
    let q = q.coords;
    Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }
}
