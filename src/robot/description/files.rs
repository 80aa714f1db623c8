//! Reads a robot's description from a folder, or from the copies embedded in the program.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::{DescriptionError, RobotDescription, urdf};
use crate::robot::{JOINTS, Joints, Leg};

/// A robot in the program.
struct EmbeddedRobot {
    name: &'static str,
    toml: &'static str,
    urdf: &'static str,
    /// Name and text of the files in its folder `config`.
    config: &'static [(&'static str, &'static str)],
}

/// Embedded robots.
const EMBEDDED: &[EmbeddedRobot] = &[
    EmbeddedRobot {
        name: "go1",
        toml: include_str!("../../../robots/go1/robot.toml"),
        urdf: include_str!("../../../robots/go1/go1.urdf"),
        config: &[],
    },
    EmbeddedRobot {
        name: "a1",
        toml: include_str!("../../../robots/a1/robot.toml"),
        urdf: include_str!("../../../robots/a1/a1.urdf"),
        config: &[],
    },
    EmbeddedRobot {
        name: "go2",
        toml: include_str!("../../../robots/go2/robot.toml"),
        urdf: include_str!("../../../robots/go2/go2.urdf"),
        config: &[
            ("control.toml", include_str!("../../../robots/go2/config/control.toml")),
            ("optimize.toml", include_str!("../../../robots/go2/config/optimize.toml")),
            ("safety.toml", include_str!("../../../robots/go2/config/safety.toml")),
            ("simulator.toml", include_str!("../../../robots/go2/config/simulator.toml")),
        ],
    },
];

/// `robot.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotToml {
    name: String,
    urdf: String,
    motor: MotorToml,
    pose: PoseToml,
    maker_limits: Option<MakerLimitsToml>,
    /// Read by the modules of the robots' protocols, see `robot::hardware`.
    #[serde(rename = "network")]
    _network: Option<IgnoredAny>,
    dds: Option<IgnoredAny>,
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

/// Folder beside `robot.toml` with the robot's own configuration.
const CONFIG: &str = "config";

/// Largest torque of a motor on hardware, N m: above that of the Go1's calf (35.55), and of the Go2's (45.43), whose `robot.toml`
/// has a section `[dds]`.
const LARGEST_TORQUE_N_M: f64 = 40.0;
const LARGEST_TORQUE_GO2_N_M: f64 = 50.0;

/// Largest angle of a joint's limit, rad: two turns.
const LARGEST_ANGLE_RAD: f64 = 12.6;

/// The files of one robot.
#[derive(Debug, Clone)]
pub struct RobotFiles {
    folder: PathBuf,
    toml: Cow<'static, str>,
    /// Text of the URDF; none for one that is read from the folder.
    urdf: Option<Cow<'static, str>>,
    config: Vec<(PathBuf, Cow<'static, str>)>,
}

impl RobotFiles {
    /// Opens an embedded robot, for example `go1`.
    ///
    /// # Errors
    /// There is none of that name.
    pub fn embedded(name: &str) -> Result<RobotFiles, DescriptionError> {
        let found = EMBEDDED.iter().find(|robot| robot.name == name);
        let robot = found.ok_or_else(|| DescriptionError::Unknown {
            name: name.to_owned(),
            known: RobotDescription::embedded_names().collect::<Vec<_>>().join(", "),
        })?;
        let folder = Path::new("robots").join(name);
        let config = robot.config.iter().map(|(file, text)| (folder.join(CONFIG).join(file), Cow::Borrowed(*text)));
        let config = config.collect();
        Ok(RobotFiles { folder, toml: robot.toml.into(), urdf: Some(robot.urdf.into()), config })
    }

    /// Opens the robot in `folder`: its `robot.toml`, the URDF that `robot.toml` names, and the TOML files of its folder `config`, if
    /// there is one.
    ///
    /// # Errors
    /// `robot.toml`, the folder `config` or a file in it cannot be read.
    pub fn from_folder(folder: &Path) -> Result<RobotFiles, DescriptionError> {
        let toml = read(folder.join("robot.toml"))?.into();
        let files = RobotFiles { folder: folder.to_owned(), toml, urdf: None, config: Vec::new() };
        files.with_config(&folder.join(CONFIG))
    }

    /// Takes the TOML files of `folder`, if there is one, as the robot's own configuration.
    ///
    /// # Errors
    /// The folder or a file in it cannot be read.
    pub fn with_config(self, folder: &Path) -> Result<RobotFiles, DescriptionError> {
        let mut config = Vec::new();
        let unread = |e: io::Error| DescriptionError::Read { file: folder.to_owned(), reason: e.to_string() };
        let entries = match std::fs::read_dir(folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            entries => Some(entries.map_err(unread)?),
        };
        for entry in entries.into_iter().flatten() {
            let path = entry.map_err(unread)?.path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                config.push((path.clone(), read(path)?.into()));
            }
        }
        config.sort();
        Ok(RobotFiles { config, ..self })
    }

    /// Opens the robot of two texts, as a recording has them; `origin` is for messages.
    pub fn from_texts(origin: &Path, toml: String, urdf: String) -> RobotFiles {
        RobotFiles { folder: origin.to_owned(), toml: toml.into(), urdf: Some(urdf.into()), config: Vec::new() }
    }

    /// Opens the folder `model`, if there is one, or the embedded robot of that name. A folder without `robot.toml`, as that of studies,
    /// does not hide an embedded robot.
    ///
    /// # Errors
    /// As of [`RobotFiles::from_folder`] and [`RobotFiles::embedded`].
    pub fn open(model: &str) -> Result<RobotFiles, DescriptionError> {
        let folder = Path::new(model);
        match folder.metadata() {
            Ok(about) if about.is_dir() => match RobotFiles::embedded(model) {
                Ok(embedded) if folder.join("robot.toml").try_exists().is_ok_and(|there| !there) => Ok(embedded),
                _ => RobotFiles::from_folder(folder),
            },
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                Err(DescriptionError::Read { file: folder.to_owned(), reason: error.to_string() })
            }
            _ => RobotFiles::embedded(model),
        }
    }

    /// The robot's own configuration: path and text of files with the names of those of a configuration folder. Their keys replace
    /// the built-in ones.
    pub fn config(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.config.iter().map(|(path, text)| (path.as_path(), text.as_ref()))
    }

    /// Parses `robot.toml`.
    ///
    /// # Errors
    /// The text does not fit `T`.
    pub fn toml<T: DeserializeOwned>(&self) -> Result<T, DescriptionError> {
        toml::from_str(&self.toml)
            .map_err(|e| DescriptionError::Syntax { file: self.toml_file(), reason: e.to_string() })
    }

    /// Error about the key `element` of `robot.toml`.
    pub fn invalid(&self, element: &str, problem: String, remedy: &'static str) -> DescriptionError {
        DescriptionError::Invalid { file: self.toml_file(), element: element.to_owned(), problem, remedy }
    }

    fn toml_file(&self) -> PathBuf {
        self.folder.join("robot.toml")
    }

    /// Reads the description.
    ///
    /// # Errors
    /// A file is missing or malformed, or describes something other than a quadruped with three joints per leg.
    pub fn description(&self) -> Result<RobotDescription, DescriptionError> {
        let robot: RobotToml = self.toml()?;
        let invalid = |element: &str, problem: String, remedy| Err(self.invalid(element, problem, remedy));
        let inertia = robot.motor.rotor_inertia_kgm2;
        if !(0.0..=0.1).contains(&inertia) {
            return invalid("motor.rotor_inertia_kgm2", format!("{inertia} kg m^2"), "give 0 to 0.1 kg m^2");
        }
        if let Some(ratio) = robot.motor.gear_ratio.iter().find(|ratio| !(0.1..=1000.0).contains(*ratio)) {
            return invalid("motor.gear_ratio", format!("{ratio}"), "give 0.1 to 1000 rotor turns per joint turn");
        }

        let file = self.folder.join(&robot.urdf);
        let urdf = match &self.urdf {
            Some(text) => Cow::Borrowed(text.as_ref()),
            // Elsewhere it would be missing beside the copy of robot.toml that a study keeps.
            None if Path::new(&robot.urdf).file_name() != Some(robot.urdf.as_ref()) || robot.urdf == "robot.toml" => {
                return invalid(
                    "urdf",
                    format!("{:?}", robot.urdf),
                    "put the URDF beside robot.toml, and give the name of its file",
                );
            }
            None => read(file.clone())?.into(),
        };
        let parts = urdf::parse(&file, &urdf)?;
        let urdf_name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();

        let mut lying_position = Joints::default();
        let mut rotor_inertia = Joints::default();
        for i in 0..JOINTS {
            let mirror = if i % 3 == 0 { Leg::ALL[i / 3].left_sign() } else { 1.0 };
            lying_position[i] = mirror * robot.pose.lying_rad[i % 3];
            rotor_inertia[i] = inertia * robot.motor.gear_ratio[i % 3].powi(2);
            let (lowest, highest) = (parts.limits.min_position[i], parts.limits.max_position[i]);
            if !(lowest..=highest).contains(&lying_position[i]) {
                let problem = format!("{} rad is outside the joint's limits {lowest}..{highest}", lying_position[i]);
                return invalid("pose.lying_rad", problem, "give hip, thigh and calf of a left leg within them");
            }
        }
        let maker_limits = robot.maker_limits.map(|limits| [limits.hip_rad, limits.thigh_rad, limits.calf_rad]);
        let of_joints = maker_limits.iter().flat_map(|maker| maker.iter().cycle().take(JOINTS));
        for (i, &[low, high]) in of_joints.enumerate() {
            let (lowest, highest) = (parts.limits.min_position[i], parts.limits.max_position[i]);
            let possible = |angle: f64| angle.abs() <= LARGEST_ANGLE_RAD;
            if !(possible(low) && possible(high)) || low.max(lowest) >= high.min(highest) {
                let problem = format!(
                    "[{low}, {high}] rad is not within {LARGEST_ANGLE_RAD}, or has nothing of the URDF's {lowest}..{highest}"
                );
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
            largest_torque_n_m: if robot.dds.is_some() { LARGEST_TORQUE_GO2_N_M } else { LARGEST_TORQUE_N_M },
            imu_origin: parts.imu_origin.unwrap_or_else(Vector3::zeros),
            joint_names: parts.joint_names,
            links: parts.links,
            files: vec![("robot.toml".to_owned(), self.toml.to_string()), (urdf_name, urdf.into_owned())],
        })
    }
}

impl RobotDescription {
    /// Returns the URDF with primitive shapes to look at: a link without a visual shape, or with a mesh as one, has the shapes
    /// of its collision. For viewers, which do not have the files of meshes.
    pub fn urdf_with_visual_shapes(&self) -> Option<String> {
        urdf::with_visual_shapes(self.urdf()?.1)
    }

    /// Names of the embedded robots.
    pub fn embedded_names() -> impl Iterator<Item = &'static str> {
        EMBEDDED.iter().map(|robot| robot.name)
    }

    /// Reads the description of an embedded robot, for example `go1`.
    ///
    /// # Errors
    /// There is none of that name.
    pub fn embedded(name: &str) -> Result<RobotDescription, DescriptionError> {
        RobotFiles::embedded(name)?.description()
    }

    /// Reads the description of the robot in `folder`.
    ///
    /// # Errors
    /// As of [`RobotFiles::description`].
    pub fn from_folder(folder: &Path) -> Result<RobotDescription, DescriptionError> {
        RobotFiles::from_folder(folder)?.description()
    }
}

/// Largest file of a robot or of a configuration, bytes: a hundred times the largest of the repository.
pub const LARGEST_FILE: u64 = 1 << 20;

/// Reads a text file of a description or configuration, of at most [`LARGEST_FILE`] bytes.
///
/// # Errors
/// As of [`read_text_within`].
pub fn read_text(file: &Path) -> io::Result<String> {
    read_text_within(file, LARGEST_FILE, "a description or configuration")
}

/// Reads a text file of at most `largest` bytes, which is the most for `what`.
///
/// # Errors
/// The file cannot be read, is not a regular file (a device may have no end), is larger, or is not UTF-8.
pub fn read_text_within(file: &Path, largest: u64, what: &str) -> io::Result<String> {
    let metadata = std::fs::metadata(file)?;
    if !metadata.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file"));
    }
    let too_large = || {
        let reason = format!("it has more than {largest} bytes, the most for {what}");
        io::Error::new(io::ErrorKind::FileTooLarge, reason)
    };
    if metadata.len() > largest {
        return Err(too_large());
    }
    let mut text = String::new();
    // The file may grow meanwhile, and some of the system's files have no length.
    let read = File::open(file)?.take(largest + 1).read_to_string(&mut text)?;
    if read as u64 > largest { Err(too_large()) } else { Ok(text) }
}

fn read(file: PathBuf) -> Result<String, DescriptionError> {
    read_text(&file).map_err(|e| DescriptionError::Read { file, reason: e.to_string() })
}
