//! Allowed range of every single number in the files. Rules between keys are in `rules.rs`.

use toml::{Table, Value};

use super::ConfigError;
use super::merge::FileOrigin;

/// Allowed numbers, all finite, and their description for the message.
struct NumberRange {
    allows: fn(f64) -> bool,
    text: &'static str,
}

const POSITIVE: NumberRange = NumberRange { allows: |v| v > 0.0, text: "must be a number above 0" };
const NOT_NEGATIVE: NumberRange = NumberRange { allows: |v| v >= 0.0, text: "must be 0 or more" };
const LATENESS: NumberRange =
    NumberRange { allows: |v| v >= 0.0, text: "must be a number of milliseconds, or 0 to only count" };
const IDLE_TIME: NumberRange =
    NumberRange { allows: |v| v >= 0.0, text: "must be a number of seconds, or 0 for never" };
const FACTOR: NumberRange =
    NumberRange { allows: |v| v >= 1.0, text: "must be 1 or more: below 1 it trips on allowed values" };
const COUNTDOWN: NumberRange = NumberRange { allows: |v| (0.0..=60.0).contains(&v), text: "must be 0 to 60 s" };
/// At 1 rad/s the force is then half of that of the stiffness at a tilt of 1 rad.
const ATTITUDE_RATE_GAIN: NumberRange =
    NumberRange { allows: |v| (0.0..=100.0).contains(&v), text: "must be 0 to 100 N s/m" };
/// At 1 m/s the foot is then placed 0.3 m ahead, the end of the leg's reach.
const FOOT_PLACEMENT: NumberRange = NumberRange { allows: |v| (0.0..=0.3).contains(&v), text: "must be 0 to 0.3 s" };
const JUMPS: NumberRange = NumberRange { allows: |v| (1.0..=100.0).contains(&v), text: "must be 1 to 100 jumps" };
const PRIORITY: NumberRange =
    NumberRange { allows: |v| (0.0..=99.0).contains(&v), text: "must be 1 to 99, or 0 to request none" };
const CORE: NumberRange =
    NumberRange { allows: |v| v >= -1.0, text: "must be the number of a core, from 0, or -1 for any" };
const TRIALS: NumberRange = NumberRange { allows: |v| v >= 1.0, text: "a study needs at least one trial" };
const CONTENDERS: NumberRange = NumberRange { allows: |v| (2.0..=10.0).contains(&v), text: "must be 2 to 10 points" };
const CONFIDENCE: NumberRange = NumberRange { allows: |v| v > 0.5 && v < 1.0, text: "must be above 0.5 and below 1" };

/// File, keys and their range. `*` stands for any name; the first row that fits applies.
const RANGES: [(&str, &[&str], NumberRange); 17] = [
    ("control.toml", &["countdown.simulator_s"], COUNTDOWN),
    ("control.toml", &["tasks.*.jumps"], JUMPS),
    ("control.toml", &["tasks.*.attitude_rate_gain"], ATTITUDE_RATE_GAIN),
    ("control.toml", &["tasks.*.foot_placement_s"], FOOT_PLACEMENT),
    ("control.toml", &["tasks.*.f1_hz"], NOT_NEGATIVE),
    ("control.toml", &["realtime.hardware_priority", "realtime.simulator_priority"], PRIORITY),
    ("control.toml", &["realtime.core"], CORE),
    ("control.toml", &["stand_up.*", "sit_down.*", "countdown.*", "settle.*", "contact.*", "estimator.*"], POSITIVE),
    (
        "safety.toml",
        &["*.corrupt", "*.disk_free_mb", "*.joint_margin_rad", "*.battery_percent", "*.loss_share", "*.late_share"],
        NOT_NEGATIVE,
    ),
    ("safety.toml", &["watchdog.simulator_late_ms", "watchdog.hardware_late_ms"], LATENESS),
    ("safety.toml", &["watchdog.simulator_idle_s", "watchdog.hardware_idle_s"], IDLE_TIME),
    ("safety.toml", &["watchdog.velocity_factor", "watchdog.torque_factor", "watchdog.period_factor"], FACTOR),
    ("safety.toml", &["*.*"], POSITIVE),
    ("optimize.toml", &["workers.abandoned_s"], POSITIVE),
    ("optimize.toml", &["trials"], TRIALS),
    ("optimize.toml", &["confirm.contenders"], CONTENDERS),
    ("optimize.toml", &["confirm.confidence"], CONFIDENCE),
];

/// Checks every number of `file` against [`RANGES`].
///
/// # Errors
/// [`ConfigError::Value`] of the first number out of its range.
pub fn check(file: &str, table: &Table, origin: &FileOrigin) -> Result<(), ConfigError> {
    for (key, value) in numbers(table, "") {
        if let Some(range) = range(file, &key)
            && !(value.is_finite() && (range.allows)(value))
        {
            return Err(origin.refuse(&key, value, range.text));
        }
    }
    Ok(())
}

fn range(file: &str, key: &str) -> Option<&'static NumberRange> {
    let fits = |pattern: &&str| {
        pattern.split('.').count() == key.split('.').count()
            && pattern.split('.').zip(key.split('.')).all(|(pattern, name)| pattern == "*" || pattern == name)
    };
    RANGES.iter().find(|(known, keys, _)| *known == file && keys.iter().any(&fits)).map(|(.., range)| range)
}

/// Returns the numbers outside of lists, by their key with its tables.
fn numbers(table: &Table, tables: &str) -> Vec<(String, f64)> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Gains have their ranges in `safety.toml`; the sampler's numbers are whole and may all be given.
    #[test]
    fn every_number_of_the_defaults_has_a_range() {
        let files = [
            ("control.toml", include_str!("../../config/control.toml")),
            ("safety.toml", include_str!("../../config/safety.toml")),
            ("optimize.toml", include_str!("../../config/optimize.toml")),
        ];
        for (file, text) in files {
            for (key, _) in numbers(&text.parse().unwrap(), "") {
                let elsewhere = ["kp", "kd", "kd_joint", "k_att"].iter().any(|gain| key.ends_with(&format!(".{gain}")));
                assert!(elsewhere || key.starts_with("sampler.") || range(file, &key).is_some(), "{file}: `{key}`");
            }
        }
    }
}
