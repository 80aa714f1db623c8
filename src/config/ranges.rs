//! Allowed range of every single number in the files: one for every backend, within which the program works, and a narrower
//! one for hardware, compiled in: a limit that is mistyped, or copied from a simulation, does not reach a robot. The ranges
//! of `simulator.toml` are in `crate::sim::ranges`, because a simulator checks them, too. Rules between keys are in
//! `rules.rs`.

use toml::Table;

use super::ConfigError;
use super::merge::{FileOrigin, lookup};
use crate::robot::description::RobotDescription;
use crate::robot::joint_name;
use crate::sim::ranges::{NumberRange, Row, SIMULATOR, first_outside, range, within};

const CONTROL: &[Row] = &[
    (&["stand_up.duration_s", "sit_down.duration_s"], within!(0.1, 60, "s")),
    (&["stand_up.kp", "sit_down.kp"], within!(1, 1000, "N m/rad")),
    (&["stand_up.kd", "sit_down.kd"], within!(0.1, 100, "N m s/rad")),
    (&["stand_up.tolerance_rad", "sit_down.tolerance_rad"], within!(0.001, 3, "rad")),
    (&["stand_up.timeout_s", "sit_down.timeout_s"], within!(0.01, 60, "s")),
    (&["countdown.*"], within!(0, 60, "s")),
    (&["settle.quiet_s"], within!(0.001, 60, "s")),
    (&["settle.cap_s"], within!(0.01, 60, "s")),
    (&["settle.speed_m_s"], within!(1e-4, 100, "m/s")),
    (&["settle.rate_rad_s"], within!(1e-4, 100, "rad/s")),
    (&["contact.force_n"], within!(0.001, 1000, "N")),
    (&["estimator.contact_on_n", "estimator.contact_off_n"], within!(0.001, 1000, "N")),
    (&["estimator.contact_time_s"], within!(1e-4, 1, "s")),
    (&["estimator.gate_sigma"], within!(0.1, 1000, "standard deviations")),
    (&["estimator.longest_slip_s"], within!(0.001, 60, "s")),
    (&["estimator.longest_flight_s"], within!(0.01, 60, "s")),
    (&["estimator.*"], within!(1e-9, 1000)),
    (&["realtime.hardware_priority", "realtime.simulator_priority"], within!(0, 99, "(0 requests none)")),
    (&["realtime.core"], within!(-1, 1023, "(-1 is any core)")),
    // A trial takes about 1 MB. A file of 100 GB is beyond the memory of a reader.
    (&["recording.rotate_mb"], within!(1, 100_000, "MB")),
    (&["recording.rotate_minutes"], within!(0.01, 1440, "min")),
    (&["tasks.*.stance_m"], within!(-2, 2, "m")),
    (&["tasks.*.jumps"], within!(1, 100, "jumps")),
    (&["tasks.*.repeats"], within!(1, 50, "rollouts")),
    (&["tasks.*.duration_s"], within!(0.1, 600, "s")),
    (&["tasks.*.landing_wait_s"], within!(0, 5, "s")),
    (&["tasks.*.f1_hz"], within!(0, 100, "Hz")),
    // At 1 rad/s the force is then half of that of the stiffness at a tilt of 1 rad.
    (&["tasks.*.attitude_rate_gain"], within!(0, 100, "N s/m")),
    // At 1 m/s the foot is then placed 0.3 m ahead, the end of the leg's reach.
    (&["tasks.*.foot_placement_s"], within!(0, 0.3, "s")),
    // A foot that flickers at take-off is off the ground for some milliseconds; an impulse lasts 0.3 to 0.7 s.
    (&["tasks.*.cutoff_lost_s"], within!(0.001, 0.5, "s")),
    // The hip reaches its limit 0.1 m outward of the stance.
    (&["tasks.*.landing_spread_m"], within!(0, 0.1, "m")),
    (&["tasks.*.landing_spread_s"], within!(0, 2, "s")),
    // The gains; `safety.toml`, [gains], has their narrower ranges.
    (&["tasks.*.*"], within!(0, 10000)),
    (&["*.*"], within!(1e-9, 1e6)),
];

/// `control.toml` on hardware.
const CONTROL_HARDWARE: &[Row] = &[
    // Shorter, a joint that lies folded moves faster than 6 rad/s.
    (&["stand_up.duration_s", "sit_down.duration_s"], within!(0.5, 10, "s")),
    // Below 20 the robot does not leave the ground; above 150 the gate would cut the stiffness.
    (&["stand_up.kp", "sit_down.kp"], within!(20, 150, "N m/rad")),
    (&["stand_up.kd", "sit_down.kd"], within!(0.5, 10, "N m s/rad")),
    (&["stand_up.tolerance_rad", "sit_down.tolerance_rad"], within!(0.02, 0.5, "rad")),
    (&["stand_up.timeout_s", "sit_down.timeout_s"], within!(0.1, 5, "s")),
    // Time to step back.
    (&["countdown.hardware_s"], within!(1, 60, "s")),
    (&["countdown.blend_s"], within!(0.2, 5, "s")),
    // Shorter than the estimator's contact, 2 ms, it would end the push of a foot that flickers.
    (&["tasks.*.cutoff_lost_s"], within!(0.005, 0.1, "s")),
    // A foot that is 0.24 m outward carries its share of the landing with less than the hip's largest torque.
    (&["tasks.*.landing_spread_m"], within!(0, 0.06, "m")),
    (&["tasks.*.landing_spread_s"], within!(0, 1, "s")),
    (&["settle.quiet_s"], within!(0.05, 5, "s")),
    (&["settle.cap_s"], within!(0.5, 15, "s")),
    (&["settle.speed_m_s"], within!(0.01, 0.5, "m/s")),
    (&["settle.rate_rad_s"], within!(0.01, 1, "rad/s")),
    // A series on a robot ends before its motors are warm.
    (&["tasks.*.jumps"], within!(1, 20, "jumps")),
    (&["tasks.*.duration_s"], within!(0.1, 20, "s")),
    (&["tasks.*.repeats"], within!(1, 10, "jumps of a trial")),
    (&["tasks.*.landing_wait_s"], within!(0, 2, "s")),
    // A fifteenth to three times the load of a foot in stance, 32 N.
    (&["estimator.contact_on_n", "estimator.contact_off_n"], within!(2, 100, "N")),
    (&["estimator.contact_time_s"], within!(0.001, 0.02, "s")),
    (&["estimator.longest_slip_s"], within!(0.01, 1, "s")),
    (&["estimator.longest_flight_s"], within!(0.2, 10, "s")),
];

const SAFETY: &[Row] = &[
    (&["consistency.repeated_states"], within!(10, 200, "states")),
    (&["pre_arm.motor_measured_c"], within!(-20, 10, "degrees Celsius")),
    (&["consistency.repeated_motor_states"], within!(5, 100, "states")),
    (&["consistency.accel_most_m_s2"], within!(50, 1e5, "m/s^2")),
    // Gravity is 9.81.
    (&["consistency.gravity_m_s2", "pre_arm.gravity_m_s2"], within!(0.1, 3, "m/s^2")),
    // A robot tips beyond.
    (
        &[
            "consistency.orientation_rad",
            "consistency.turn_rad",
            "consistency.joint_velocity_rad",
            "pre_arm.gravity_rad",
        ],
        within!(0.01, 0.3, "rad"),
    ),
    (&["consistency.foot_load_least_share"], within!(0.05, 0.9, "of the weight")),
    (&["consistency.foot_load_most_share", "pre_arm.foot_load_share"], within!(1.1, 3, "weights")),
    // A flight lasts half a second.
    (
        &["consistency.foot_load_s", "consistency.free_fall_contact_s", "consistency.unsupported_s"],
        within!(0.02, 1, "s"),
    ),
    // Zero in free fall, 9.81 at rest.
    (&["consistency.free_fall_m_s2"], within!(0.5, 5, "m/s^2")),
    (&["consistency.clock_step_ms"], within!(20, 1000, "ms")),
    (&["consistency.loss_share"], within!(0.005, 0.5, "of the states")),
    (&["consistency.torque_n_m"], within!(0.5, 20, "N m")),
    // Below 0.2 s a slow disk would refuse every approval.
    (&["approval.expires_s"], within!(0.2, 30, "s")),
    (&["hop_envelope.*"], within!(0.01, 1)),
    (&["fall.body_contact_s"], within!(0.001, 60, "s")),
    (&["fall.*"], within!(0.01, 3.15, "rad")),
    (&["gate.torque_step_nm"], within!(0.01, 1000, "N m")),
    // The datagram holds less than 1024 N m/rad.
    (&["gate.kp_max"], within!(1, 1000, "N m/rad")),
    (&["gate.kd_max"], within!(1, 100, "N m s/rad")),
    // In steps of 1/16 on the wire: 1 is the word 16, 0.06 would be 0, a limp robot.
    (&["gate.damping_kd"], within!(1, 50, "N m s/rad (less does not carry the robot down softly)")),
    (&["pre_arm.state_age_ms", "pre_arm.late_ms"], within!(0.01, 10000, "ms")),
    (&["pre_arm.loss_share", "pre_arm.late_share"], within!(0, 1)),
    (&["*.corrupt"], within!(0, 1e6, "datagrams")),
    (&["pre_arm.tilt_rad", "watchdog.stance_tilt_rad", "watchdog.tilt_rad"], within!(0.01, 3.15, "rad")),
    (&["*.joint_margin_rad"], within!(0, 3.15, "rad")),
    (&["pre_arm.lying_tolerance_rad"], within!(0.01, 7, "rad")),
    (&["*.battery_percent"], within!(0, 100, "percent")),
    (&["*.motor_c", "watchdog.motor_warm_c"], within!(1, 200, "degrees Celsius")),
    (&["pre_arm.gyro_rad_s"], within!(0.001, 100, "rad/s")),
    (&["pre_arm.still_s"], within!(0.01, 60, "s")),
    (&["pre_arm.area_clear_s"], within!(0.1, 86400, "s")),
    (&["*.disk_free_mb"], within!(0, 1e9, "MB")),
    (&["watchdog.velocity_factor", "watchdog.torque_factor"], within!(1, 100, "(below 1 it trips on allowed values)")),
    (&["watchdog.period_factor"], within!(1, 1000, "(below 1 it trips on allowed values)")),
    (&["watchdog.period_ticks"], within!(1, 1e6, "ticks")),
    (&["watchdog.simulator_late_ms", "watchdog.hardware_late_ms"], within!(0, 60000, "ms (0 only counts)")),
    (&["watchdog.simulator_idle_s", "watchdog.hardware_idle_s"], within!(0, 86400, "s (0 is never)")),
    (&["watchdog.land_s", "watchdog.hold_s", "watchdog.ramp_limit_s"], within!(0.01, 60, "s")),
    (&["watchdog.clock_drift_ppm"], within!(0, 10000, "parts per million")),
    (&["watchdog.delay_warn_ms", "watchdog.delay_hold_ms", "watchdog.delay_land_ms"], within!(0.1, 10000, "ms")),
    (&["watchdog.loss_warn_share", "watchdog.ramp_torque_share"], within!(0.001, 1)),
    (&["watchdog.takeoff_speed_m_s"], within!(0.05, 10, "m/s")),
    (&["watchdog.hold_kp"], within!(1, 1000, "N m/rad")),
    (&["watchdog.hold_kd"], within!(0.1, 100, "N m s/rad")),
    (&["watchdog.ramp_error_rad", "ready.tilt_rad", "ready.stance_rad"], within!(0.01, 3.15, "rad")),
    (&["ready.*"], within!(0.01, 10, "of the weight")),
    (&["watchdog.*"], within!(1, 600000, "ms")),
    (&["parameters.f0"], within!(0, 100, "Hz")),
    // As f1_hz of jumps in a row: a longer pause is none of a jump.
    (&["parameters.f1"], within!(0.05, 100, "Hz")),
    (&["parameters.*"], within!(0, 10000, "N")),
    (&["gains.*"], within!(0, 10000)),
    (&["*.*"], within!(1e-9, 1e6)),
];

/// `safety.toml` on hardware.
const SAFETY_HARDWARE: &[Row] = &[
    // Beyond 1.2 rad (69 degrees) the robot has fallen.
    (&["fall.roll_rad", "fall.pitch_rad"], within!(0.3, 1.2, "rad")),
    (&["fall.hardware_flight_rad"], within!(0.2, 1, "rad")),
    // The largest torque of a joint is 35.6 N m.
    (&["gate.torque_step_nm"], within!(5, 40, "N m")),
    (&["gate.kp_max"], within!(20, 200, "N m/rad")),
    (&["gate.kd_max"], within!(2, 20, "N m s/rad")),
    (&["gate.damping_kd"], within!(1, 10, "N m s/rad")),
    (&["pre_arm.state_age_ms"], within!(1, 50, "ms")),
    (&["pre_arm.loss_share", "pre_arm.late_share"], within!(0, 0.1)),
    (&["pre_arm.corrupt"], within!(0, 10, "datagrams")),
    (&["pre_arm.tilt_rad"], within!(0.02, 0.35, "rad")),
    (&["pre_arm.joint_margin_rad", "watchdog.joint_margin_rad"], within!(0, 0.2, "rad")),
    (&["pre_arm.lying_tolerance_rad"], within!(0.05, 0.8, "rad")),
    (&["pre_arm.battery_percent"], within!(10, 100, "percent")),
    (&["pre_arm.motor_c"], within!(20, 75, "degrees Celsius")),
    // 0 is an empty field.
    (&["pre_arm.motor_measured_c"], within!(0, 10, "degrees Celsius")),
    // From the range of a unit of 16 g, which a landing reaches, to four times of it.
    (&["consistency.accel_most_m_s2"], within!(157, 640, "m/s^2")),
    // Another program that commands takes half of the states.
    (&["consistency.loss_share"], within!(0.005, 0.2, "of the states")),
    // A first jump at the bounds of the forces is none of a robot that has not jumped yet.
    (&["hop_envelope.start"], within!(0.1, 0.6)),
    (&["hop_envelope.step"], within!(0.01, 0.2)),
    (&["pre_arm.gyro_rad_s"], within!(0.01, 0.5, "rad/s")),
    (&["pre_arm.still_s"], within!(0.2, 10, "s")),
    (&["pre_arm.late_ms"], within!(0.1, 2, "ms")),
    (&["pre_arm.area_clear_s"], within!(5, 120, "s")),
    (&["pre_arm.disk_free_mb", "watchdog.disk_free_mb"], within!(50, 1e9, "MB")),
    // An older approval is not of the present situation.
    (&["approval.expires_s"], within!(0.5, 5, "s")),
    (&["watchdog.stance_tilt_rad"], within!(0.1, 0.6, "rad")),
    (&["watchdog.tilt_rad"], within!(0.3, 1.2, "rad")),
    // A free fall from the stance (0.25 m) takes 226 ms; half of that.
    (&["watchdog.state_age_warn_ms"], within!(1, 100, "ms")),
    (&["watchdog.state_age_ms"], within!(5, 100, "ms")),
    (&["watchdog.hardware_late_ms"], within!(1, 100, "ms")),
    (&["watchdog.link_lost_ms"], within!(20, 1000, "ms")),
    (&["watchdog.velocity_factor"], within!(1, 3, "times the no-load speed")),
    (&["watchdog.torque_factor"], within!(1, 1.5, "times the largest torque")),
    (&["watchdog.motor_warm_c"], within!(30, 80, "degrees Celsius")),
    (&["watchdog.motor_c"], within!(30, 90, "degrees Celsius")),
    (&["watchdog.battery_percent"], within!(5, 100, "percent")),
    (&["watchdog.corrupt"], within!(0, 100, "datagrams")),
    (&["watchdog.period_factor"], within!(1.2, 10, "periods")),
    (&["watchdog.period_ticks"], within!(1, 20, "ticks")),
    (&["watchdog.operator_warn_ms"], within!(50, 1000, "ms")),
    (&["watchdog.operator_silent_ms"], within!(200, 2000, "ms")),
    (&["watchdog.land_s"], within!(0.1, 3, "s")),
    // Two quartz clocks differ by less than 200.
    (&["watchdog.clock_drift_ppm"], within!(0, 1000, "parts per million")),
    (&["watchdog.delay_warn_ms", "watchdog.delay_hold_ms", "watchdog.delay_land_ms"], within!(1, 50, "ms")),
    (&["watchdog.loss_warn_share"], within!(0.001, 0.1)),
    (&["watchdog.takeoff_speed_m_s"], within!(0.2, 2, "m/s")),
    (&["watchdog.hold_s"], within!(0.2, 1.5, "s")),
    (&["watchdog.hold_kp"], within!(20, 100, "N m/rad")),
    (&["watchdog.hold_kd"], within!(1, 5, "N m s/rad")),
    // A sound robot needs 0.15 rad and 0.33 of the torque, 0.41 on blocks.
    (&["watchdog.ramp_error_rad"], within!(0.2, 0.6, "rad")),
    (&["watchdog.ramp_torque_share"], within!(0.4, 0.8)),
    (&["watchdog.ramp_limit_s"], within!(0.02, 0.5, "s")),
    (&["ready.force_share_min"], within!(0.2, 1, "of the weight")),
    (&["ready.force_share_max"], within!(1, 3, "of the weight")),
    (&["ready.tilt_rad"], within!(0.02, 0.35, "rad")),
    (&["ready.stance_rad"], within!(0.05, 0.5, "rad")),
    (&["watchdog.suspended_ms"], within!(20, 200, "ms")),
    (&["remote.silent_ms"], within!(500, 10_000, "ms")),
    (&["watchdog.guard_silent_ms"], within!(30, 500, "ms")),
    (&["watchdog.hardware_idle_s"], within!(5, 600, "s")),
    (&["parameters.f0", "parameters.f1"], within!(0.1, 5, "Hz")),
    (&["parameters.Fx", "parameters.Fy"], within!(0, 300, "N per foot")),
    // Fifteen times the weight with four feet.
    (&["parameters.Fz"], within!(0, 500, "N per foot")),
    (&["gains.kp"], within!(100, 1200, "N/m")),
    (&["gains.kd"], within!(0.5, 40, "N s/m")),
    (&["gains.kd_joint"], within!(0.1, 4, "N m s/rad")),
    (&["gains.k_att"], within!(0, 1000, "N/m")),
];

const OPTIMIZE: &[Row] = &[
    (&["trials"], within!(1, 1e6, "trials")),
    (&["sampler.candidates"], within!(1, 10000, "points")),
    (&["sampler.startup_trials"], within!(0, 1e6, "trials")),
    (&["sampler.least_p_stand"], within!(0, 0.99)),
    (&["sampler.seed"], within!(0, 4294967295.0)),
    (&["fall_price.*"], within!(0, 10)),
    (&["workers.abandoned_s"], within!(0.1, 604800, "s")),
    (&["confirm.contenders"], within!(2, 10, "points")),
    (&["confirm.confidence"], within!(0.501, 0.9999)),
    (&["bounds.*", "first.*.*"], within!(-10000, 10000)),
];

/// `prior.toml`: beyond, a robot of an ensemble has nothing in common with the configured one, or a prior takes hours.
const PRIOR: &[Row] = &[
    (&["worlds"], within!(2, 64, "robots")),
    (&["points"], within!(16, 4096, "points")),
    (&["solver_tolerance_m_s"], within!(1e-15, 0.01, "m/s")),
    (&["seed"], within!(0, 4294967295.0)),
    (&["ranges.mass", "ranges.inertia", "ranges.torque_limit"], within!(0.2, 5, "times the description's value")),
    (&["ranges.full_torque_speed_share"], within!(0, 0.99)),
    (&["ranges.friction"], within!(0, 10)),
    (&["ranges.delay_ms"], within!(0, 20, "ms")),
    (&["ranges.torque_lag_s"], within!(0, 1, "s")),
    (&["ranges.dry_friction_nm"], within!(0, 100, "N m")),
    (&["ranges.viscous_friction_nm_s"], within!(0, 100, "N m s/rad")),
];

/// Returns the ranges of a file's numbers on every backend; the first row that fits applies.
fn rows(file: &str) -> &'static [Row] {
    match file {
        "control.toml" => CONTROL,
        "safety.toml" => SAFETY,
        "optimize.toml" => OPTIMIZE,
        "prior.toml" => PRIOR,
        _ => &[],
    }
}

/// Returns the narrower ranges of a file's numbers on hardware.
fn hardware_rows(file: &str) -> &'static [Row] {
    match file {
        "control.toml" => CONTROL_HARDWARE,
        "safety.toml" => SAFETY_HARDWARE,
        _ => &[],
    }
}

/// Returns the ranges of a number of `file`: on every backend, and the narrower one on hardware.
pub fn of_key(file: &str, key: &str) -> (Option<&'static NumberRange>, Option<&'static NumberRange>) {
    let wide = if file == "simulator.toml" { SIMULATOR } else { rows(file) };
    (range(wide, key), range(hardware_rows(file), key))
}

/// Checks every number of `file`.
pub fn check(file: &str, table: &Table, default: &Table, origin: &FileOrigin) -> Result<(), ConfigError> {
    check_rows(rows(file), "", table, default, origin)
}

/// Checks every number of `file` for hardware.
pub fn check_hardware(file: &str, table: &Table, default: &Table, origin: &FileOrigin) -> Result<(), ConfigError> {
    check_rows(hardware_rows(file), " on hardware", table, default, origin)
}

/// Largest speed of a motor on hardware, rad/s: the Go1's and the Go2's largest is 30.1 rad/s.
const LARGEST_SPEED_RAD_S: f64 = 40.0;

/// Checks the limits of the robot's motors for hardware.
pub fn check_motors(robot: &RobotDescription) -> Result<(), ConfigError> {
    let limits = &robot.limits;
    let quantities = [
        ("effort", &limits.max_torque, robot.largest_torque_n_m, "N m"),
        ("velocity", &limits.max_velocity, LARGEST_SPEED_RAD_S, "rad/s"),
    ];
    for (name, values, largest, unit) in quantities {
        if let Some(joint) = values.iter().position(|value| !(1.0..=largest).contains(value)) {
            return Err(ConfigError::Value {
                file: format!("URDF of {}", robot.name),
                key: format!("{} limit {name}", joint_name(joint)),
                value: values[joint].to_string(),
                reason: format!(
                    "must be within 1 to {largest} {unit} on hardware; give the value of the motor's data sheet"
                ),
            });
        }
    }
    Ok(())
}

fn check_rows(
    rows: &'static [Row],
    place: &str,
    table: &Table,
    default: &Table,
    origin: &FileOrigin,
) -> Result<(), ConfigError> {
    let Some((key, value, text)) = first_outside(rows, table) else { return Ok(()) };
    let remedy = lookup(default, &key)
        .map_or_else(String::new, |default| format!(", or remove the key for the default {default}"));
    Err(origin.refuse(&key, value, format!("{text}{place}; give such a value{remedy}")))
}
