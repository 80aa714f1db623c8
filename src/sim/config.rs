//! `config/simulator.toml` as data. That file explains every key with its unit and source.

use serde::Deserialize;

/// The simulator's settings; exactly the keys of `config/simulator.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimConfig {
    /// Time steps.
    pub step: StepConfig,
    /// Contact solver.
    pub solver: SolverConfig,
    /// Contacts.
    pub contact: ContactConfig,
    /// The ground.
    pub terrain: TerrainConfig,
    /// The motors.
    pub actuator: ActuatorConfig,
    /// The sensors.
    pub sensors: SensorConfig,
    /// Properties of the emulated robot, for `quadfrog emulate`.
    pub emulator: EmulatorConfig,
}

/// `[step]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepConfig {
    /// Steps per control period while something can touch.
    pub contact_substeps: u32,
    /// Steps per control period in free flight.
    pub flight_substeps: u32,
}

/// `[solver]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverConfig {
    /// Change of velocity below which the sweeps end, m/s.
    pub tolerance_m_s: f64,
    /// Largest number of sweeps.
    pub max_sweeps: u32,
    /// Share of a penetration that one step recovers.
    pub penetration_recovery: f64,
}

/// `[contact]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactConfig {
    /// Contact law.
    pub law: ContactLaw,
    /// Time constant with which the convex law stops a slip, s.
    pub slip_time_s: f64,
    /// Links that can touch the ground besides the feet.
    pub bodies: Vec<BodyKind>,
}

/// Contact law: selects the impulse in the friction cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactLaw {
    /// Coulomb's and Signorini's laws.
    Coulomb,
    /// MuJoCo's convex relaxation.
    Convex,
}

/// Kind of link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BodyKind {
    /// The floating base.
    Trunk,
    /// The four hip links.
    Hip,
    /// The four thighs.
    Thigh,
    /// The four calves.
    Calf,
}

/// Kind of ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TerrainKind {
    /// A level plane.
    Flat,
    /// An inclined plane.
    Slope,
    /// Stairs.
    Steps,
    /// Random blocks.
    Blocks,
}

/// `[terrain]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainConfig {
    /// Kind of ground.
    pub kind: TerrainKind,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Used where `kind` is a slope.
    pub slope: SlopeConfig,
    /// Used where `kind` is steps.
    pub steps: StepsConfig,
    /// Used where `kind` is blocks.
    pub blocks: BlocksConfig,
}

/// `[terrain.slope]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlopeConfig {
    /// Steepness, rad.
    pub angle_rad: f64,
    /// Direction of rise, rad: 0 along world x, positive towards y.
    pub heading_rad: f64,
}

/// `[terrain.steps]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepsConfig {
    /// Height of a step, m.
    pub rise_m: f64,
    /// Depth of a step, m.
    pub run_m: f64,
    /// World x of the first riser, m.
    pub start_m: f64,
    /// Number of steps.
    pub count: u32,
}

/// `[terrain.blocks]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlocksConfig {
    /// Largest number of blocks; fewer if there is no room.
    pub count: u32,
    /// Largest number of blocks on top of each other.
    pub layers: u32,
    /// Height of a block, m.
    pub thickness_m: f64,
    /// Shortest and longest edge, m.
    pub edge_m: [f64; 2],
    /// Half of the edge of the square that holds the centres, m.
    pub reach_m: f64,
    /// Coulomb coefficient of the surface.
    pub friction: f64,
    /// Whether the blocks slide when pushed.
    pub loose: bool,
    /// Mass of a block, kg.
    pub mass_kg: f64,
    /// Coulomb coefficient between block and floor.
    pub floor_friction: f64,
}

/// Motor model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum ActuatorKind {
    /// Torque as commanded, clamped to the limits.
    #[serde(rename = "ideal")]
    Ideal,
    /// Torque-speed curve, lag, friction, rotor inertia.
    #[serde(rename = "hardware-like")]
    HardwareLike,
}

/// `[actuator]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorConfig {
    /// Motor model.
    pub kind: ActuatorKind,
    /// Used where `kind` is hardware-like.
    pub hardware_like: HardwareLikeConfig,
}

/// `[actuator.hardware_like]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HardwareLikeConfig {
    /// Share of the no-load speed up to which the motor gives full torque.
    pub full_torque_speed_share: f64,
    /// Time constant of the torque, s.
    pub torque_lag_s: f64,
    /// Dry friction of a joint, N m.
    pub dry_friction_nm: f64,
    /// Viscous friction of a joint, N m s/rad.
    pub viscous_friction_nm_s: f64,
    /// Whether the rotors have inertia.
    pub rotor_inertia: bool,
}

/// `[sensors]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Whether the errors below apply.
    pub enabled: bool,
    /// Standard deviation of a gyro sample, rad/s.
    pub gyro_noise_rad_s: f64,
    /// Standard deviation of the gyro's bias, rad/s.
    pub gyro_bias_rad_s: f64,
    /// Standard deviation of an accelerometer sample, m/s^2.
    pub accel_noise_m_s2: f64,
    /// Standard deviation of the accelerometer's bias, m/s^2.
    pub accel_bias_m_s2: f64,
    /// Standard deviation of the orientation's drift, rad.
    pub orientation_noise_rad: f64,
    /// Resolution of the joint angles, rad.
    pub encoder_step_rad: f64,
    /// Standard deviation of the joint velocities, rad/s.
    pub joint_velocity_noise_rad_s: f64,
    /// Standard deviation of the foot forces, N.
    pub foot_force_noise_n: f64,
    /// Resolution of the foot forces, N.
    pub foot_force_step_n: f64,
    /// Delay of a state, ms.
    pub delay_ms: u32,
}

/// `[emulator]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmulatorConfig {
    /// Time without a command after which the motors brake, ms.
    pub command_timeout_ms: u32,
    /// Damping of a motor that is not in servo mode, N m s/rad.
    pub braking_kd: f64,
    /// Duration of a restart, ms.
    pub reboot_ms: u32,
    /// Length of a state datagram, bytes.
    pub state_length: usize,
    /// Temperature of the motors, degrees Celsius.
    pub motor_temperature_c: f64,
    /// SimState of charge of the battery, percent.
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
        key: &'static str,
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
    ///
    /// # Errors
    /// A key is unknown or missing, or a value is out of range.
    pub fn from_toml(text: &str) -> Result<SimConfig, SimError> {
        let config: SimConfig = toml::from_str(text).map_err(|e| SimError::Syntax { reason: e.to_string() })?;
        config.check()?;
        Ok(config)
    }

    /// Checks that every value is in its range.
    ///
    /// # Errors
    /// The first value that is not.
    pub fn check(&self) -> Result<(), SimError> {
        const POSITIVE: &str = "give a number greater than zero";
        const NOT_NEGATIVE: &str = "give zero or more";
        const SHARE: &str = "give a share, 0 to 1";
        let check = |key, value: f64, range: bool, remedy| {
            if range && value.is_finite() { Ok(()) } else { Err(SimError::Value { key, value, remedy }) }
        };
        let positive = |key, value: f64| check(key, value, value > 0.0, POSITIVE);
        let not_negative = |key, value: f64| check(key, value, value >= 0.0, NOT_NEGATIVE);
        let share = |key, value: f64| check(key, value, (0.0..=1.0).contains(&value), SHARE);
        let count =
            |key, value: u32, most: u32, remedy| check(key, f64::from(value), (1..=most).contains(&value), remedy);

        count("step.contact_substeps", self.step.contact_substeps, 100, "give 1 to 100")?;
        count("step.flight_substeps", self.step.flight_substeps, 100, "give 1 to 100")?;
        positive("solver.tolerance_m_s", self.solver.tolerance_m_s)?;
        count("solver.max_sweeps", self.solver.max_sweeps, 10_000, "give 1 to 10000")?;
        share("solver.penetration_recovery", self.solver.penetration_recovery)?;

        not_negative("contact.slip_time_s", self.contact.slip_time_s)?;

        let terrain = &self.terrain;
        not_negative("terrain.friction", terrain.friction)?;
        let angle = terrain.slope.angle_rad;
        check("terrain.slope.angle_rad", angle, (0.0..1.5).contains(&angle), "give 0 to 1.5 rad")?;
        check("terrain.slope.heading_rad", terrain.slope.heading_rad, true, "give an angle")?;
        positive("terrain.steps.rise_m", terrain.steps.rise_m)?;
        positive("terrain.steps.run_m", terrain.steps.run_m)?;
        check("terrain.steps.start_m", terrain.steps.start_m, true, "give a finite number")?;
        count("terrain.steps.count", terrain.steps.count, 100, "give 1 to 100")?;
        let blocks = &terrain.blocks;
        count("terrain.blocks.count", blocks.count, 500, "give 1 to 500")?;
        count("terrain.blocks.layers", blocks.layers, 10, "give 1 to 10")?;
        positive("terrain.blocks.thickness_m", blocks.thickness_m)?;
        positive("terrain.blocks.edge_m", blocks.edge_m[0])?;
        let ordered = blocks.edge_m[1] >= blocks.edge_m[0];
        check("terrain.blocks.edge_m", blocks.edge_m[1], ordered, "give the shorter edge first")?;
        not_negative("terrain.blocks.reach_m", blocks.reach_m)?;
        not_negative("terrain.blocks.friction", blocks.friction)?;
        positive("terrain.blocks.mass_kg", blocks.mass_kg)?;
        not_negative("terrain.blocks.floor_friction", blocks.floor_friction)?;

        let motor = &self.actuator.hardware_like;
        let full = motor.full_torque_speed_share;
        check("actuator.hardware_like.full_torque_speed_share", full, (0.0..1.0).contains(&full), "give 0 to 0.99")?;
        not_negative("actuator.hardware_like.torque_lag_s", motor.torque_lag_s)?;
        not_negative("actuator.hardware_like.dry_friction_nm", motor.dry_friction_nm)?;
        not_negative("actuator.hardware_like.viscous_friction_nm_s", motor.viscous_friction_nm_s)?;

        let sensors = &self.sensors;
        not_negative("sensors.gyro_noise_rad_s", sensors.gyro_noise_rad_s)?;
        not_negative("sensors.gyro_bias_rad_s", sensors.gyro_bias_rad_s)?;
        not_negative("sensors.accel_noise_m_s2", sensors.accel_noise_m_s2)?;
        not_negative("sensors.accel_bias_m_s2", sensors.accel_bias_m_s2)?;
        not_negative("sensors.orientation_noise_rad", sensors.orientation_noise_rad)?;
        not_negative("sensors.encoder_step_rad", sensors.encoder_step_rad)?;
        not_negative("sensors.joint_velocity_noise_rad_s", sensors.joint_velocity_noise_rad_s)?;
        not_negative("sensors.foot_force_noise_n", sensors.foot_force_noise_n)?;
        not_negative("sensors.foot_force_step_n", sensors.foot_force_step_n)?;
        let delay = f64::from(sensors.delay_ms);
        check("sensors.delay_ms", delay, sensors.delay_ms <= 20, "give 0 to 20 ms")?;

        let emulator = &self.emulator;
        let ms = "give 1 to 60000 ms";
        count("emulator.command_timeout_ms", emulator.command_timeout_ms, 60_000, ms)?;
        count("emulator.reboot_ms", emulator.reboot_ms, 60_000, ms)?;
        not_negative("emulator.braking_kd", emulator.braking_kd)?;
        let length = emulator.state_length;
        check("emulator.state_length", length as f64, (807..=1400).contains(&length), "give 807 to 1400 bytes")?;
        let temperature = emulator.motor_temperature_c;
        let known = (-40.0..=120.0).contains(&temperature);
        check("emulator.motor_temperature_c", temperature, known, "give -40 to 120 degrees Celsius")?;
        let charge = emulator.battery_percent;
        check("emulator.battery_percent", charge, (0.0..=100.0).contains(&charge), "give 0 to 100 percent")
    }
}
