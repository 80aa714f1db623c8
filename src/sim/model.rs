//! The constant model: the robot description in the form that the equations use.

use fearless_simd::Level;
use nalgebra::Vector3;

use super::lanes::Quad;
use super::spatial::{SpatialInertia, SymmetricMatrix};
use crate::robot::description::{RigidBody, RobotDescription};
use crate::robot::{JOINTS, Joints, PerLeg};

/// Constants of the legs.
#[derive(Debug, Clone)]
pub(super) struct LegsModel {
    /// Origin of each joint in its parent's frame, m.
    pub joint_origin: [Vector3<Quad>; 3],
    /// Inertia of hip, thigh and calf about their joint's origin, link axes.
    pub inertia: [SpatialInertia<Quad>; 3],
}

/// Masses and geometry of the robot.
#[derive(Debug, Clone)]
pub struct RobotModel {
    pub(super) trunk: SpatialInertia<f64>,
    pub(super) legs: LegsModel,
    /// Centre of each foot in its calf's frame, m.
    pub(super) foot_origin: PerLeg<Vector3<f64>>,
    mass: f64,
    /// Inertia of the rotors at each joint, kg m^2; zero for ideal motors.
    pub(super) rotor_inertia: Joints,
    /// Instructions with which the equations are evaluated.
    pub(super) instructions: Level,
}

impl RobotModel {
    /// Takes the rigid bodies of `description`, without rotor inertia.
    pub fn new(description: &RobotDescription) -> RobotModel {
        let inertia = |body: &RigidBody| SpatialInertia::new(body.mass, &body.com, &body.inertia_com);
        let legs = &description.legs;
        let trunk = inertia(&description.trunk);
        let links = legs.iter().flat_map(|leg| &leg.bodies);
        RobotModel {
            mass: trunk.mass + links.map(|body| body.mass).sum::<f64>(),
            trunk,
            legs: LegsModel {
                joint_origin: [0, 1, 2].map(|i| Quad::vectors(&legs.each_ref().map(|leg| leg.joint_origin[i]))),
                inertia: [0, 1, 2].map(|i| inertia_lanes(&legs.each_ref().map(|leg| inertia(&leg.bodies[i])))),
            },
            foot_origin: legs.each_ref().map(|leg| leg.foot_origin),
            rotor_inertia: [0.0; JOINTS],
            instructions: Level::new(),
        }
    }

    /// Sets the inertia of the rotors at the joints, kg m^2.
    pub fn with_rotor_inertia(mut self, rotor_inertia: Joints) -> RobotModel {
        self.rotor_inertia = rotor_inertia;
        self
    }

    /// Evaluates the equations with the instructions that every processor of this architecture has, in place of the widest ones of this
    /// processor: slower, with the same bits.
    pub fn with_baseline_instructions(mut self) -> RobotModel {
        self.instructions = Level::baseline();
        self
    }

    /// Total mass, kg.
    pub fn mass(&self) -> f64 {
        self.mass
    }
}

fn inertia_lanes(i: &PerLeg<SpatialInertia<f64>>) -> SpatialInertia<Quad> {
    let lanes = |f: fn(&SymmetricMatrix<f64>) -> f64| Quad(i.each_ref().map(|i| f(&i.second)));
    SpatialInertia {
        mass: Quad(i.map(|i| i.mass)),
        first: Quad::vectors(&i.map(|i| i.first)),
        second: SymmetricMatrix {
            xx: lanes(|s| s.xx),
            xy: lanes(|s| s.xy),
            xz: lanes(|s| s.xz),
            yy: lanes(|s| s.yy),
            yz: lanes(|s| s.yz),
            zz: lanes(|s| s.zz),
        },
    }
}
