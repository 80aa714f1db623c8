//! Description of one robot: bodies, joints, limits, poses. Read from a folder `robots/<name>/` with a URDF (bodies,
//! joints, limits, collision shapes) and a `robot.toml` (all else).
//!
//! Any quadruped with three joints per leg is accepted. Names have no meaning: the root of the URDF is the trunk, its
//! four chains of three revolute joints are the legs, identified by the position of the hip (front or rear, left or
//! right).

mod draft;
mod files;
mod urdf;
mod urdf_checks;

use std::path::PathBuf;

use nalgebra::{Isometry3, Matrix3, Vector3};

pub use draft::Draft;
pub use files::{LARGEST_FILE, RobotFiles, read_text, read_text_within};

use super::kinematics::LegGeometry;
use super::{JOINTS, Joints, PerLeg};

/// One rigid body. Frames are parallel to the body frame at zero joint angles.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidBody {
    /// Link name, for example `FR_thigh`.
    pub name: String,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the link's frame, m.
    pub com: Vector3<f64>,
    /// Rotational inertia about the centre of mass in link axes, kg m^2.
    pub inertia_com: Matrix3<f64>,
    /// Shapes that can touch the ground, in the link's frame, without the foot's sphere.
    pub collision: Vec<CollisionShape>,
}

/// A collision shape in the frame of its link, lengths in m; `rotation` takes the axes of the shape to link axes.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the doc of the type describes the fields")]
pub enum CollisionShape {
    /// A sphere.
    Sphere { center: Vector3<f64>, radius: f64 },
    /// A box.
    Box { center: Vector3<f64>, rotation: Matrix3<f64>, half_extents: Vector3<f64> },
    /// A cylinder along its own z axis.
    Cylinder { center: Vector3<f64>, rotation: Matrix3<f64>, radius: f64, half_length: f64 },
}

/// One leg: three bodies and their joints.
#[derive(Debug, Clone, PartialEq)]
pub struct LegDescription {
    /// Hip, thigh and calf; the foot's mass is part of the calf.
    pub bodies: [RigidBody; 3],
    /// Origin of each joint in its parent's frame, m.
    pub joint_origin: [Vector3<f64>; 3],
    /// Centre of the foot in the calf's frame, m.
    pub foot_origin: Vector3<f64>,
    /// Radius of the foot, m.
    pub foot_radius: f64,
}

/// A link of the URDF with the joint to its parent, for viewers: links that are fixed to another one included.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkFrame {
    /// Name of the link.
    pub name: String,
    /// Name of the parent link.
    pub parent: String,
    /// Frame at joint angle zero in the parent's frame.
    pub origin: Isometry3<f64>,
    /// Joint that turns it, in motor order; none for a fixed one.
    pub joint: Option<usize>,
}

/// Hard limits of the twelve joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Lowest angles, rad.
    pub min_position: Joints,
    /// Highest angles, rad.
    pub max_position: Joints,
    /// Largest absolute torques, N m.
    pub max_torque: Joints,
    /// Largest absolute velocities (no-load speed of the motor), rad/s.
    pub max_velocity: Joints,
}

/// Constants of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotDescription {
    /// Name, for example `go1`.
    pub name: String,
    /// The floating base.
    pub trunk: RigidBody,
    /// Legs in the order FR, FL, RR, RL.
    pub legs: PerLeg<LegDescription>,
    /// Lengths for the closed-form leg kinematics, the same for all legs.
    pub leg_geometry: LegGeometry,
    /// Hard limits.
    pub limits: JointLimits,
    /// Joint angles that the maker's controller library allows: hip, thigh, calf, `[lowest, highest]`, rad; none if
    /// unknown.
    pub maker_limits: Option<[[f64; 2]; 3]>,
    /// Joint angles of the robot folded on the floor, rad: start of standing up and end of sitting down.
    pub lying_position: Joints,
    /// Inertia of each motor's rotor at the joint (gear ratio squared times rotor inertia), kg m^2.
    pub rotor_inertia: Joints,
    /// Largest torque that a file may allow a motor of this robot on hardware, N m.
    pub largest_torque_n_m: f64,
    /// Position of the inertial unit, trunk frame, m; its axes are the trunk's.
    pub imu_origin: Vector3<f64>,
    /// Names of the joints in the URDF.
    pub joint_names: [String; JOINTS],
    /// All links but the trunk, each after its parent.
    pub links: Vec<LinkFrame>,
    /// Name and text of the files: `robot.toml` and the URDF.
    pub files: Vec<(String, String)>,
}

impl RobotDescription {
    /// Total mass, kg.
    pub fn total_mass(&self) -> f64 {
        self.trunk.mass + self.legs.iter().flat_map(|leg| &leg.bodies).map(|body| body.mass).sum::<f64>()
    }

    /// Whether this and `other` are the same robot. Only the texts of the files may differ: comments, appearance and network are not
    /// in the other fields.
    pub fn is_same_robot(&self, other: &RobotDescription) -> bool {
        let without_files = |robot: &RobotDescription| RobotDescription { files: Vec::new(), ..robot.clone() };
        without_files(self) == without_files(other)
    }

    /// Returns name and text of the URDF.
    pub fn urdf(&self) -> Option<(&str, &str)> {
        self.files.iter().find(|(name, _)| name != "robot.toml").map(|(name, text)| (name.as_str(), text.as_str()))
    }

    /// Lowest and highest joint angles that a controller may command, rad: allowed by the URDF and by the maker's
    /// library.
    pub fn allowed_positions(&self) -> (Joints, Joints) {
        let (mut lowest, mut highest) = (self.limits.min_position, self.limits.max_position);
        if let Some(maker) = self.maker_limits {
            for i in 0..JOINTS {
                let [low, high] = maker[i % 3];
                lowest[i] = lowest[i].max(low);
                highest[i] = highest[i].min(high);
            }
        }
        (lowest, highest)
    }
}

/// Error in a robot's description.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum DescriptionError {
    /// No embedded robot has that name.
    #[error("no robot named \"{name}\" is built in (built in: {known}); give the folder of its robot.toml instead")]
    Unknown { name: String, known: String },
    /// A file cannot be read.
    #[error("{}: cannot be read: {reason}", file.display())]
    Read { file: PathBuf, reason: String },
    /// Syntax error in TOML or XML, or a missing or unknown key.
    #[error("{}: {reason}", file.display())]
    Syntax { file: PathBuf, reason: String },
    /// A value or the structure is impossible for a quadruped.
    #[error("{}: {element}: {problem}; {remedy}", file.display())]
    Invalid { file: PathBuf, element: String, problem: String, remedy: &'static str },
}
