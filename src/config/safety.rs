//! `safety.toml` as values, and what must be true of them.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{Config, ConfigError};
use crate::control::settings::{ApprovalLimits, ArmingLimits, FailsafeLimits, FallLimits, GateLimits};

/// `safety.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SafetyFile {
    /// When the robot counts as fallen.
    pub fall: FallLimits,
    /// The last gate.
    pub gate: GateLimits,
    /// What must hold before the robot is energised.
    pub pre_arm: ArmingLimits,
    /// How long an approval holds.
    pub approval: ApprovalLimits,
    /// What trips the watchdog.
    pub watchdog: FailsafeLimits,
    /// The widest bounds of each parameter.
    pub parameters: BTreeMap<String, [f64; 2]>,
    /// The range of each gain of the controller.
    pub gains: BTreeMap<String, [f64; 2]>,
}

const FILE: &str = "safety.toml";

impl Config {
    pub(super) fn check_safety(&self) -> Result<(), ConfigError> {
        let SafetyFile { fall, gate, pre_arm, approval, watchdog, parameters, gains } = &self.safety;
        let positive = [
            ("fall.roll_rad", fall.roll_rad),
            ("fall.pitch_rad", fall.pitch_rad),
            ("fall.body_contact_s", fall.body_contact_s),
            ("fall.simulator_flight_rad", fall.simulator_flight_rad),
            ("fall.hardware_flight_rad", fall.hardware_flight_rad),
            ("gate.torque_step_nm", gate.torque_step_nm),
            ("gate.kp_max", gate.kp_max),
            ("gate.kd_max", gate.kd_max),
            ("gate.damping_kd", gate.damping_kd),
            ("pre_arm.state_age_ms", f64::from(pre_arm.state_age_ms)),
            ("pre_arm.tilt_rad", pre_arm.tilt_rad),
            ("pre_arm.lying_tolerance_rad", pre_arm.lying_tolerance_rad),
            ("pre_arm.motor_c", pre_arm.motor_c),
            ("pre_arm.gyro_rad_s", pre_arm.gyro_rad_s),
            ("pre_arm.still_s", pre_arm.still_s),
            ("pre_arm.late_ms", pre_arm.late_ms),
            ("pre_arm.area_clear_s", pre_arm.area_clear_s),
            ("approval.expires_s", approval.expires_s),
            ("watchdog.stance_tilt_rad", watchdog.stance_tilt_rad),
            ("watchdog.tilt_rad", watchdog.tilt_rad),
            ("watchdog.state_age_warn_ms", f64::from(watchdog.state_age_warn_ms)),
            ("watchdog.state_age_ms", f64::from(watchdog.state_age_ms)),
            ("watchdog.link_lost_ms", f64::from(watchdog.link_lost_ms)),
            ("watchdog.motor_warm_c", watchdog.motor_warm_c),
            ("watchdog.motor_c", watchdog.motor_c),
            ("watchdog.period_ticks", f64::from(watchdog.period_ticks)),
            ("watchdog.operator_warn_ms", f64::from(watchdog.operator_warn_ms)),
            ("watchdog.operator_silent_ms", f64::from(watchdog.operator_silent_ms)),
            ("watchdog.land_s", watchdog.land_s),
        ];
        self.all_positive(FILE, &positive.map(|(key, value)| (key.to_owned(), value)))?;
        for (key, value) in [
            ("pre_arm.loss_share", pre_arm.loss_share),
            ("pre_arm.joint_margin_rad", pre_arm.joint_margin_rad),
            ("pre_arm.battery_percent", pre_arm.battery_percent),
            ("pre_arm.late_share", pre_arm.late_share),
            ("watchdog.joint_margin_rad", watchdog.joint_margin_rad),
            ("watchdog.battery_percent", watchdog.battery_percent),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(self.refuse(FILE, key, value, "must be 0 or more"));
            }
        }
        for (key, value, meaning) in [
            ("watchdog.simulator_late_ms", watchdog.simulator_late_ms, "milliseconds, or 0 to only count"),
            ("watchdog.hardware_late_ms", watchdog.hardware_late_ms, "milliseconds, or 0 to only count"),
            ("watchdog.simulator_idle_s", watchdog.simulator_idle_s, "seconds, or 0 for never"),
            ("watchdog.hardware_idle_s", watchdog.hardware_idle_s, "seconds, or 0 for never"),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(self.refuse(FILE, key, value, format!("must be a number of {meaning}")));
            }
        }
        for (key, value) in [
            ("watchdog.velocity_factor", watchdog.velocity_factor),
            ("watchdog.torque_factor", watchdog.torque_factor),
            ("watchdog.period_factor", watchdog.period_factor),
        ] {
            if !(value >= 1.0 && value.is_finite()) {
                return Err(self.refuse(FILE, key, value, "must be 1 or more: below, it trips on what is allowed"));
            }
        }
        if gate.damping_kd > gate.kd_max {
            let reason = format!("is above gate.kd_max = {}: the stop itself would be cut", gate.kd_max);
            return Err(self.refuse(FILE, "gate.damping_kd", gate.damping_kd, reason));
        }
        // What only warns must come before what stops.
        for (key, value, stops, limit) in [
            ("watchdog.motor_warm_c", watchdog.motor_warm_c, "watchdog.motor_c", watchdog.motor_c),
            (
                "watchdog.state_age_ms",
                f64::from(watchdog.state_age_ms),
                "watchdog.link_lost_ms",
                f64::from(watchdog.link_lost_ms),
            ),
            (
                "watchdog.state_age_warn_ms",
                f64::from(watchdog.state_age_warn_ms),
                "watchdog.state_age_ms",
                f64::from(watchdog.state_age_ms),
            ),
            ("watchdog.stance_tilt_rad", watchdog.stance_tilt_rad, "watchdog.tilt_rad", watchdog.tilt_rad),
            ("fall.roll_rad", fall.roll_rad, "watchdog.tilt_rad", watchdog.tilt_rad),
            ("fall.pitch_rad", fall.pitch_rad, "watchdog.tilt_rad", watchdog.tilt_rad),
        ] {
            if value > limit {
                return Err(self.refuse(FILE, key, value, format!("must not be above {stops} = {limit}")));
            }
        }
        for (name, [low, high]) in gains {
            if !(low.is_finite() && high.is_finite() && low <= high && *low >= 0.0) {
                let reason = "must be [lowest, highest] with 0 <= lowest <= highest";
                return Err(self.refuse(FILE, &format!("gains.{name}"), format!("[{low}, {high}]"), reason));
            }
        }
        for (name, [low, high]) in parameters {
            if !(low.is_finite() && high.is_finite() && low < high && *low >= 0.0) {
                let reason = "must be [lowest, highest] with 0 <= lowest < highest";
                return Err(self.refuse(FILE, &format!("parameters.{name}"), format!("[{low}, {high}]"), reason));
            }
        }
        Ok(())
    }
}
