//! From the files of a robot's folder, or the copies in the program, to a description.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::Deserialize;

use super::{RobotDescription, urdf};
use crate::robot::go1::Network;
use crate::robot::{JOINTS, Joints, Leg};

/// The robots that the program carries: name, `robot.toml`, URDF.
const EMBEDDED: &[(&str, &str, &str)] = &[
    ("go1", include_str!("../../../robots/go1/robot.toml"), include_str!("../../../robots/go1/go1.urdf")),
    ("a1", include_str!("../../../robots/a1/robot.toml"), include_str!("../../../robots/a1/a1.urdf")),
];

/// Why a robot's description was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DescriptionError {
    /// No embedded robot has that name.
    #[error("no robot named \"{name}\" is built in (there are: {known}); give the folder of its robot.toml instead")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A file cannot be read.
    #[error("{}: cannot be read: {reason}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        reason: String,
    },
    /// A file is not what its format asks for: TOML or XML syntax, a missing or unknown key.
    #[error("{}: {reason}", file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// What the parser says, with the place.
        reason: String,
    },
    /// A value or the structure is impossible for a quadruped.
    #[error("{}: {element}: {problem}; {remedy}", file.display())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The link, joint or key.
        element: String,
        /// What is wrong, with the value.
        problem: String,
        /// What to do about it.
        remedy: &'static str,
    },
}

/// `robot.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotToml {
    name: String,
    urdf: String,
    motor: MotorToml,
    pose: PoseToml,
    maker_limits: Option<MakerLimitsToml>,
    network: Option<Network>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MotorToml {
    rotor_inertia_kgm2: f64,
    gear_ratio: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MakerLimitsToml {
    hip_rad: [f64; 2],
    thigh_rad: [f64; 2],
    calf_rad: [f64; 2],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseToml {
    lying_rad: [f64; 3],
}

impl RobotDescription {
    /// The names of the robots that the program carries.
    pub fn embedded_names() -> impl Iterator<Item = &'static str> {
        EMBEDDED.iter().map(|(name, ..)| *name)
    }

    /// A robot that the program carries, for example `go1`.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn embedded(name: &str) -> Result<RobotDescription, DescriptionError> {
        let found = EMBEDDED.iter().find(|(known, ..)| *known == name);
        let &(_, toml, urdf) = found.ok_or_else(|| DescriptionError::Unknown {
            name: name.to_owned(),
            known: Self::embedded_names().collect::<Vec<_>>().join(", "),
        })?;
        let folder = Path::new("robots").join(name);
        Self::from_texts(&folder, toml, |_| Ok(urdf.to_owned()))
    }

    /// The robot described in `folder`: its `robot.toml` and the URDF that this names.
    ///
    /// # Errors
    /// When a file is missing or malformed, or describes something other than a quadruped with three joints a leg:
    /// the error names the file, the element, the value and the way out.
    pub fn from_folder(folder: &Path) -> Result<RobotDescription, DescriptionError> {
        let read = |file: PathBuf| {
            std::fs::read_to_string(&file).map_err(|e| DescriptionError::Read { file, reason: e.to_string() })
        };
        let toml = read(folder.join("robot.toml"))?;
        Self::from_texts(folder, &toml, |name| read(folder.join(name)))
    }

    /// Both files as texts; `folder` is for messages.
    fn from_texts(
        folder: &Path,
        toml: &str,
        read_urdf: impl Fn(&str) -> Result<String, DescriptionError>,
    ) -> Result<RobotDescription, DescriptionError> {
        let file = folder.join("robot.toml");
        let robot: RobotToml =
            toml::from_str(toml).map_err(|e| DescriptionError::Syntax { file: file.clone(), reason: e.to_string() })?;
        let invalid = |element: &str, problem: String, remedy| {
            Err(DescriptionError::Invalid { file: file.clone(), element: element.to_owned(), problem, remedy })
        };
        let inertia = robot.motor.rotor_inertia_kgm2;
        if !(inertia.is_finite() && inertia >= 0.0) {
            return invalid("motor.rotor_inertia_kgm2", format!("{inertia} kg m^2"), "give zero or a positive number");
        }
        if let Some(ratio) = robot.motor.gear_ratio.iter().find(|r| !(r.is_finite() && **r > 0.0)) {
            return invalid("motor.gear_ratio", format!("{ratio}"), "give rotor turns per joint turn, more than zero");
        }

        if let Some((element, value, remedy)) = robot.network.and_then(|network| network.problem()) {
            return invalid(element, value, remedy);
        }

        let urdf_text = read_urdf(&robot.urdf)?;
        let parts = urdf::parse(&folder.join(&robot.urdf), &urdf_text)?;

        let mut lying_position = Joints::default();
        let mut rotor_inertia = Joints::default();
        for i in 0..JOINTS {
            let mirror = if i % 3 == 0 { Leg::ALL[i / 3].side() } else { 1.0 };
            lying_position[i] = mirror * robot.pose.lying_rad[i % 3];
            rotor_inertia[i] = inertia * robot.motor.gear_ratio[i % 3].powi(2);
            let (lowest, highest) = (parts.limits.min_position[i], parts.limits.max_position[i]);
            if !(lowest..=highest).contains(&lying_position[i]) {
                let problem = format!("{} rad is outside the joint's limits {lowest}..{highest}", lying_position[i]);
                return invalid("pose.lying_rad", problem, "give hip, thigh and calf of a left leg within them");
            }
        }
        let maker_limits = robot.maker_limits.map(|limits| [limits.hip_rad, limits.thigh_rad, limits.calf_rad]);
        for (i, [low, high]) in maker_limits.iter().flatten().copied().enumerate() {
            let (lowest, highest) = (parts.limits.min_position[i], parts.limits.max_position[i]);
            if !(low.is_finite() && high.is_finite()) || low.max(lowest) >= high.min(highest) {
                let problem = format!("[{low}, {high}] rad leaves nothing of the URDF's {lowest}..{highest}");
                return invalid("maker_limits", problem, "give [lowest, highest] of hip, thigh and calf");
            }
        }
        Ok(RobotDescription {
            name: robot.name,
            maker_limits,
            trunk: parts.trunk,
            legs: parts.legs,
            leg_geometry: parts.leg_geometry,
            limits: parts.limits,
            lying_position,
            rotor_inertia,
            imu_origin: parts.imu_origin.unwrap_or_else(Vector3::zeros),
            network: robot.network,
        })
    }
}
