//! Allowed range of every single number in the files; that of `simulator.toml` is in `crate::sim::ranges`, because a
//! simulator checks it, too. Rules between keys are in `rules.rs`.

use toml::Table;

use super::ConfigError;
use super::merge::FileOrigin;
use crate::sim::ranges::{NOT_NEGATIVE, NumberRange, POSITIVE, Row, first_outside};

const LATENESS: NumberRange =
    NumberRange { allows: |v| v >= 0.0, text: "must be a number of milliseconds, or 0 to only count" };
const IDLE_TIME: NumberRange =
    NumberRange { allows: |v| v >= 0.0, text: "must be a number of seconds, or 0 for never" };
const FACTOR: NumberRange =
    NumberRange { allows: |v| v >= 1.0, text: "must be 1 or more: below 1 it trips on allowed values" };
/// Below 0.2 s a slow disk would refuse every approval.
const KEY_PRESS: NumberRange = NumberRange { allows: |v| (0.2..=30.0).contains(&v), text: "must be 0.2 to 30 s" };
const SHARE: NumberRange = NumberRange { allows: |v| v > 0.0 && v <= 1.0, text: "must be above 0, at most 1" };
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
const LEAST_FORCE: NumberRange =
    NumberRange { allows: |v| (0.2..=1.0).contains(&v), text: "must be 0.2 to 1 times the weight" };
const MOST_FORCE: NumberRange =
    NumberRange { allows: |v| (1.0..=3.0).contains(&v), text: "must be 1 to 3 times the weight" };
const READY_TILT: NumberRange =
    NumberRange { allows: |v| v > 0.0 && v <= 0.35, text: "must be above 0 and at most 0.35 rad" };
const READY_STANCE: NumberRange =
    NumberRange { allows: |v| v > 0.0 && v <= 0.5, text: "must be above 0 and at most 0.5 rad" };
const CLOCK_DRIFT: NumberRange =
    NumberRange { allows: |v| (0.0..=1000.0).contains(&v), text: "must be 0 to 1000 parts per million" };
const DELAY_GROWTH: NumberRange =
    NumberRange { allows: |v| v > 0.0 && v <= 50.0, text: "must be above 0 and at most 50 ms" };
const LOSS: NumberRange = NumberRange { allows: |v| v > 0.0 && v <= 0.5, text: "must be above 0 and at most 0.5" };
const TAKEOFF_SPEED: NumberRange = NumberRange { allows: |v| (0.1..=2.0).contains(&v), text: "must be 0.1 to 2 m/s" };
const HOLD_TIME: NumberRange = NumberRange { allows: |v| (0.1..=1.5).contains(&v), text: "must be 0.1 to 1.5 s" };
const HOLD_KP: NumberRange = NumberRange { allows: |v| (20.0..=100.0).contains(&v), text: "must be 20 to 100 N m/rad" };
const HOLD_KD: NumberRange = NumberRange { allows: |v| (1.0..=5.0).contains(&v), text: "must be 1 to 5 N m s/rad" };
const RAMP: NumberRange = NumberRange { allows: |v| (0.02..=1.0).contains(&v), text: "must be 0.02 to 1" };
const BLEND: NumberRange = NumberRange { allows: |v| (0.1..=5.0).contains(&v), text: "must be 0.1 to 5 s" };

const REPEATED_STATES: NumberRange =
    NumberRange { allows: |v| (10.0..=200.0).contains(&v), text: "must be 10 to 200 states" };
const GRAVITY_ERROR: NumberRange =
    NumberRange { allows: |v| (0.1..=3.0).contains(&v), text: "must be 0.1 to 3 m/s^2: gravity is 9.81" };
const SENSOR_ANGLE: NumberRange =
    NumberRange { allows: |v| (0.01..=0.3).contains(&v), text: "must be 0.01 to 0.3 rad: a robot tips beyond" };
const LEAST_LOAD: NumberRange =
    NumberRange { allows: |v| (0.05..=0.9).contains(&v), text: "must be 0.05 to 0.9 of the weight" };
const MOST_LOAD: NumberRange = NumberRange { allows: |v| (1.1..=3.0).contains(&v), text: "must be 1.1 to 3 weights" };
const CONTACT_TIME: NumberRange =
    NumberRange { allows: |v| (0.02..=1.0).contains(&v), text: "must be 0.02 to 1 s: a flight lasts half a second" };
const FREE_FALL: NumberRange = NumberRange {
    allows: |v| (0.5..=5.0).contains(&v),
    text: "must be 0.5 to 5 m/s^2: zero in free fall, 9.81 at rest",
};
const CLOCK_STEP: NumberRange = NumberRange { allows: |v| (20.0..=1000.0).contains(&v), text: "must be 20 to 1000 ms" };
const IN_SERVICE_LOSS: NumberRange =
    NumberRange { allows: |v| (0.005..=0.5).contains(&v), text: "must be 0.005 to 0.5 of the states" };
const TORQUE_ERROR: NumberRange = NumberRange { allows: |v| (0.5..=20.0).contains(&v), text: "must be 0.5 to 20 N m" };

const CONTROL: &[Row] = &[
    (&["countdown.simulator_s"], COUNTDOWN),
    (&["countdown.blend_s"], BLEND),
    (&["tasks.*.jumps"], JUMPS),
    (&["tasks.*.attitude_rate_gain"], ATTITUDE_RATE_GAIN),
    (&["tasks.*.foot_placement_s"], FOOT_PLACEMENT),
    (&["tasks.*.f1_hz"], NOT_NEGATIVE),
    (&["realtime.hardware_priority", "realtime.simulator_priority"], PRIORITY),
    (&["realtime.core"], CORE),
    (&["stand_up.*", "sit_down.*", "countdown.*", "settle.*", "contact.*", "estimator.*"], POSITIVE),
];
const SAFETY: &[Row] = &[
    (&["consistency.repeated_states"], REPEATED_STATES),
    (&["consistency.gravity_m_s2", "pre_arm.gravity_m_s2"], GRAVITY_ERROR),
    (
        &[
            "consistency.orientation_rad",
            "consistency.turn_rad",
            "consistency.joint_velocity_rad",
            "pre_arm.gravity_rad",
        ],
        SENSOR_ANGLE,
    ),
    (&["consistency.foot_load_least_share"], LEAST_LOAD),
    (&["consistency.foot_load_most_share", "pre_arm.foot_load_share"], MOST_LOAD),
    (&["consistency.foot_load_s", "consistency.free_fall_contact_s", "consistency.unsupported_s"], CONTACT_TIME),
    (&["consistency.free_fall_m_s2"], FREE_FALL),
    (&["consistency.clock_step_ms"], CLOCK_STEP),
    (&["consistency.loss_share"], IN_SERVICE_LOSS),
    (&["consistency.torque_n_m"], TORQUE_ERROR),
    (
        &["*.corrupt", "*.disk_free_mb", "*.joint_margin_rad", "*.battery_percent", "*.loss_share", "*.late_share"],
        NOT_NEGATIVE,
    ),
    (&["approval.expires_s"], KEY_PRESS),
    (&["hop_envelope.*"], SHARE),
    (&["watchdog.simulator_late_ms", "watchdog.hardware_late_ms"], LATENESS),
    (&["watchdog.simulator_idle_s", "watchdog.hardware_idle_s"], IDLE_TIME),
    (&["watchdog.velocity_factor", "watchdog.torque_factor", "watchdog.period_factor"], FACTOR),
    (&["ready.force_share_min"], LEAST_FORCE),
    (&["ready.force_share_max"], MOST_FORCE),
    (&["ready.tilt_rad"], READY_TILT),
    (&["ready.stance_rad"], READY_STANCE),
    (&["watchdog.clock_drift_ppm"], CLOCK_DRIFT),
    (&["watchdog.delay_warn_ms", "watchdog.delay_hold_ms", "watchdog.delay_land_ms"], DELAY_GROWTH),
    (&["watchdog.loss_warn_share"], LOSS),
    (&["watchdog.takeoff_speed_m_s"], TAKEOFF_SPEED),
    (&["watchdog.hold_s"], HOLD_TIME),
    (&["watchdog.hold_kp"], HOLD_KP),
    (&["watchdog.hold_kd"], HOLD_KD),
    (&["watchdog.ramp_error_rad", "watchdog.ramp_torque_share", "watchdog.ramp_limit_s"], RAMP),
    (&["*.*"], POSITIVE),
];
const OPTIMIZE: &[Row] = &[
    (&["workers.abandoned_s"], POSITIVE),
    (&["trials"], TRIALS),
    (&["confirm.contenders"], CONTENDERS),
    (&["confirm.confidence"], CONFIDENCE),
];

/// Returns the ranges of a file's numbers; the first row that fits applies.
fn rows(file: &str) -> &'static [Row] {
    match file {
        "control.toml" => CONTROL,
        "safety.toml" => SAFETY,
        "optimize.toml" => OPTIMIZE,
        _ => &[],
    }
}

/// Checks every number of `file`.
pub fn check(file: &str, table: &Table, origin: &FileOrigin) -> Result<(), ConfigError> {
    match first_outside(rows(file), table) {
        Some((key, value, text)) => Err(origin.refuse(&key, value, text)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::ranges::{numbers, range};

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
                let known = range(rows(file), &key).is_some();
                assert!(elsewhere || key.starts_with("sampler.") || known, "{file}: `{key}`");
            }
        }
    }
}
