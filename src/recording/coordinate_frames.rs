//! The robot as frames, for viewers in three dimensions: the world, the trunk and every other link of the URDF by its name.

use foxglove::messages::{FrameTransform, FrameTransforms, Pose, PoseInFrame, Quaternion, Vector3 as Vector};
use nalgebra::{UnitQuaternion, Vector3};

use super::tick::timestamp;
use super::wire::to_single_precision;
use crate::robot::JOINT_NAMES;
use crate::robot::description::RobotDescription;
use crate::telemetry::Tick;

/// Name of the world's frame.
pub const WORLD: &str = "world";

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
        frame_id: WORLD.into(),
        pose: Some(pose_of(&position, &orientation)),
    }
}

/// Returns the frames of the trunk and of every other link of the URDF, each in its parent's.
pub fn transforms(tick: &Tick, robot: &RobotDescription, log_time: u64) -> FrameTransforms {
    let frame =
        |parent: &str, child: &str, translation: &Vector3<f64>, rotation: &UnitQuaternion<f64>| FrameTransform {
            timestamp: Some(timestamp(log_time)),
            parent_frame_id: parent.into(),
            child_frame_id: child.into(),
            translation: Some(vector(translation)),
            rotation: Some(quaternion(rotation)),
        };
    let (position, orientation) = base(tick);
    let mut transforms = vec![frame(WORLD, &robot.trunk.name, &position, &orientation)];
    transforms.extend(robot.links.iter().map(|link| {
        let turned = link.joint.map_or_else(UnitQuaternion::identity, |joint| {
            // Hip about x, thigh and calf about y.
            let axis = if joint % JOINT_NAMES.len() == 0 { Vector3::x_axis() } else { Vector3::y_axis() };
            UnitQuaternion::from_axis_angle(&axis, tick.state.joint_position_rad[joint])
        });
        frame(&link.parent, &link.name, &link.origin.translation.vector, &(link.origin.rotation * turned))
    }));
    FrameTransforms { transforms }
}

pub fn pose_of(position: &Vector3<f64>, orientation: &UnitQuaternion<f64>) -> Pose {
    Pose { position: Some(vector(position)), orientation: Some(quaternion(orientation)) }
}

pub fn vector(v: &Vector3<f64>) -> Vector {
    let [x, y, z] = v.data.0[0].map(to_single_precision);
    Vector { x, y, z }
}

fn quaternion(q: &UnitQuaternion<f64>) -> Quaternion {
    let [x, y, z, w] = q.coords.data.0[0].map(to_single_precision);
    Quaternion { x, y, z, w }
}
