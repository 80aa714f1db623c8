//! Robot descriptions: the embedded ones, those from a folder, and invalid ones.

use std::path::Path;

use nalgebra::Vector3;
use quadfrog::config::Config;
use quadfrog::robot::description::RobotFiles;
use quadfrog::robot::description::{DescriptionError, Draft, RobotDescription};
use quadfrog::robot::{GRAVITY, JointCommand, Leg, MotorCommand, Placement, Robot};
use quadfrog::sim::{SimConfig, Simulator};

const GO1: &str = include_str!("../../robots/go1/go1.urdf");
const A1: &str = include_str!("../../robots/a1/a1.urdf");
const GO1_TOML: &str = include_str!("../../robots/go1/robot.toml");

/// The message about a robot with these two files.
fn refused(urdf: &str, toml: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("go1.urdf"), urdf).unwrap();
    std::fs::write(folder.path().join("robot.toml"), toml).unwrap();
    RobotDescription::from_folder(folder.path()).unwrap_err().to_string()
}

/// The message about a Go1 with one change in its URDF.
fn refusal(from: &str, to: &str) -> String {
    assert!(GO1.contains(from), "{from}");
    refused(&GO1.replacen(from, to, 1), GO1_TOML)
}

#[test]
fn the_go1_is_what_its_maker_says() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let mass = robot.trunk.mass + robot.legs.iter().flat_map(|leg| &leg.bodies).map(|body| body.mass).sum::<f64>();
    assert!((mass - 13.100528).abs() < 1e-9, "{mass} kg");
    assert_eq!(robot.leg_geometry.abduction, 0.08);
    assert_eq!(robot.leg_geometry.thigh, 0.213);
    assert_eq!(robot.leg_geometry.calf, 0.213);
    assert_eq!(robot.limits.max_torque[2], 35.55);
    assert_eq!(robot.imu_origin, Vector3::new(-0.01592, -0.06659, -0.00617));
    for leg in Leg::ALL {
        let part = &robot.legs[leg as usize];
        assert_eq!(part.bodies[1].name, format!("{}_thigh", leg.name()));
        assert_eq!(part.foot_radius, 0.02);
        assert!(part.bodies.iter().all(|body| body.collision.len() == 1), "the foot's sphere is kept apart");
    }
    assert!((robot.rotor_inertia[0] - 0.0044814).abs() < 1e-6);
}

#[test]
#[expect(clippy::approx_constant, reason = "the maker's figures")]
fn the_go2_is_what_its_maker_says() {
    let robot = RobotDescription::embedded("go2").unwrap();
    assert!((robot.total_mass() - 16.087).abs() < 1e-9, "{} kg", robot.total_mass());
    assert_eq!(robot.leg_geometry.abduction, 0.0955);
    assert_eq!((robot.leg_geometry.thigh, robot.leg_geometry.calf), (0.213, 0.213));
    assert_eq!((robot.limits.max_torque[2], robot.limits.max_velocity[2]), (45.43, 15.7));
    assert_eq!(robot.imu_origin, Vector3::new(-0.02557, 0.0, 0.04232));
    for leg in Leg::ALL {
        let (part, thigh) = (&robot.legs[leg as usize], 3 * leg as usize + 1);
        assert_eq!((part.bodies[1].name.as_str(), part.foot_radius), (&*format!("{}_thigh", leg.name()), 0.022));
        let limits = if leg.front_sign() > 0.0 { (-1.5708, 3.4907) } else { (-0.5236, 4.5379) };
        assert_eq!((robot.limits.min_position[thigh], robot.limits.max_position[thigh]), limits, "{leg:?}");
    }
    assert!((robot.rotor_inertia[2] - 0.016456).abs() < 1e-6);
}

#[test]
fn a_folder_gives_the_same_as_the_embedded_copy() {
    for name in RobotDescription::embedded_names() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots").join(name);
        assert_eq!(RobotDescription::from_folder(&folder).unwrap(), RobotDescription::embedded(name).unwrap());
        let texts = |files: RobotFiles| -> Vec<(String, String)> {
            let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
            files.config().map(|(path, text)| (name(path), text.to_owned())).collect()
        };
        let embedded = texts(RobotFiles::embedded(name).unwrap());
        assert_eq!(texts(RobotFiles::from_folder(&folder).unwrap()), embedded, "{name}");
    }
}

/// The ramp of the joint targets with the gains of the robot's own configuration, from lying to the stance and back.
#[test]
fn every_robot_stands_up_and_sits_down_with_its_own_gains() {
    for name in RobotDescription::embedded_names() {
        let files = RobotFiles::embedded(name).unwrap();
        let (robot, config) = (files.description().unwrap(), Config::load_for(&files, None).unwrap());
        let mut simulator = Simulator::new(&robot, &SimConfig::default()).unwrap();
        simulator.place(&Placement { joint_position: robot.lying_position, lying: true, seed: 0 });
        for _ in 0..1000 {
            simulator.write(&JointCommand::damping(3.0)).unwrap();
        }
        let lying = simulator.state().joint_position;
        let [x, y, z] = config.control.tasks["forward"].stance_m;
        let stance = robot.leg_geometry.stance(&Vector3::new(x, y, z), &robot.lying_position);
        for (what, from, to, ramp) in [
            ("stands up", &lying, &stance, &config.control.stand_up),
            ("sits down", &stance, &robot.lying_position, &config.control.sit_down),
        ] {
            for tick in 0..(1000.0 * (ramp.duration_s + 0.5)) as u32 {
                let share = (f64::from(tick) * 0.001 / ramp.duration_s).min(1.0);
                let target = std::array::from_fn(|i| from[i] + share * (to[i] - from[i]));
                simulator.write(&JointCommand::hold(&target, ramp.kp, ramp.kd)).unwrap();
            }
            let reached = simulator.state().joint_position;
            let error = reached.iter().zip(to).map(|(reached, to)| (reached - to).abs()).fold(0.0, f64::max);
            let truth = simulator.read().unwrap().truth.unwrap();
            let (roll, pitch, _) = truth.world_from_body.euler_angles();
            println!(
                "{name} {what}: {error:.3} rad from the target, height {:.3} m, roll {roll:.3}, pitch {pitch:.3} rad",
                truth.position_world.z
            );
            assert!(error < ramp.tolerance_rad, "{name} {what}: {error} rad");
            assert!(roll.abs() < 0.2 && pitch.abs() < 0.2, "{name} {what}: {roll} {pitch}");
        }
    }
}

/// Every robot lies, stands on its weight, and jumps off the ground.
#[test]
fn every_robot_lies_stands_and_jumps() {
    for name in RobotDescription::embedded_names() {
        let robot = RobotDescription::embedded(name).unwrap();
        let mut simulator = Simulator::new(&robot, &SimConfig::default()).unwrap();
        simulator.place(&Placement { joint_position: robot.lying_position, lying: true, seed: 0 });
        for _ in 0..1000 {
            simulator.write(&JointCommand::damping(3.0)).unwrap();
        }
        let truth = simulator.read().unwrap().truth.unwrap();
        assert!(truth.body_contact && truth.velocity_world.norm() < 0.02, "{name} does not lie still");

        let joint_position = robot.leg_geometry.stance(&Vector3::new(0.0, 0.14, -0.25), &robot.lying_position);
        simulator.place(&Placement { joint_position, lying: false, seed: 0 });
        let command = JointCommand::hold(&joint_position, 100.0, 3.0);
        for _ in 0..2000 {
            simulator.write(&command).unwrap();
        }
        let truth = simulator.read().unwrap().truth.unwrap();
        let force: f64 = truth.foot_force_world.iter().map(|f| f.z).sum();
        assert!((force / (simulator.model().mass() * GRAVITY) - 1.0).abs() < 1e-3, "{name} stands on {force} N");
        assert!(!truth.body_contact && truth.foot_contact == [true; 4]);

        // Feet push straight down: tau = J^T f.
        let (start, mut highest) = (truth.position_world.z, 0.0_f64);
        for tick in 0..600 {
            let mut push = command;
            let q = simulator.state().joint_position;
            for leg in Leg::ALL {
                let i = 3 * leg as usize;
                let foot = robot.leg_geometry.foot(&Vector3::new(q[i], q[i + 1], q[i + 2]), leg.left_sign());
                let torque = foot.jacobian_leg.tr_mul(&Vector3::new(0.0, 0.0, -150.0));
                for (motor, torque) in push.motor[i..i + 3].iter_mut().zip(torque.iter()) {
                    *motor = MotorCommand { torque_n_m: *torque, kd_joint: 0.5, ..MotorCommand::default() };
                }
            }
            simulator.write(if tick < 100 { &push } else { &command }).unwrap();
            highest = highest.max(simulator.state().position_world.z - start);
        }
        println!("{name}: {:.2} kg, jumps {highest:.3} m", simulator.model().mass());
        assert!(highest > 0.2, "{name} rises only {highest} m");
    }
}

#[test]
fn impossible_robots_are_refused_by_name() {
    let message = refusal("<mass value=\"5.561079999999999\"/>", "<mass value=\"0\"/>");
    assert!(message.contains("go1.urdf") && message.contains("trunk") && message.contains("mass 0 kg"), "{message}");
    let message =
        refusal("<geometry><sphere radius=\"0.02\"/></geometry>", "<geometry><box size=\"1 1 1\"/></geometry>");
    assert!(message.contains("FR_calf") && message.contains("no foot"), "{message}");
    let message = refusal("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 1\"/>");
    assert!(message.contains("FR_thigh_joint") && message.contains("axis (0, 0, 1)"), "{message}");
    let message = refusal("lower=\"-0.863\"", "lower=\"0.9\"");
    assert!(message.contains("FR_hip_joint") && message.contains("0.9"), "{message}");
    let message =
        refusal("<joint name=\"FR_hip_joint\" type=\"revolute\">", "<joint name=\"FR_hip_joint\" type=\"fixed\">");
    assert!(message.contains("FR_thigh_joint") && message.contains("where a hip is"), "{message}");
    let message = refusal("<origin xyz=\"0 0 -0.213\" rpy=\"0 0 0\"/>", "<origin xyz=\"0 0 -0.2\" rpy=\"0 0 0\"/>");
    assert!(message.contains("calf joint") && message.contains("alike"), "{message}");
    let message = refusal("<joint name=\"FL_hip_joint\"", "<joint name=\"FR_hip_joint\"");
    assert!(message.contains("joint FR_hip_joint") && message.contains("a second one has this name"), "{message}");
    let message = refusal("<link name=\"FR_foot\">", "<link name=\"FL_foot\">");
    assert!(message.contains("link FL_foot") && message.contains("a second one has this name"), "{message}");
    let message = refusal("<sphere radius=\"0.02\"/>", "<sphere radius=\"0.04\"/>");
    assert!(message.contains("FL foot") && message.contains("its radius is 0.02 m, that of FR 0.04 m"), "{message}");
    let message = refusal("<mass value=\"0.195862\"/>", "<mass value=\"1e-12\"/>");
    assert!(message.contains("FR_calf") && message.contains("weighs 1 g at least"), "{message}");
    let message = refusal(
        "</robot>",
        "<link name=\"base_imu\"/><joint name=\"b\" type=\"fixed\"><parent link=\"trunk\"/><child link=\"base_imu\"/></joint></robot>",
    );
    assert!(message.contains("second inertial unit") && message.contains("imu_link"), "{message}");
    let own = "<link name=\"a\"/><link name=\"b\"/><joint name=\"ab\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
               <joint name=\"ba\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
    let message = refusal("</robot>", own);
    assert!(message.contains("link a") && message.contains("is its own ancestor"), "{message}");
    let message = refusal("</robot>", "");
    assert!(message.contains("go1.urdf"), "{message}");

    let error = RobotDescription::embedded("spot").unwrap_err();
    assert!(matches!(error, DescriptionError::Unknown { .. }) && error.to_string().contains("go1"));
    let missing = RobotDescription::from_folder(Path::new("/nowhere")).unwrap_err();
    assert!(matches!(missing, DescriptionError::Read { .. }));
    assert!(refused(GO1, &GO1_TOML.replace("gear_ratio", "gear_ration")).contains("gear_ration"));
    assert!(refused(GO1, &GO1_TOML.replace("-2.75", "-3.0")).contains("-3 rad"));
}

/// Regression: the name of a link that only contains the letters, as "simulated_camera", made it the inertial unit; a frame that is turned
/// was taken as the trunk's.
#[test]
fn the_inertial_unit_is_the_link_with_that_word_in_its_name() {
    let camera = |name: &str| {
        let joint = format!(
            "<link name=\"{name}\"/><joint name=\"{name}_fixed\" type=\"fixed\"><origin xyz=\"0.3 0 0.1\" rpy=\"0 0 0\"/>"
        );
        GO1.replace("</robot>", &(joint + &format!("<parent link=\"trunk\"/><child link=\"{name}\"/></joint></robot>")))
    };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("go1.urdf"), camera("simulated_camera")).unwrap();
    std::fs::write(folder.path().join("robot.toml"), GO1_TOML).unwrap();
    let robot = RobotDescription::from_folder(folder.path()).unwrap();
    assert_eq!(robot.imu_origin, RobotDescription::embedded("go1").unwrap().imu_origin);
    let at = GO1.find("imu_fixed").unwrap();
    let turned = GO1[..at].to_owned() + &GO1[at..].replacen("rpy=\"0 0 0\"", "rpy=\"3.14159 0 0\"", 1);
    let message = refused(&turned, GO1_TOML);
    assert!(message.contains("imu_link") && message.contains("is turned by 3.14159 rad"), "{message}");
}

/// Regression: the end of a capsule on the calf became the foot, with the capsule's radius: the robot stood on what it took for its shin,
/// and fell.
#[test]
fn the_foot_is_a_sphere_and_not_the_end_of_a_capsule() {
    let capsules = GO1.replace("<box size=\"0.213 0.016 0.016\"/>", "<capsule radius=\"0.008\" length=\"0.22\"/>");
    assert_ne!(capsules, GO1);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("go1.urdf"), capsules).unwrap();
    std::fs::write(folder.path().join("robot.toml"), GO1_TOML).unwrap();
    let robot = RobotDescription::from_folder(folder.path()).unwrap();
    assert!(robot.legs.iter().all(|leg| leg.foot_radius == 0.02), "{:?}", robot.legs[0].foot_radius);
    assert_eq!(robot.leg_geometry.calf, 0.213);
}

/// Regression: a name with a character of no width was written by Rust's rules, and the own file could not be read.
#[test]
fn a_draft_quotes_names_as_toml_does() {
    for name in ["e\u{301}", "a\u{200b}b", "tab\tbed", "\"quoted\""] {
        let draft = Draft::of_urdf(name, Path::new("go1.urdf"), GO1).unwrap();
        assert_eq!(draft.robot.name, name);
    }
}

/// Regression: the URDF was read from there, and the study kept one that its robot.toml did not name.
#[test]
fn a_urdf_that_is_not_beside_robot_toml_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    for name in ["go1.urdf", "sub/go1.urdf"] {
        std::fs::write(folder.path().join(name), GO1).unwrap();
    }
    let absolute = folder.path().join("go1.urdf");
    for name in ["sub/go1.urdf", absolute.to_str().unwrap(), "sub/../go1.urdf", "..", "", "robot.toml"] {
        let toml = GO1_TOML.replacen("urdf = \"go1.urdf\"", &format!("urdf = \"{name}\""), 1);
        assert_ne!(toml, GO1_TOML);
        std::fs::write(folder.path().join("robot.toml"), toml).unwrap();
        let message = RobotDescription::from_folder(folder.path()).unwrap_err().to_string();
        assert!(message.contains(&format!("urdf: \"{name}\"; put the URDF beside robot.toml")), "{message}");
    }
}

/// Regression: `<mimic>` and `<dynamics>` of a leg's joint were left out, and nothing said so.
#[test]
fn a_joint_that_follows_another_is_refused_and_its_friction_is_named_as_unused() {
    let joint = "<axis xyz=\"0 1 0\"/>";
    let message = refusal(joint, &format!("{joint}<mimic joint=\"FR_calf_joint\" multiplier=\"-2\"/>"));
    assert!(message.contains("joint FR_thigh_joint: <mimic> of FR_calf_joint; each joint"), "{message}");
    let drafted = |dynamics: &str| {
        let urdf = GO1.replacen(joint, &format!("{joint}<dynamics {dynamics}/>"), 1);
        Draft::of_urdf("go1", Path::new("go1.urdf"), &urdf).unwrap().missing.join("\n")
    };
    for dynamics in ["damping=\"0.1\"", "friction=\"0.2\""] {
        let missing = drafted(dynamics);
        assert!(missing.contains("<dynamics> (joints: FR_thigh_joint)"), "{missing}");
        assert!(missing.contains("[actuator.hardware_like]"), "{missing}");
    }
    assert!(!drafted("damping=\"0\" friction=\"0\"").contains("<dynamics>"));
}

/// Regression: a joint that no leg reaches could name links that do not exist.
#[test]
fn a_joint_between_links_that_do_not_exist_is_refused() {
    for (parent, child, missing) in
        [("no", "none", "its parent, the link no,"), ("trunk", "none", "its child, the link none,")]
    {
        let joint = format!(
            "<joint name=\"j\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint></robot>"
        );
        let message = refusal("</robot>", &joint);
        assert!(message.contains(&format!("joint j: {missing} does not exist; add the link")), "{message}");
    }
}

/// Regression: the message was about the mass of the link `world`.
#[test]
fn a_link_of_the_world_above_the_trunk_is_refused_with_the_remedy() {
    let world = "<link name=\"world\"/><joint name=\"base\" type=\"floating\"><parent link=\"world\"/><child link=\"trunk\"/></joint></robot>";
    let message = refusal("</robot>", world);
    assert!(message.contains("link world: has no mass, and the floating joint base carries the robot"), "{message}");
    assert!(message.contains("remove this link and its joint, or make the joint fixed"), "{message}");
}

/// Regression: the calf weighed its foot alone, and nothing said so.
#[test]
fn a_calf_without_a_mass_of_its_own_is_named_in_a_draft() {
    let missing = |urdf: &str| Draft::of_urdf("a1", Path::new("a1.urdf"), urdf).unwrap().missing.join("\n");
    assert!(!missing(A1).contains("mass of"));
    let start = A1.find("<link name=\"FR_calf\">").unwrap();
    let (inertial, end) =
        (start + A1[start..].find("<inertial>").unwrap(), start + A1[start..].find("</inertial>").unwrap());
    let without = A1[..inertial].to_owned() + &A1[end + "</inertial>".len()..];
    assert!(missing(&without).contains("mass of FR_calf: without <inertial>"), "{}", missing(&without));
}
