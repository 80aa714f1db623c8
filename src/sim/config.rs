//! `config/simulator.toml` as data.
#![expect(missing_docs, reason = "config/simulator.toml explains every key and value with its unit and source")]

use serde::{Deserialize, Serialize};

use super::ranges;

/// The simulator's settings; exactly the keys of `config/simulator.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimConfig {
    pub step: StepConfig,
    pub solver: SolverConfig,
    pub contact: ContactConfig,
    pub terrain: TerrainConfig,
    pub actuator: ActuatorConfig,
    pub sensors: SensorConfig,
    pub emulator: EmulatorConfig,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepConfig {
    pub contact_substeps: u32,
    pub flight_substeps: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverConfig {
    pub tolerance_m_s: f64,
    pub max_sweeps: u32,
    /// Share of a penetration that one step recovers.
    pub penetration_recovery: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactConfig {
    pub law: ContactLaw,
    pub slip_time_s: f64,
    pub bodies: Vec<BodyKind>,
    /// Those of `bodies` whose contact is a sign of a fall.
    pub fall_bodies: Vec<BodyKind>,
}

/// Contact law: selects the impulse in the friction cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactLaw {
    Coulomb,
    Convex,
}

/// Kind of link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BodyKind {
    Trunk,
    Hip,
    Thigh,
    Calf,
}

/// Kind of ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TerrainKind {
    Flat,
    Slope,
    Steps,
    Blocks,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainConfig {
    pub kind: TerrainKind,
    pub friction: f64,
    /// Lowest and highest coefficient of a trial, drawn by its seed; none for `friction` in every trial.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_range: Option<[f64; 2]>,
    /// Used where `kind` is a slope.
    pub slope: SlopeConfig,
    /// Used where `kind` is steps.
    pub steps: StepsConfig,
    /// Used where `kind` is blocks.
    pub blocks: BlocksConfig,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlopeConfig {
    pub angle_rad: f64,
    /// Direction of rise, rad: 0 along world x, positive towards y.
    pub heading_rad: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepsConfig {
    pub rise_m: f64,
    pub run_m: f64,
    /// World x of the first riser, m.
    pub start_m: f64,
    pub count: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlocksConfig {
    pub count: u32,
    pub layers: u32,
    pub thickness_m: f64,
    /// Shortest and longest edge, m.
    pub edge_m: [f64; 2],
    /// Half of the edge of the square that holds the centres, m.
    pub reach_m: f64,
    /// Rectangle that holds the centres instead, world: x from, x to, y from, y to, m; the robot starts at 0, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area_m: Option<[f64; 4]>,
    pub friction: f64,
    /// Lowest and highest coefficient of a block, drawn for each by the trial's seed; none for `friction` on every block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_range: Option<[f64; 2]>,
    pub loose: bool,
    pub mass_kg: f64,
    pub floor_friction: f64,
}

impl BlocksConfig {
    /// Returns the rectangle that holds the centres: x from, x to, y from, y to, m.
    pub fn area(&self) -> [f64; 4] {
        let reach_m = self.reach_m;
        self.area_m.unwrap_or([-reach_m, reach_m, -reach_m, reach_m])
    }
}

/// Motor model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ActuatorKind {
    #[serde(rename = "ideal")]
    Ideal,
    #[serde(rename = "hardware-like")]
    HardwareLike,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorConfig {
    pub kind: ActuatorKind,
    /// Used where `kind` is hardware-like.
    pub hardware_like: HardwareLikeConfig,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HardwareLikeConfig {
    /// Share of the no-load speed up to which the motor gives full torque.
    pub full_torque_speed_share: f64,
    pub torque_lag_s: f64,
    pub dry_friction_nm: f64,
    pub viscous_friction_nm_s: f64,
    pub rotor_inertia: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    pub enabled: bool,
    pub gyro_noise_rad_s: f64,
    pub gyro_bias_rad_s: f64,
    pub accel_noise_m_s2: f64,
    pub accel_bias_m_s2: f64,
    pub orientation_noise_rad: f64,
    /// Resolution of the joint angles, rad.
    pub encoder_step_rad: f64,
    pub joint_velocity_noise_rad_s: f64,
    pub foot_force_noise_n: f64,
    /// Resolution of the foot forces, N.
    pub foot_force_step_n: f64,
    pub delay_ms: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmulatorConfig {
    pub command_timeout_ms: u32,
    /// Damping of a motor that is not in servo mode, N m s/rad.
    pub braking_kd: f64,
    pub reboot_ms: u32,
    pub state_length: usize,
    pub motor_temperature_c: f64,
    pub battery_percent: f64,
}

/// Error in the simulator's configuration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimError {
    /// The text is not TOML with the known keys.
    #[error("simulator configuration: {reason}")]
    Syntax {
        /// Reason of the parser, with line and column.
        reason: String,
    },
    /// A value is out of its range.
    #[error("simulator configuration: {key} = {value}: {remedy}")]
    Value {
        /// The key with its tables.
        key: String,
        /// The value.
        value: f64,
        /// Allowed values.
        remedy: &'static str,
    },
}

/// The shipped file.
const SHIPPED: &str = include_str!("../../config/simulator.toml");

impl Default for SimConfig {
    /// `config/simulator.toml` as shipped.
    fn default() -> Self {
        SimConfig::from_toml(SHIPPED).expect("the shipped configuration is valid")
    }
}

impl SimConfig {
    /// Reads and checks the text of a `simulator.toml`.
    pub fn from_toml(text: &str) -> Result<SimConfig, SimError> {
        let syntax = |reason: String| SimError::Syntax { reason };
        let table: toml::Table = toml::from_str(text).map_err(|e| syntax(e.to_string()))?;
        // As `config` reads it: by another way, the fields of thirteen structs would be compiled once more.
        let config: SimConfig = table.try_into().map_err(|e: toml::de::Error| syntax(e.to_string()))?;
        config.check()?;
        Ok(config)
    }

    /// Checks that every value is in its range.
    pub fn check(&self) -> Result<(), SimError> {
        let refuse = |key: String, value, remedy| Err(SimError::Value { key, value, remedy });
        let table = toml::Table::try_from(self).map_err(|e| SimError::Syntax { reason: e.to_string() })?;
        if let Some((key, value, remedy)) = ranges::first_outside(ranges::SIMULATOR, &table) {
            return refuse(key, value, remedy);
        }
        let blocks = &self.terrain.blocks;
        let [x_from, x_to, y_from, y_to] = blocks.area();
        for (key, [low, high], remedy) in [
            ("terrain.blocks.edge_m", blocks.edge_m, "give the shorter edge first"),
            ("terrain.blocks.area_m", [x_from, x_to], "give [x from, x to, y from, y to] with from at most to"),
            ("terrain.blocks.area_m", [y_from, y_to], "give [x from, x to, y from, y to] with from at most to"),
            ("terrain.friction_range", self.terrain.friction_range.unwrap_or_default(), "give the lower value first"),
            ("terrain.blocks.friction_range", blocks.friction_range.unwrap_or_default(), "give the lower value first"),
        ] {
            if high < low {
                return refuse(key.to_owned(), high, remedy);
            }
        }
        Ok(())
    }
}
