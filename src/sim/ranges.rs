//! Allowed ranges of single numbers in a configuration file, as tables; the table of `config/simulator.toml`.

use toml::{Table, Value};

/// Allowed numbers, all finite, and their description for the message.
pub struct NumberRange {
    pub allows: fn(f64) -> bool,
    pub text: &'static str,
}

/// Keys with their tables, and their range. `*` stands for any name.
pub type Row = (&'static [&'static str], NumberRange);

pub const POSITIVE: NumberRange = NumberRange { allows: |v| v > 0.0, text: "must be a number above 0" };
pub const NOT_NEGATIVE: NumberRange = NumberRange { allows: |v| v >= 0.0, text: "must be 0 or more" };
const FINITE: NumberRange = NumberRange { allows: |_| true, text: "must be a finite number" };
const SHARE: NumberRange = NumberRange { allows: |v| (0.0..=1.0).contains(&v), text: "must be a share, 0 to 1" };
const TO_10: NumberRange = NumberRange { allows: |v| (1.0..=10.0).contains(&v), text: "must be 1 to 10" };
const TO_100: NumberRange = NumberRange { allows: |v| (1.0..=100.0).contains(&v), text: "must be 1 to 100" };
const TO_500: NumberRange = NumberRange { allows: |v| (1.0..=500.0).contains(&v), text: "must be 1 to 500" };
const TO_10000: NumberRange = NumberRange { allows: |v| (1.0..=10_000.0).contains(&v), text: "must be 1 to 10000" };
const SLOPE: NumberRange = NumberRange { allows: |v| (0.0..1.5).contains(&v), text: "must be 0 to 1.5 rad" };
const SPEED_SHARE: NumberRange = NumberRange { allows: |v| (0.0..1.0).contains(&v), text: "must be 0 to 0.99" };
const DELAY: NumberRange = NumberRange { allows: |v| (0.0..=20.0).contains(&v), text: "must be 0 to 20 ms" };
const TIMEOUT: NumberRange = NumberRange { allows: |v| (1.0..=6e4).contains(&v), text: "must be 1 to 60000 ms" };
const LENGTH: NumberRange =
    NumberRange { allows: |v| (807.0..=1400.0).contains(&v), text: "must be 807 to 1400 bytes" };
const TEMPERATURE: NumberRange =
    NumberRange { allows: |v| (-40.0..=120.0).contains(&v), text: "must be -40 to 120 degrees Celsius" };
const CHARGE: NumberRange = NumberRange { allows: |v| (0.0..=100.0).contains(&v), text: "must be 0 to 100 percent" };

/// `config/simulator.toml`; the first row that fits applies.
pub const SIMULATOR: &[Row] = &[
    (&["step.*", "terrain.steps.count"], TO_100),
    (&["solver.tolerance_m_s", "terrain.steps.rise_m", "terrain.steps.run_m"], POSITIVE),
    (&["solver.max_sweeps"], TO_10000),
    (&["solver.penetration_recovery"], SHARE),
    (&["terrain.slope.angle_rad"], SLOPE),
    (&["terrain.slope.heading_rad", "terrain.steps.start_m"], FINITE),
    (&["terrain.blocks.count"], TO_500),
    (&["terrain.blocks.layers"], TO_10),
    (&["terrain.blocks.thickness_m", "terrain.blocks.mass_kg"], POSITIVE),
    (&["actuator.hardware_like.full_torque_speed_share"], SPEED_SHARE),
    (&["sensors.delay_ms"], DELAY),
    (&["emulator.command_timeout_ms", "emulator.reboot_ms"], TIMEOUT),
    (&["emulator.state_length"], LENGTH),
    (&["emulator.motor_temperature_c"], TEMPERATURE),
    (&["emulator.battery_percent"], CHARGE),
    (&["*.*", "terrain.blocks.*", "actuator.hardware_like.*"], NOT_NEGATIVE),
];

/// Returns the first number of `table` out of its range in `rows`, with its key and the description of the range.
pub fn first_outside(rows: &'static [Row], table: &Table) -> Option<(String, f64, &'static str)> {
    numbers(table, "").into_iter().find_map(|(key, value)| {
        let range = range(rows, &key)?;
        (!(value.is_finite() && (range.allows)(value))).then_some((key, value, range.text))
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

/// Returns the numbers outside of lists, by their key with its tables.
pub fn numbers(table: &Table, tables: &str) -> Vec<(String, f64)> {
    let mut found = Vec::new();
    for (name, value) in table {
        let key = format!("{tables}{name}");
        match value {
            Value::Integer(value) => found.push((key, *value as f64)),
            Value::Float(value) => found.push((key, *value)),
            Value::Table(inner) => found.extend(numbers(inner, &format!("{key}."))),
            _ => {}
        }
    }
    found
}
