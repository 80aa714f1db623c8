//! Robots that differ from a described one in what is not known of it: `config/prior.toml` as data, and one such robot.

use serde::{Deserialize, Serialize};

use super::config::{ActuatorKind, SimConfig};
use crate::robot::description::RobotDescription;

/// Settings of an ensemble of simulated robots; exactly the keys of `config/prior.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnsembleSettings {
    /// Number of robots.
    pub worlds: u32,
    /// Jumps of each robot.
    pub points: u32,
    /// Seed of robots, points and sensor noise.
    pub seed: u32,
    /// Least tolerance of the robots' contact solver, m/s.
    pub solver_tolerance_m_s: f64,
    /// Ranges of the robots' properties.
    pub ranges: PropertyRanges,
}

/// Lowest and highest value of each property that robots of an ensemble differ in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PropertyRanges {
    /// Factor of every body's mass and inertia.
    pub mass: [f64; 2],
    /// Further factor of the trunk's rotational inertia.
    pub inertia: [f64; 2],
    /// Factor of the motors' largest torques.
    pub torque_limit: [f64; 2],
    /// Share of the no-load speed up to which a motor gives full torque.
    pub full_torque_speed_share: [f64; 2],
    /// Coulomb coefficient of ground and blocks.
    pub friction: [f64; 2],
    /// Age of a state when it is read, ms; drawn values are whole.
    pub delay_ms: [f64; 2],
    /// Time constant of a motor's torque, s.
    pub torque_lag_s: [f64; 2],
    /// Dry friction of a joint, N m.
    pub dry_friction_nm: [f64; 2],
    /// Viscous friction of a joint, N m s/rad.
    pub viscous_friction_nm_s: [f64; 2],
}

/// Number of properties in [`PropertyRanges`].
pub const PROPERTIES: usize = 9;

impl PropertyRanges {
    /// Returns the ranges with their keys, in the order of the fields.
    pub fn named(&self) -> [(&'static str, [f64; 2]); PROPERTIES] {
        [
            ("mass", self.mass),
            ("inertia", self.inertia),
            ("torque_limit", self.torque_limit),
            ("full_torque_speed_share", self.full_torque_speed_share),
            ("friction", self.friction),
            ("delay_ms", self.delay_ms),
            ("torque_lag_s", self.torque_lag_s),
            ("dry_friction_nm", self.dry_friction_nm),
            ("viscous_friction_nm_s", self.viscous_friction_nm_s),
        ]
    }

    /// Returns the properties at a point of the unit cube, one coordinate for each property in the order of [`PropertyRanges::named`]:
    /// 0 for the lowest value, 1 for the highest.
    pub fn at(&self, unit: &[f64; PROPERTIES]) -> RobotProperties {
        let ranges = self.named();
        let value = |i: usize| {
            let [low, high] = ranges[i].1;
            (low + (high - low) * unit[i]).clamp(low, high)
        };
        RobotProperties {
            mass: value(0),
            inertia: value(1),
            torque_limit: value(2),
            full_torque_speed_share: value(3),
            friction: value(4),
            delay_ms: value(5).round() as u32,
            torque_lag_s: value(6),
            dry_friction_nm: value(7),
            viscous_friction_nm_s: value(8),
        }
    }
}

/// Properties of one robot; meaning and unit as in [`PropertyRanges`].
#[expect(missing_docs, reason = "PropertyRanges has the meaning and unit of each field")]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RobotProperties {
    pub mass: f64,
    pub inertia: f64,
    pub torque_limit: f64,
    pub full_torque_speed_share: f64,
    pub friction: f64,
    pub delay_ms: u32,
    pub torque_lag_s: f64,
    pub dry_friction_nm: f64,
    pub viscous_friction_nm_s: f64,
}

impl RobotProperties {
    /// Returns `robot` in the world of `simulator` with these properties: motors that are not ideal, sensors with noise and delay.
    /// Controllers keep the description of `robot`.
    pub fn apply(&self, robot: &RobotDescription, simulator: &SimConfig) -> (RobotDescription, SimConfig) {
        let (mut robot, mut simulator) = (robot.clone(), simulator.clone());
        let legs = robot.legs.iter_mut().flat_map(|leg| &mut leg.bodies);
        for body in legs.chain([&mut robot.trunk]) {
            body.mass *= self.mass;
            body.inertia_com *= self.mass;
        }
        robot.trunk.inertia_com *= self.inertia;
        for torque in &mut robot.limits.max_torque {
            *torque *= self.torque_limit;
        }
        let motor = &mut simulator.actuator;
        motor.kind = ActuatorKind::HardwareLike;
        motor.hardware_like.full_torque_speed_share = self.full_torque_speed_share;
        motor.hardware_like.torque_lag_s = self.torque_lag_s;
        motor.hardware_like.dry_friction_nm = self.dry_friction_nm;
        motor.hardware_like.viscous_friction_nm_s = self.viscous_friction_nm_s;
        let terrain = &mut simulator.terrain;
        (terrain.friction, terrain.friction_range) = (self.friction, None);
        (terrain.blocks.friction, terrain.blocks.friction_range) = (self.friction, None);
        simulator.sensors.enabled = true;
        simulator.sensors.delay_ms = self.delay_ms;
        (robot, simulator)
    }
}
