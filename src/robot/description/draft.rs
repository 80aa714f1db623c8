//! First `robot.toml` of a robot of which only the URDF is known.

use std::fmt::Write as _;
use std::path::Path;

use super::{DescriptionError, RobotDescription, RobotFiles, urdf};

/// A draft of `robot.toml`, and what it does not know.
#[derive(Debug, Clone, PartialEq)]
pub struct Draft {
    /// Text of the file.
    pub toml: String,
    /// The robot as the draft describes it.
    pub robot: RobotDescription,
    /// Missing and guessed values, one sentence each, with the remedy.
    pub missing: Vec<String>,
}

/// Margin of the folded calf from its limit, rad.
const FOLDED_MARGIN_RAD: f64 = 0.05;

impl Draft {
    /// Describes the robot `name` by the URDF `text` of the file `urdf`.
    ///
    /// # Errors
    /// The URDF is malformed or describes something other than a quadruped with three joints per leg.
    pub fn of_urdf(name: &str, urdf: &Path, text: &str) -> Result<Draft, DescriptionError> {
        let parts = urdf::parse(urdf, text)?;
        // The left front leg, joints 3 to 5: hip straight down, calf folded, thigh so that the foot is below the hip.
        let within = |joint: usize, angle: f64| {
            let (low, high) = (parts.limits.min_position[joint], parts.limits.max_position[joint]);
            // Rounded for the file, not beyond the limit.
            ((angle.clamp(low, high) * 1000.0).round() / 1000.0).clamp(low, high)
        };
        let (open, folded) = (parts.limits.max_position[5], parts.limits.min_position[5]);
        let calf = if folded.abs() >= open.abs() { folded + FOLDED_MARGIN_RAD } else { open - FOLDED_MARGIN_RAD };
        let lying = [within(3, 0.0), within(4, -calf / 2.0), within(5, calf)];
        let file_name = urdf.file_name().unwrap_or_default().to_string_lossy();
        let mut toml_text = String::new();
        // Quoted as TOML does it.
        let (name, file_name) = (toml::Value::from(name), toml::Value::from(&*file_name));
        let _ = write!(
            toml_text,
            "# Data of a robot beyond its URDF. Units in the names. Written by `quadfrog init`: values marked \"not known\" are to be\n\
             # replaced, each with its source.\n\n\
             name = {name}\n\
             urdf = {file_name}   # bodies, joints, limits, collision shapes; beside this file\n\n\
             [motor]\n\
             rotor_inertia_kgm2 = 0.0            # not known: inertia of one rotor about its own axis\n\
             gear_ratio = [1.0, 1.0, 1.0]        # not known: rotor turns per joint turn of hip, thigh and calf\n\n\
             [pose]\n\
             # Lying folded: hip, thigh and calf of a left leg. Computed from the joint limits: belly and feet must rest on the floor.\n\
             lying_rad = [{:?}, {:?}, {:?}]\n",
            lying[0], lying[1], lying[2]
        );
        let mut missing = vec![
            "[motor]: inertia and gear ratio of the rotors are not in a URDF; with 0 the hardware-like actuators have none".to_owned(),
            "[pose] lying_rad: computed from the joint limits; read the angles of the robot while it lies folded".to_owned(),
            "[maker_limits]: hip_rad, thigh_rad, calf_rad, if the maker's controller allows less than the URDF".to_owned(),
            "[network]: a robot of another protocol than the Go1's needs a module of its own (docs/extend/robot.md)".to_owned(),
        ];
        if parts.imu_origin.is_none() {
            missing.push(
                "the URDF has no link of an inertial unit; its place is taken to be the trunk's origin".to_owned(),
            );
        }
        if parts.trunk.collision.is_empty() {
            missing.push(
                "the trunk has no box, cylinder or sphere as its collision; a mesh cannot touch the ground, and no fall on the trunk is seen"
                    .to_owned(),
            );
        }
        if !parts.massless_links.is_empty() {
            missing.push(format!(
                "mass of {}: without <inertial> each weighs only the links that are fixed to it",
                parts.massless_links.join(", ")
            ));
        }
        if !parts.unused_dynamics.is_empty() {
            missing.push(format!(
                "<dynamics> (joints: {}) is not taken from the URDF; give dry_friction_nm and viscous_friction_nm_s of \
                 [actuator.hardware_like] in simulator.toml",
                parts.unused_dynamics.join(", ")
            ));
        }
        let robot = RobotFiles::from_texts(Path::new(""), toml_text.clone(), text.to_owned()).description()?;
        Ok(Draft { toml: toml_text, robot, missing })
    }
}
