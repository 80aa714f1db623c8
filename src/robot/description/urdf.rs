//! Converts a URDF to bodies, legs and limits. Links joined by fixed joints become one body (Featherstone 2008, eq.
//! 2.66, adds their inertias); the result must be a trunk with four legs of hip, thigh and calf.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};
use urdf_rs::{Geometry, Joint, JointType, Link, Pose, Robot};

use super::urdf_checks;
use super::{CollisionShape, DescriptionError, JointLimits, LegDescription, LinkFrame, RigidBody};
use crate::robot::kinematics::LegGeometry;
use crate::robot::rotation::from_roll_pitch_yaw;
use crate::robot::{JOINT_NAMES, JOINTS, Joints, Leg, PerLeg};

/// Contents of a URDF.
pub(super) struct UrdfContents {
    pub trunk: RigidBody,
    pub legs: PerLeg<LegDescription>,
    pub leg_geometry: LegGeometry,
    pub limits: JointLimits,
    /// Origin of the link of the inertial unit, trunk frame, m: the one that has "imu" in its name, as a word.
    pub imu_origin: Option<Vector3<f64>>,
    pub joint_names: [String; JOINTS],
    pub links: Vec<LinkFrame>,
    /// Joints of the legs whose damping or friction is not zero in the URDF, which has no effect.
    pub unused_dynamics: Vec<String>,
    /// Links of the legs that have no mass themselves: their bodies weigh what is fixed to them.
    pub massless_links: Vec<String>,
}

/// Tolerance for lengths and directions that must be equal or zero, m: the precision of a drawing.
const TOLERANCE: f64 = 1e-6;

/// Least mass of a body: with less the numbers of the simulator are not finite.
const LEAST_MASS_KG: f64 = 1e-3;

/// Links joined by fixed joints, in the frame of the first one.
struct FixedLinks<'a> {
    body: RigidBody,
    /// Moving joints of these links, with their origin in the common frame.
    joints: Vec<(&'a Joint, Isometry3<f64>)>,
    /// Collision shapes of `body` that are spheres in the URDF, not the ends of a capsule.
    spheres: Vec<usize>,
    /// The inertial unit's link and its frame.
    imu: Option<(&'a str, Isometry3<f64>)>,
}

/// A parsed URDF with its file name for messages.
struct UrdfDocument<'a> {
    file: &'a Path,
    robot: &'a Robot,
}

/// Converts the URDF in `text`; `file` is for messages.
pub(super) fn parse(file: &Path, text: &str) -> Result<UrdfContents, DescriptionError> {
    let syntax = |reason: String| DescriptionError::Syntax { file: file.to_owned(), reason };
    urdf_checks::check_text(text).map_err(syntax)?;
    let robot =
        urdf_rs::read_from_string(text).map_err(|error| syntax(format!("{error}; give the URDF of a robot")))?;
    urdf_checks::check_robot(&robot).map_err(|(element, problem, remedy)| DescriptionError::Invalid {
        file: file.to_owned(),
        element,
        problem,
        remedy,
    })?;
    UrdfDocument { file, robot: &robot }.contents()
}

impl<'a> UrdfDocument<'a> {
    fn invalid<T>(&self, element: &str, problem: String, remedy: &'static str) -> Result<T, DescriptionError> {
        Err(DescriptionError::Invalid { file: self.file.to_owned(), element: element.to_owned(), problem, remedy })
    }

    /// Returns the link at an end of a joint, which [`urdf_checks::check_robot`] has found.
    fn link(&self, name: &str) -> &'a Link {
        self.robot.links.iter().find(|link| link.name == name).expect("the links of all joints exist")
    }

    /// Returns the only link without a parent.
    fn root(&self) -> Result<&'a Link, DescriptionError> {
        let is_child = |link: &Link| self.robot.joints.iter().any(|joint| joint.child.link == link.name);
        let roots: Vec<&Link> = self.robot.links.iter().filter(|link| !is_child(link)).collect();
        match roots[..] {
            [root] => Ok(root),
            _ => self.invalid("robot", format!("{} links without a parent", roots.len()), "one must be, the trunk"),
        }
    }

    fn contents(&self) -> Result<UrdfContents, DescriptionError> {
        let root = self.root()?;
        let floating = |joint: &&Joint| {
            joint.parent.link == root.name
                && matches!(joint.joint_type, JointType::Floating)
                && root.inertial.mass.value == 0.0
        };
        if let Some(joint) = self.robot.joints.iter().find(floating) {
            let problem = format!("has no mass, and the floating joint {} carries the robot", joint.name);
            let remedy = "the root is the trunk: remove this link and its joint, or make the joint fixed";
            return self.invalid(&format!("link {}", root.name), problem, remedy);
        }
        let trunk = self.fixed_links(root)?;
        if trunk.joints.len() != 4 {
            let found = trunk.joints.iter().map(|(joint, _)| joint.name.as_str()).collect::<Vec<_>>().join(", ");
            let problem = format!("{} moving joints on the trunk ({found})", trunk.joints.len());
            return self.invalid(&format!("link {}", trunk.body.name), problem, "a quadruped has four, its hips");
        }
        let mut legs = [const { None }; 4];
        let mut joint_names = [const { String::new() }; JOINTS];
        let mut limits = JointLimits {
            min_position: Joints::default(),
            max_position: Joints::default(),
            max_torque: Joints::default(),
            max_velocity: Joints::default(),
        };
        for &(joint, origin) in &trunk.joints {
            let hip = origin.translation.vector;
            let Some(leg) =
                Leg::ALL.into_iter().find(|leg| leg.front_sign() * hip.x > 0.0 && leg.left_sign() * hip.y > 0.0)
            else {
                let problem = format!("its origin ({}, {}) m is on an axis of the trunk", hip.x, hip.y);
                return self.invalid(&joint.name, problem, "put the trunk's origin between the four hips");
            };
            if legs[leg as usize].is_some() {
                let problem = format!("a second hip in the place of {}", leg.name());
                return self.invalid(&joint.name, problem, "put the trunk's origin between the four hips");
            }
            legs[leg as usize] = Some(self.leg(leg, joint, origin, &mut limits, &mut joint_names)?);
        }
        // Four hips, each in another quadrant.
        let legs = legs.map(|leg| leg.expect("four distinct legs"));
        let leg_geometry = self.geometry(&legs)?;
        let links = self.link_frames(&trunk.body.name, &joint_names)?;
        if let Some((name, frame)) = trunk.imu.filter(|(_, frame)| frame.rotation.angle() > TOLERANCE) {
            let problem = format!("the inertial unit's frame is turned by {} rad", frame.rotation.angle());
            let remedy = "its measurements are taken in the trunk's axes: give it rpy=\"0 0 0\", and turn them in the robot's driver";
            return self.invalid(&format!("link {name}"), problem, remedy);
        }
        let imu_origin = trunk.imu.map(|(_, frame)| frame.translation.vector);
        let has_dynamics = |joint: &&Joint| {
            joint_names.contains(&joint.name)
                && joint.dynamics.as_ref().is_some_and(|part| part.damping != 0.0 || part.friction != 0.0)
        };
        let unused_dynamics = self.robot.joints.iter().filter(has_dynamics).map(|joint| joint.name.clone()).collect();
        let bodies = legs.iter().flat_map(|leg| &leg.bodies).map(|body| body.name.clone());
        let massless_links = bodies.filter(|name| self.link(name).inertial.mass.value == 0.0).collect();
        Ok(UrdfContents {
            trunk: trunk.body,
            legs,
            leg_geometry,
            limits,
            imu_origin,
            joint_names,
            links,
            unused_dynamics,
            massless_links,
        })
    }

    /// Returns all links but `root`, each once and after its parent.
    fn link_frames(&self, root: &str, joint_names: &[String; JOINTS]) -> Result<Vec<LinkFrame>, DescriptionError> {
        let frame = |joint: &Joint| LinkFrame {
            name: joint.child.link.clone(),
            parent: joint.parent.link.clone(),
            origin: isometry(&joint.origin),
            joint: joint_names.iter().position(|name| *name == joint.name),
        };
        let children = |parent: &str| {
            let parent = parent.to_owned();
            self.robot.joints.iter().filter(move |joint| joint.parent.link == parent).map(frame)
        };
        let mut links: Vec<LinkFrame> = children(root).collect();
        let mut next = 0;
        while let Some(parent) = links.get(next).map(|link| link.name.clone()) {
            links.extend(children(&parent));
            next += 1;
        }
        let is_known = |name: &str| name == root || links.iter().any(|link| link.name == name);
        match self.robot.links.iter().find(|link| !is_known(&link.name)) {
            Some(link) => {
                self.invalid(&format!("link {}", link.name), "is its own ancestor".into(), "joints form a tree")
            }
            None => Ok(links),
        }
    }

    /// Converts the chain of three joints that starts with `hip`.
    fn leg(
        &self,
        leg: Leg,
        hip: &'a Joint,
        origin: Isometry3<f64>,
        limits: &mut JointLimits,
        joint_names: &mut [String; JOINTS],
    ) -> Result<LegDescription, DescriptionError> {
        let mut chain = Vec::with_capacity(3);
        let mut spheres = Vec::new();
        let mut joint_origin = [Vector3::zeros(); 3];
        let (mut joint, mut origin) = (hip, origin);
        for part in 0..3 {
            self.check_joint(joint, &origin, part)?;
            joint_origin[part] = origin.translation.vector;
            let i = 3 * leg as usize + part;
            joint_names[i].clone_from(&joint.name);
            limits.min_position[i] = joint.limit.lower;
            limits.max_position[i] = joint.limit.upper;
            limits.max_torque[i] = joint.limit.effort;
            limits.max_velocity[i] = joint.limit.velocity;
            let links = self.fixed_links(self.link(&joint.child.link))?;
            spheres = links.spheres;
            match (part, &links.joints[..]) {
                (0 | 1, &[(next, next_origin)]) => (joint, origin) = (next, next_origin),
                (2, []) => {}
                (_, children) => {
                    let problem = format!("{} moving joints hang on this {}", children.len(), JOINT_NAMES[part]);
                    return self.invalid(
                        &links.body.name,
                        problem,
                        "a leg is hip, thigh, calf; make other joints fixed",
                    );
                }
            }
            chain.push(links.body);
        }
        let [hip, thigh, mut calf]: [RigidBody; 3] = chain.try_into().expect("three parts were pushed");

        // The foot is the lowest sphere of the calf.
        let feet = spheres.into_iter().filter_map(|i| match calf.collision[i] {
            CollisionShape::Sphere { center, radius } => Some((i, (center, radius))),
            _ => None,
        });
        let Some((i, (foot_origin, foot_radius))) = feet.min_by(|a, b| a.1.0.z.total_cmp(&b.1.0.z)) else {
            let remedy = "add a link with a sphere as collision, fixed to the calf's end";
            return self.invalid(&format!("link {}", calf.name), "has no foot".into(), remedy);
        };
        calf.collision.remove(i);
        Ok(LegDescription { bodies: [hip, thigh, calf], joint_origin, foot_origin, foot_radius })
    }

    /// Checks that `joint` is a hip (0), thigh (1) or calf (2) joint of the closed-form kinematics with valid limits.
    fn check_joint(&self, joint: &Joint, origin: &Isometry3<f64>, part: usize) -> Result<(), DescriptionError> {
        let element = format!("joint {}", joint.name);
        let wanted = if part == 0 { Vector3::x() } else { Vector3::y() };
        let axis = vector(&joint.axis.xyz.0);
        if (axis - wanted).norm() > TOLERANCE {
            let problem = format!("axis ({}, {}, {}) where a {} is", axis.x, axis.y, axis.z, JOINT_NAMES[part]);
            return self.invalid(&element, problem, "a hip turns about 1 0 0, a thigh and a calf about 0 1 0");
        }
        if origin.rotation.angle() > TOLERANCE {
            let problem = format!("its frame is turned by {} rad", origin.rotation.angle());
            return self.invalid(
                &element,
                problem,
                "all frames of legs must be parallel to the trunk's at zero angles",
            );
        }
        if !matches!(joint.joint_type, JointType::Revolute) {
            let problem = format!("is {:?}", joint.joint_type);
            return self.invalid(&element, problem, "a leg's joint is revolute and has limits");
        }
        if let Some(mimic) = &joint.mimic {
            let problem = format!("<mimic> of {}", mimic.joint);
            return self.invalid(&element, problem, "each joint of a leg has a motor of its own: remove <mimic>");
        }
        let limit = &joint.limit;
        if limit.lower >= limit.upper || limit.lower.is_nan() || limit.upper.is_nan() {
            let problem = format!("limits lower {} and upper {} rad", limit.lower, limit.upper);
            return self.invalid(&element, problem, "lower must be less than upper");
        }
        for (name, value) in [("effort", limit.effort), ("velocity", limit.velocity)] {
            if !(value.is_finite() && value > 0.0) {
                return self.invalid(&element, format!("limit {name} is {value}"), "it must be greater than zero");
            }
        }
        Ok(())
    }

    /// Returns the lengths of the closed-form kinematics, which must be the same for all legs.
    fn geometry(&self, legs: &PerLeg<LegDescription>) -> Result<LegGeometry, DescriptionError> {
        let first = &legs[0];
        let geometry = LegGeometry {
            abduction: first.joint_origin[1].y.abs(),
            thigh: -first.joint_origin[2].z,
            calf: -first.foot_origin.z,
        };
        for (leg, found) in Leg::ALL.into_iter().zip(legs) {
            let expected = [
                (leg.left_sign() * Vector3::y() * geometry.abduction, found.joint_origin[1], "thigh joint"),
                (-Vector3::z() * geometry.thigh, found.joint_origin[2], "calf joint"),
                (-Vector3::z() * geometry.calf, found.foot_origin, "foot"),
            ];
            for (wanted, is, what) in expected {
                if (wanted - is).norm() > TOLERANCE {
                    let problem = format!(
                        "at ({}, {}, {}) m from its parent where ({}, {}, {}) would match the leg FR",
                        is.x, is.y, is.z, wanted.x, wanted.y, wanted.z
                    );
                    let remedy =
                        "legs must be alike: the thigh joint beside the hip, calf joint and foot straight below";
                    return self.invalid(&format!("{} {what}", leg.name()), problem, remedy);
                }
            }
            if (found.foot_radius - first.foot_radius).abs() > TOLERANCE {
                let problem = format!("its radius is {} m, that of FR {} m", found.foot_radius, first.foot_radius);
                return self.invalid(&format!("{} foot", leg.name()), problem, "give all feet the same radius");
            }
        }
        for (what, length) in [("thigh", geometry.thigh), ("calf", geometry.calf)] {
            if length <= 0.0 {
                return self.invalid(what, format!("its length is {length} m"), "it must point down at zero angles");
            }
        }
        debug_assert_eq!(legs.len() * 3, JOINTS);
        Ok(geometry)
    }

    /// Returns `root` and all links fixed to it as one body.
    fn fixed_links(&self, root: &'a Link) -> Result<FixedLinks<'a>, DescriptionError> {
        let body = RigidBody {
            name: root.name.clone(),
            mass: 0.0,
            com: Vector3::zeros(),
            inertia_com: Matrix3::zeros(),
            collision: Vec::new(),
        };
        let mut links = FixedLinks { body, joints: Vec::new(), spheres: Vec::new(), imu: None };
        self.add(root, Isometry3::identity(), &mut links)?;
        let element = format!("link {}", links.body.name);
        let mass = links.body.mass;
        if !(mass.is_finite() && mass >= LEAST_MASS_KG) {
            return self.invalid(&element, format!("mass {mass} kg"), "a body of the robot weighs 1 g at least");
        }
        // The principal moments of a rigid body are positive, and none exceeds the sum of the others.
        let moments = links.body.inertia_com.symmetric_eigenvalues();
        let (least, sum) = (moments.min(), moments.sum());
        if !(least > 0.0 && moments.max() <= (sum - moments.max()) * (1.0 + 1e-6)) {
            let problem = format!("principal moments of inertia {:.3e} {:.3e} {:.3e}", moments.x, moments.y, moments.z);
            return self.invalid(
                &element,
                problem,
                "they must be positive, none greater than the sum of the other two",
            );
        }
        Ok(links)
    }

    /// Adds `link`, whose frame is `pose` in the common frame, and all links fixed to it.
    fn add(&self, link: &'a Link, pose: Isometry3<f64>, links: &mut FixedLinks<'a>) -> Result<(), DescriptionError> {
        if link.inertial.mass.value < 0.0 {
            let problem = format!("mass {} kg", link.inertial.mass.value);
            return self.invalid(&format!("link {}", link.name), problem, "a mass is not negative");
        }
        merge_inertia(&mut links.body, &link.inertial, &pose);
        if is_imu(&link.name)
            && let Some((other, _)) = links.imu.replace((&link.name, pose))
        {
            let problem = format!("is a second inertial unit by its name, beside {other}");
            return self.invalid(
                &format!("link {}", link.name),
                problem,
                "leave \"imu\" in the name of the one that is read",
            );
        }
        for collision in &link.collision {
            self.add_shapes(link, &collision.geometry, pose * isometry(&collision.origin), links)?;
        }
        for joint in self.robot.joints.iter().filter(|joint| joint.parent.link == link.name) {
            let origin = pose * isometry(&joint.origin);
            match joint.joint_type {
                JointType::Fixed => self.add(self.link(&joint.child.link), origin, links)?,
                _ => links.joints.push((joint, origin)),
            }
        }
        Ok(())
    }

    fn add_shapes(
        &self,
        link: &Link,
        geometry: &Geometry,
        pose: Isometry3<f64>,
        links: &mut FixedLinks<'a>,
    ) -> Result<(), DescriptionError> {
        let shapes = &mut links.body.collision;
        let center = pose.translation.vector;
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        match *geometry {
            Geometry::Box { size } => {
                shapes.push(CollisionShape::Box { center, rotation, half_extents: vector(&size.0) / 2.0 });
            }
            Geometry::Cylinder { radius, length } => {
                shapes.push(CollisionShape::Cylinder { center, rotation, radius, half_length: length / 2.0 });
            }
            // A capsule touches the ground at its two ends.
            Geometry::Capsule { radius, length } => {
                for half in [-0.5, 0.5] {
                    let center = center + rotation.column(2) * (half * length);
                    shapes.push(CollisionShape::Sphere { center, radius });
                }
            }
            Geometry::Sphere { radius } => {
                links.spheres.push(shapes.len());
                shapes.push(CollisionShape::Sphere { center, radius });
            }
            Geometry::Mesh { ref filename, .. } => {
                let remedy = "meshes do not collide here: describe the shape by boxes, cylinders, capsules or spheres";
                return self.invalid(&format!("link {}", link.name), format!("collision mesh {filename}"), remedy);
            }
        }
        Ok(())
    }
}

/// Returns the URDF in `text` with primitive shapes to look at: a link without a visual shape, or with a mesh as one, gets the
/// shapes of its collision. None for a text that is no URDF.
pub(super) fn with_visual_shapes(text: &str) -> Option<String> {
    let mut robot = urdf_rs::read_from_string(text).ok()?;
    for link in &mut robot.links {
        let shown = |visual: &urdf_rs::Visual| !matches!(visual.geometry, Geometry::Mesh { .. });
        if link.visual.is_empty() || !link.visual.iter().all(shown) {
            let shape = |collision: &urdf_rs::Collision| urdf_rs::Visual {
                name: None,
                origin: collision.origin.clone(),
                geometry: collision.geometry.clone(),
                material: None,
            };
            link.visual = link.collision.iter().map(shape).collect();
        }
    }
    urdf_rs::write_to_string(&robot).ok()
}

/// Whether a link is an inertial unit by its name: "imu" is one of its words, as in `base_imu` and `imu_link`.
fn is_imu(name: &str) -> bool {
    name.split(|letter: char| !letter.is_ascii_alphabetic()).any(|word| word.eq_ignore_ascii_case("imu"))
}

/// Adds mass and inertia of a part to `body` by the parallel-axis theorem.
fn merge_inertia(body: &mut RigidBody, part: &urdf_rs::Inertial, pose: &Isometry3<f64>) {
    let mass = part.mass.value;
    if mass == 0.0 {
        return;
    }
    let pose = pose * isometry(&part.origin);
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    let i = &part.inertia;
    let own = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    // I_C = R I R^T + m (d.d 1 - d d^T), d from the common centre of mass.
    let shifted = |mass: f64, d: Vector3<f64>| (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * mass;
    let total = body.mass + mass;
    let com = (body.com * body.mass + pose.translation.vector * mass) / total;
    body.inertia_com += shifted(body.mass, body.com - com)
        + rotation * own * rotation.transpose()
        + shifted(mass, pose.translation.vector - com);
    body.com = com;
    body.mass = total;
}

fn vector(xyz: &[f64; 3]) -> Vector3<f64> {
    Vector3::from_column_slice(xyz)
}

/// Converts a URDF pose: roll, pitch, yaw about fixed axes, then the translation.
fn isometry(pose: &Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    let rotation = from_roll_pitch_yaw(roll, pitch, yaw);
    Isometry3::from_parts(Translation3::from(vector(&pose.xyz.0)), rotation)
}
