//! What is constant: the description in the form that the equations use.

use nalgebra::Vector3;

use super::spatial::Inertia;
use crate::robot::description::{Body, RobotDescription};
use crate::robot::{JOINTS, Joints, LEGS, PerLeg};

/// Acceleration of free fall, m/s^2, straight down.
pub const GRAVITY: f64 = 9.81;

/// One leg's constants.
#[derive(Debug, Clone)]
pub(super) struct LegModel {
    /// Origin of each joint in its parent's frame, m.
    pub joint_origin: [Vector3<f64>; 3],
    /// Inertia of hip, thigh and calf about their joint's origin, link axes.
    pub inertia: [Inertia; 3],
    /// Centre of the foot in the calf's frame, m.
    pub foot_origin: Vector3<f64>,
}

/// The machine as the equations see it. Built once; nothing here changes.
#[derive(Debug, Clone)]
pub struct Model {
    pub(super) trunk: Inertia,
    pub(super) legs: PerLeg<LegModel>,
    /// Inertia that the motors' rotors add at each joint, kg m^2; zero for ideal motors.
    pub(super) rotor_inertia: Joints,
}

impl Model {
    /// The rigid bodies of `description`, without rotor inertia.
    pub fn new(description: &RobotDescription) -> Model {
        let inertia = |body: &Body| Inertia::new(body.mass, &body.com, &body.inertia_com);
        Model {
            trunk: inertia(&description.trunk),
            legs: std::array::from_fn::<_, LEGS, _>(|i| {
                let leg = &description.legs[i];
                LegModel {
                    joint_origin: leg.joint_origin,
                    inertia: [inertia(&leg.bodies[0]), inertia(&leg.bodies[1]), inertia(&leg.bodies[2])],
                    foot_origin: leg.foot_origin,
                }
            }),
            rotor_inertia: [0.0; JOINTS],
        }
    }

    /// The same bodies with rotors of these inertias at the joints, kg m^2.
    pub fn with_rotor_inertia(mut self, rotor_inertia: Joints) -> Model {
        self.rotor_inertia = rotor_inertia;
        self
    }

    /// Mass of the whole machine, kg.
    pub fn mass(&self) -> f64 {
        self.trunk.mass + self.legs.iter().flat_map(|leg| &leg.inertia).map(|body| body.mass).sum::<f64>()
    }
}
