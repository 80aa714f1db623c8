//! Limits of a URDF as an input: size and nesting of the text before it is parsed, because the parser follows the nesting with
//! its stack; every number finite and of a size that a quadruped can have.

use std::collections::HashSet;

use urdf_rs::{Geometry, Joint, JointType, Link, Pose, Robot};

/// Largest number of elements of the text; the Go1's has 330.
const MOST_ELEMENTS: usize = 20_000;
/// Deepest nesting; URDF needs 5.
const DEEPEST: usize = 32;
/// Largest number of links; the Go1 has 22.
const MOST_LINKS: usize = 500;

/// Largest length, m.
const LENGTH_M: f64 = 10.0;
/// Largest angle, rad: two turns.
const ANGLE_RAD: f64 = 12.6;
const MASS_KG: f64 = 1000.0;
const INERTIA_KG_M2: f64 = 1000.0;
const TORQUE_NM: f64 = 1000.0;
const SPEED_RAD_S: f64 = 1000.0;

/// A refused part of a URDF: element, problem, remedy.
pub(super) type Refusal = (String, String, &'static str);

/// Checks size and nesting of the text. The error follows "file: ".
pub(super) fn check_text(text: &str) -> Result<(), String> {
    let (mut elements, mut depth) = (0, 0_usize);
    let mut rest = text;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        let tag = &rest[..tag_length(rest)];
        rest = &rest[tag.len()..];
        match tag.bytes().next() {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'?' | b'!') => {}
            _ => {
                elements += 1;
                depth += usize::from(!tag.ends_with('/'));
            }
        }
        if depth > DEEPEST {
            return Err(format!("elements are nested more than {DEEPEST} deep; a robot's description needs 5"));
        }
        if elements > MOST_ELEMENTS {
            return Err(format!("has more than {MOST_ELEMENTS} elements; give a robot's description"));
        }
    }
    Ok(())
}

/// Number of bytes to the end of a tag, `>` in quotes left out.
fn tag_length(tag: &str) -> usize {
    let mut quote = None;
    let ends = |byte: u8| {
        match (quote, byte) {
            (Some(open), byte) if open == byte => quote = None,
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'>') => return true,
            _ => {}
        }
        false
    };
    tag.bytes().position(ends).unwrap_or(tag.len())
}

/// Checks the number of links, that names are unique, joints join links that exist and form a tree, and every number that is used.
pub(super) fn check_robot(robot: &Robot) -> Result<(), Refusal> {
    let links = robot.links.len();
    if links > MOST_LINKS {
        return Err((
            "robot".to_owned(),
            format!("{links} links"),
            "at most 500: leave out what does not move or weigh",
        ));
    }
    if let Some(name) = repeated(robot.links.iter().map(|link| &link.name)) {
        return Err((format!("link {name}"), "a second one has this name".to_owned(), "give each link its own name"));
    }
    if let Some(name) = repeated(robot.joints.iter().map(|joint| &joint.name)) {
        return Err((format!("joint {name}"), "a second one has this name".to_owned(), "give each joint its own name"));
    }
    if let Some(name) = repeated(robot.joints.iter().map(|joint| &joint.child.link)) {
        let problem = "several joints have it as their child".to_owned();
        return Err((format!("link {name}"), problem, "joints form a tree: leave one of them"));
    }
    let names: HashSet<&String> = robot.links.iter().map(|link| &link.name).collect();
    for joint in &robot.joints {
        for (end, link) in [("parent", &joint.parent.link), ("child", &joint.child.link)] {
            if !names.contains(link) {
                let problem = format!("its {end}, the link {link}, does not exist");
                return Err((format!("joint {}", joint.name), problem, "add the link, or remove the joint"));
            }
        }
    }
    robot.links.iter().try_for_each(check_link)?;
    robot.joints.iter().try_for_each(check_joint)
}

/// Returns the first name that occurs a second time.
fn repeated<'a>(names: impl IntoIterator<Item = &'a String>) -> Option<&'a String> {
    let mut known = HashSet::new();
    names.into_iter().find(|name| !known.insert(*name))
}

fn check_link(link: &Link) -> Result<(), Refusal> {
    let element = format!("link {}", link.name);
    let inertial = &link.inertial;
    check_pose(&element, "inertial origin", &inertial.origin)?;
    check(&element, "mass", inertial.mass.value, -MASS_KG, MASS_KG, "kg")?;
    let i = &inertial.inertia;
    for (name, value) in
        [("ixx", i.ixx), ("ixy", i.ixy), ("ixz", i.ixz), ("iyy", i.iyy), ("iyz", i.iyz), ("izz", i.izz)]
    {
        check(&element, name, value, -INERTIA_KG_M2, INERTIA_KG_M2, "kg m^2")?;
    }
    for collision in &link.collision {
        check_pose(&element, "collision origin", &collision.origin)?;
        let size = |name, value| check(&element, name, value, 0.0, LENGTH_M, "m");
        match &collision.geometry {
            Geometry::Box { size: edges } => edges.iter().try_for_each(|edge| size("box size", *edge))?,
            Geometry::Cylinder { radius, length } | Geometry::Capsule { radius, length } => {
                size("radius", *radius)?;
                size("length", *length)?;
            }
            Geometry::Sphere { radius } => size("sphere radius", *radius)?,
            Geometry::Mesh { .. } => {}
        }
    }
    Ok(())
}

fn check_joint(joint: &Joint) -> Result<(), Refusal> {
    let element = format!("joint {}", joint.name);
    check_pose(&element, "origin", &joint.origin)?;
    joint.axis.xyz.iter().try_for_each(|part| check(&element, "axis", *part, -LENGTH_M, LENGTH_M, ""))?;
    if !matches!(joint.joint_type, JointType::Revolute) {
        return Ok(());
    }
    let limit = &joint.limit;
    check(&element, "limit lower", limit.lower, -ANGLE_RAD, ANGLE_RAD, "rad")?;
    check(&element, "limit upper", limit.upper, -ANGLE_RAD, ANGLE_RAD, "rad")?;
    check(&element, "limit effort", limit.effort, -TORQUE_NM, TORQUE_NM, "N m")?;
    check(&element, "limit velocity", limit.velocity, -SPEED_RAD_S, SPEED_RAD_S, "rad/s")
}

fn check_pose(element: &str, name: &str, pose: &Pose) -> Result<(), Refusal> {
    pose.xyz.iter().try_for_each(|part| check(element, &format!("{name} xyz"), *part, -LENGTH_M, LENGTH_M, "m"))?;
    pose.rpy.iter().try_for_each(|part| check(element, &format!("{name} rpy"), *part, -ANGLE_RAD, ANGLE_RAD, "rad"))
}

fn check(element: &str, name: &str, value: f64, least: f64, most: f64, unit: &str) -> Result<(), Refusal> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let problem = format!("{name} {value} {unit} is not within {least} to {most}");
    Err((element.to_owned(), problem, "give a finite number of that size in SI units"))
}
