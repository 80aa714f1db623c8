//! Allowed ranges of single numbers in a configuration file, as tables; the table of `config/simulator.toml`.

use toml::{Table, Value};

/// Allowed numbers: finite ones from a least to a greatest, both included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NumberRange {
    /// Least number.
    pub least: f64,
    /// Greatest number.
    pub most: f64,
    /// Unit, with a remark in parentheses where one is needed; empty without one.
    pub unit: &'static str,
    /// Description for a message.
    pub text: &'static str,
}

impl NumberRange {
    /// Whether a number is allowed.
    pub fn allows(&self, value: f64) -> bool {
        (self.least..=self.most).contains(&value)
    }
}

/// A range from a least to a greatest number, both included, with their unit.
macro_rules! within {
    ($least:expr, $most:expr) => {
        $crate::sim::ranges::NumberRange {
            least: $least as f64,
            most: $most as f64,
            unit: "",
            text: concat!("must be ", stringify!($least), " to ", stringify!($most)),
        }
    };
    ($least:expr, $most:expr, $unit:literal) => {
        $crate::sim::ranges::NumberRange {
            least: $least as f64,
            most: $most as f64,
            unit: $unit,
            text: concat!("must be ", stringify!($least), " to ", stringify!($most), " ", $unit),
        }
    };
}
pub(crate) use within;

/// Keys with their tables, and their range. `*` stands for any name.
pub type Row = (&'static [&'static str], NumberRange);

/// `config/simulator.toml`; the first row that fits applies. Beyond these ranges the equations of motion overflow, or a trial
/// takes minutes.
pub const SIMULATOR: &[Row] = &[
    (&["step.*", "terrain.steps.count"], within!(1, 100)),
    (&["solver.tolerance_m_s"], within!(1e-15, 0.01, "m/s")),
    (&["solver.max_sweeps"], within!(1, 10000)),
    (&["solver.penetration_recovery"], within!(0, 1)),
    (&["contact.slip_time_s"], within!(0, 1, "s")),
    (&["terrain.friction", "terrain.friction_range"], within!(0, 10)),
    (&["terrain.blocks.friction", "terrain.blocks.friction_range", "terrain.blocks.floor_friction"], within!(0, 10)),
    (&["terrain.slope.angle_rad"], within!(0, 1.49, "rad")),
    (&["terrain.slope.heading_rad"], within!(-100, 100, "rad")),
    (&["terrain.steps.rise_m"], within!(1e-4, 1, "m")),
    (&["terrain.steps.run_m"], within!(0.01, 100, "m")),
    (&["terrain.steps.start_m"], within!(-100, 100, "m")),
    (&["terrain.blocks.count"], within!(1, 10000)),
    (&["terrain.blocks.layers"], within!(1, 10)),
    (&["terrain.blocks.thickness_m"], within!(1e-4, 0.5, "m")),
    (&["terrain.blocks.edge_m"], within!(0.01, 10, "m")),
    (&["terrain.blocks.reach_m"], within!(0, 100, "m")),
    (&["terrain.blocks.area_m"], within!(-100, 100, "m")),
    (&["terrain.blocks.mass_kg"], within!(0.001, 100, "kg")),
    (&["actuator.hardware_like.full_torque_speed_share"], within!(0, 0.99)),
    (&["actuator.hardware_like.torque_lag_s"], within!(0, 1, "s")),
    (&["actuator.hardware_like.dry_friction_nm"], within!(0, 100, "N m")),
    (&["actuator.hardware_like.viscous_friction_nm_s"], within!(0, 100, "N m s/rad")),
    (&["sensors.gyro_noise_rad_s", "sensors.gyro_bias_rad_s"], within!(0, 10, "rad/s")),
    (&["sensors.accel_noise_m_s2", "sensors.accel_bias_m_s2"], within!(0, 100, "m/s^2")),
    (&["sensors.orientation_noise_rad"], within!(0, 1, "rad")),
    (&["sensors.encoder_step_rad"], within!(0, 0.1, "rad")),
    (&["sensors.joint_velocity_noise_rad_s"], within!(0, 100, "rad/s")),
    (&["sensors.foot_force_noise_n", "sensors.foot_force_step_n"], within!(0, 1000, "N")),
    (&["sensors.delay_ms"], within!(0, 20, "ms")),
    (&["emulator.command_timeout_ms", "emulator.reboot_ms"], within!(1, 60000, "ms")),
    (&["emulator.braking_kd"], within!(0, 100, "N m s/rad")),
    (&["emulator.state_length"], within!(807, 1400, "bytes")),
    (&["emulator.motor_temperature_c"], within!(-40, 120, "degrees Celsius")),
    (&["emulator.battery_percent"], within!(0, 100, "percent")),
];

/// Returns the first number of `table` out of its range in `rows`, with its key and the description of the range.
pub fn first_outside(rows: &'static [Row], table: &Table) -> Option<(String, f64, &'static str)> {
    numbers(table, "").into_iter().find_map(|(key, value)| {
        let range = range(rows, &key)?;
        (!range.allows(value)).then_some((key, value, range.text))
    })
}

/// Returns the range of `key`; none if no row fits.
pub fn range(rows: &'static [Row], key: &str) -> Option<&'static NumberRange> {
    let fits = |pattern: &&str| {
        pattern.split('.').count() == key.split('.').count()
            && pattern.split('.').zip(key.split('.')).all(|(pattern, name)| pattern == "*" || pattern == name)
    };
    rows.iter().find(|(keys, _)| keys.iter().any(&fits)).map(|(_, range)| range)
}

/// Returns the numbers by their key with its tables; those of a list have the key of the list.
pub fn numbers(table: &Table, tables: &str) -> Vec<(String, f64)> {
    let mut found = Vec::new();
    for (name, value) in table {
        collect(&format!("{tables}{name}"), value, &mut found);
    }
    found
}

fn collect(key: &str, value: &Value, found: &mut Vec<(String, f64)>) {
    match value {
        Value::Integer(value) => found.push((key.to_owned(), *value as f64)),
        Value::Float(value) => found.push((key.to_owned(), *value)),
        Value::Table(inner) => found.extend(numbers(inner, &format!("{key}."))),
        Value::Array(list) => list.iter().for_each(|item| collect(key, item, found)),
        Value::String(_) | Value::Boolean(_) | Value::Datetime(_) => {}
    }
}
