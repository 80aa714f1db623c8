//! Settings of the control cycle: sections of `config/control.toml` and `config/safety.toml`, which explain every key, and
//! properties of the machine.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use super::task_control::TaskControl;
use crate::robot::kinematics::LegGeometry;
use crate::robot::remote::RemoteButtons;
use crate::robot::{Joints, LEGS, PerLeg, RobotState};
use crate::telemetry::{Estimate, SensorCheck};
use crate::trial::Gains;

/// Stance between trials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandSettings {
    /// Gains of the leg controller.
    pub gains: Gains,
    /// Nominal foot position of a left leg, leg frame, m.
    pub stance_leg: Vector3<f64>,
    /// Whether Virtual Model Control acts.
    pub vmc: bool,
    /// Damping of Virtual Model Control, N s/m.
    pub attitude_rate_gain: f64,
}

/// Standing up and sitting down: a ramp of joint targets from the measured pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RampSettings {
    /// Duration, s.
    pub duration_s: f64,
    /// Joint stiffness, N m/rad.
    pub kp: f64,
    /// Joint damping, N m s/rad.
    pub kd: f64,
    /// Largest joint error at which the pose counts as reached, rad.
    pub tolerance_rad: f64,
    /// Time-out after the end of the ramp, s.
    pub timeout_s: f64,
}

/// End of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettleSettings {
    /// Time for which all feet must be down and the body quiet, s.
    pub quiet_s: f64,
    /// Longest wait after the impulse, s.
    pub cap_s: f64,
    /// Quiet: speed of the trunk at most, m/s.
    pub speed_m_s: f64,
    /// Quiet: angular speed of the trunk at most, rad/s.
    pub rate_rad_s: f64,
}

impl SettleSettings {
    /// Whether all feet are down and the trunk is quiet.
    pub fn is_quiet(&self, estimate: &Estimate) -> bool {
        estimate.contact == [true; LEGS]
            && estimate.velocity_world.norm() < self.speed_m_s
            && estimate.angular_velocity_body.norm() < self.rate_rad_s
    }
}

/// Limits of a fall.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FallLimits {
    /// Largest absolute roll, rad.
    pub roll_rad: f64,
    /// Largest absolute pitch, rad.
    pub pitch_rad: f64,
    /// Time for which a part other than the feet touches the ground, s (known in simulation only).
    pub body_contact_s: f64,
    /// Largest absolute roll or pitch in flight on the simulator, rad.
    pub simulator_flight_rad: f64,
    /// Largest absolute roll or pitch in flight on hardware, rad.
    pub hardware_flight_rad: f64,
}

/// The last gate before the motors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GateLimits {
    /// Largest change of a joint's torque from one tick to the next, N m.
    pub torque_step_nm: f64,
    /// Largest joint stiffness that may be sent, N m/rad.
    pub kp_max: f64,
    /// Largest joint damping that may be sent, N m s/rad.
    pub kd_max: f64,
    /// Damping that is sent when the robot is stopped, N m s/rad.
    pub damping_kd: f64,
}

/// Limits of the arming checks: section `[pre_arm]` of `config/safety.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmingLimits {
    /// Oldest state, ms.
    pub state_age_ms: u32,
    /// Largest share of states lost in the last 5 s.
    pub loss_share: f64,
    /// Most corrupt datagrams in the last 5 s.
    pub corrupt: u32,
    /// Largest roll or pitch, rad.
    pub tilt_rad: f64,
    /// Largest distance of a joint beyond its limit, rad.
    pub joint_margin_rad: f64,
    /// Largest distance of a joint from the lying pose, rad.
    pub lying_tolerance_rad: f64,
    /// Least charge, percent.
    pub battery_percent: f64,
    /// Hottest motor, degrees Celsius.
    pub motor_c: f64,
    /// Least temperature of a motor that counts as measured, degrees Celsius.
    pub motor_measured_c: f64,
    /// Largest angular velocity of a still robot, rad/s.
    pub gyro_rad_s: f64,
    /// Time for which the robot must be still, s.
    pub still_s: f64,
    /// Largest deviation of the averaged specific force from gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// Largest angle from the averaged specific force to the orientation's upward direction, rad.
    pub gravity_rad: f64,
    /// Largest sum of the foot forces of a lying robot, share of the weight.
    pub foot_load_share: f64,
    /// Ticks that begin later than this are late, ms.
    pub late_ms: f64,
    /// Largest share of late ticks in the last 5 s.
    pub late_share: f64,
    /// Time after which the operator's confirmation of a clear area expires, s.
    pub area_clear_s: f64,
    /// Least free space where the recording goes, MB.
    pub disk_free_mb: u32,
}

/// Conditions of a jump on hardware: section `[ready]` of `config/safety.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadyLimits {
    /// Least sum of the foot forces, share of the weight.
    pub force_share_min: f64,
    /// Largest sum of the foot forces, share of the weight.
    pub force_share_max: f64,
    /// Largest roll or pitch, rad.
    pub tilt_rad: f64,
    /// Largest distance of a joint from the stance, rad.
    pub stance_rad: f64,
}

/// Limits of the consistency of sensors, clocks and commands: section `[consistency]` of `config/safety.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConsistencyLimits {
    /// Most states in a row with the same measurement of the inertial unit.
    pub repeated_states: u32,
    /// Most states in a row with the same measurements of a motor while the robot jumps.
    pub repeated_motor_states: u32,
    /// Largest component of a specific force that counts as measured, m/s^2.
    pub accel_most_m_s2: f64,
    /// Largest deviation of the averaged specific force from gravity while standing, m/s^2.
    pub gravity_m_s2: f64,
    /// Largest angle from the orientation's upward direction to that of gyroscope and accelerometer, rad.
    pub orientation_rad: f64,
    /// Largest rotation of the orientation that the gyroscope does not measure, rad.
    pub turn_rad: f64,
    /// Least and largest sum of the foot forces while standing, share of the weight.
    pub foot_load_least_share: f64,
    /// See `foot_load_least_share`.
    pub foot_load_most_share: f64,
    /// Longest time of another sum, s.
    pub foot_load_s: f64,
    /// Specific force below which the robot falls freely, m/s^2.
    pub free_fall_m_s2: f64,
    /// Longest contact of a foot in free fall, s.
    pub free_fall_contact_s: f64,
    /// Longest time without load on the feet after a landing, s.
    pub unsupported_s: f64,
    /// Largest change of a joint's angle that its velocity does not report, rad.
    pub joint_velocity_rad: f64,
    /// Largest step of the robot's clock against this computer's, ms.
    pub clock_step_ms: f64,
    /// Largest share of states lost in a second while energised.
    pub loss_share: f64,
    /// Largest averaged difference of a reported torque from the command's while standing, N m.
    pub torque_n_m: f64,
}

impl ConsistencyLimits {
    /// The limit of a sensor check, in its unit.
    pub fn allowed(&self, check: SensorCheck) -> f64 {
        match check {
            SensorCheck::InertialUnitLive => self.repeated_states.into(),
            SensorCheck::GravityMagnitude => self.gravity_m_s2,
            SensorCheck::Orientation => self.orientation_rad,
            SensorCheck::TurnRate => self.turn_rad,
            SensorCheck::FeetLoaded => self.foot_load_s,
            SensorCheck::FeetInFreeFall => self.free_fall_contact_s,
            SensorCheck::FeetAfterLanding => self.unsupported_s,
            SensorCheck::JointVelocity => self.joint_velocity_rad,
            SensorCheck::MotorsLive => self.repeated_motor_states.into(),
        }
    }
}

/// The robot's remote control: section `[remote]` of `config/safety.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RemoteSettings {
    /// Buttons that damp the robot when they are pressed together.
    pub stop: RemoteButtons,
    /// Whether arming and jumping need a remote control that answers.
    pub needed: bool,
    /// Longest silence of a remote control that is needed, ms: LAND.
    pub silent_ms: u32,
}

/// Expiry of an approval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApprovalLimits {
    /// Longest time from the key press to the countdown, s.
    pub expires_s: f64,
}

/// Limits of the failsafes: section `[watchdog]` of `config/safety.toml`. DAMP damps in the same tick, LAND finishes the landing and
/// sits down, HOLD finishes the trial and refuses approvals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailsafeLimits {
    /// Largest tilt while standing, rad: DAMP.
    pub stance_tilt_rad: f64,
    /// Largest tilt while sitting down, rad: DAMP; and what the flight limits of `[fall]` may not exceed.
    pub tilt_rad: f64,
    /// Age of the robot's state that gives a warning, ms.
    pub state_age_warn_ms: u32,
    /// Oldest state of the robot, ms: DAMP.
    pub state_age_ms: u32,
    /// Age of the state from which the link counts as lost, ms.
    pub link_lost_ms: u32,
    /// Largest distance of a joint beyond its limit, rad: DAMP.
    pub joint_margin_rad: f64,
    /// Largest joint velocity, times the motor's no-load speed: DAMP.
    pub velocity_factor: f64,
    /// Largest joint torque as the motor estimates it, times the joint's limit: DAMP.
    pub torque_factor: f64,
    /// Warm motor, degrees Celsius: HOLD.
    pub motor_warm_c: f64,
    /// Hottest motor, degrees Celsius: DAMP.
    pub motor_c: f64,
    /// Least charge, percent: HOLD.
    pub battery_percent: f64,
    /// Most corrupt datagrams in the last 5 s: DAMP.
    pub corrupt: u32,
    /// Longest time between two ticks, periods.
    pub period_factor: f64,
    /// Ticks in a row with a longer period: DAMP, unless late ticks are only counted.
    pub period_ticks: u32,
    /// Time without a heartbeat of the operator's console that gives a warning, ms.
    pub operator_warn_ms: u32,
    /// Longest time without a heartbeat of the operator's console, ms: LAND.
    pub operator_silent_ms: u32,
    /// LAND: longest time from touchdown to sitting down, s.
    pub land_s: f64,
    /// Growth of the link's delay that gives a warning, ms.
    pub delay_warn_ms: f64,
    /// Growth of the link's delay, ms: HOLD.
    pub delay_hold_ms: f64,
    /// Growth of the link's delay, ms: LAND.
    pub delay_land_ms: f64,
    /// Share of the states of the last second lost that gives a warning.
    pub loss_warn_share: f64,
    /// Upward speed of the trunk in an impulse from which the robot flies whatever the motors do, m/s.
    pub takeoff_speed_m_s: f64,
    /// A fault in the air without a known state: time for which the motors hold the stance, s.
    pub hold_s: f64,
    /// The same: joint stiffness, N m/rad.
    pub hold_kp: f64,
    /// The same: joint damping, N m s/rad.
    pub hold_kd: f64,
    /// Ramps: largest distance of a joint from its target, rad: DAMP.
    pub ramp_error_rad: f64,
    /// Ramps: largest torque, share of the joint's limit; a larger demand is limited, then DAMP.
    pub ramp_torque_share: f64,
    /// Ramps: time for which a joint may exceed either, s.
    pub ramp_limit_s: f64,
    /// Largest drift of the robot's clock against this machine's that is not taken for a growing delay, parts per million.
    pub clock_drift_ppm: f64,
    /// Least free space where the recording goes, MB: HOLD.
    pub disk_free_mb: u32,
    /// Latest start of a tick on the simulator, ms; zero only counts late ticks.
    pub simulator_late_ms: f64,
    /// Latest start of a tick on hardware, ms: DAMP; zero only counts late ticks.
    pub hardware_late_ms: f64,
    /// Longest wait in READY or REVIEW on the simulator, s; zero disables the limit.
    pub simulator_idle_s: f64,
    /// Longest wait in READY or REVIEW on hardware, s: sit down; zero disables the limit.
    pub hardware_idle_s: f64,
    /// Longest suspension of the computer, ms: DAMP.
    pub suspended_ms: u32,
    /// Longest time without an answer of the guard, ms: LAND.
    pub guard_silent_ms: u32,
    /// Whether a robot sits down at the end of a trial on hardware.
    pub hardware_review_sits_down: bool,
}

/// Source of the base's position, velocity and orientation, and of the objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ObjectiveSource {
    /// The simulator's true state.
    Truth,
    /// The sensors, as on hardware.
    Estimate,
}

impl ObjectiveSource {
    /// Name in `config/optimize.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            ObjectiveSource::Truth => "truth",
            ObjectiveSource::Estimate => "estimate",
        }
    }

    /// The source of that name.
    pub fn from_name(name: &str) -> Option<ObjectiveSource> {
        [ObjectiveSource::Truth, ObjectiveSource::Estimate].into_iter().find(|source| source.name() == name)
    }
}

/// Weights of the sensors: section `[estimator]` of `config/control.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorSettings {
    /// Force from which a foot in the air is down, N.
    pub contact_on_n: f64,
    /// Force below which a foot on the ground is in the air, N.
    pub contact_off_n: f64,
    /// Time for which the sensor must report the change, s.
    pub contact_time_s: f64,
    /// Standard deviation of an accelerometer sample at 1 kHz, m/s^2.
    pub accel_noise_m_s2: f64,
    /// Its error in proportion to the acceleration.
    pub accel_error_share: f64,
    /// Initial standard deviation of the accelerometer's bias, m/s^2.
    pub accel_bias_m_s2: f64,
    /// Random walk of the bias, m/s^2 per square root of a second.
    pub accel_bias_walk: f64,
    /// Standard deviation of the mean acceleration in a gap of the states, in addition to the interpolation, m/s^2.
    pub unseen_accel_m_s2: f64,
    /// Standard deviation of a foot's position from encoders and orientation, m.
    pub foot_position_m: f64,
    /// Standard deviation of a foot's velocity from encoders and gyroscope, m/s.
    pub foot_velocity_m_s: f64,
    /// Its error in proportion to the velocity.
    pub foot_velocity_share: f64,
    /// Random walk of a standing foot, m per square root of a second.
    pub foot_creep: f64,
    /// Largest residual of a standing foot, standard deviations; beyond it the foot slips.
    pub gate_sigma: f64,
    /// Standard deviation of an unknown velocity, m/s.
    pub start_velocity_m_s: f64,
    /// Longest slip of all feet that are down, s; after it the velocity's variance is raised.
    pub longest_slip_s: f64,
    /// Longest flight, s; after it the robot counts as hanging.
    pub longest_flight_s: f64,
}

/// Settings of the control cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlSettings {
    /// Leg lengths.
    pub geometry: LegGeometry,
    /// Hip joints in the body frame, m.
    pub hip_origin_body: PerLeg<Vector3<f64>>,
    /// Position of the inertial unit, body frame, m.
    pub imu_origin_body: Vector3<f64>,
    /// Radius of a foot, m.
    pub foot_radius: f64,
    /// Lowest joint angles, rad: the higher of the URDF's and the manufacturer's.
    pub min_position: Joints,
    /// Highest joint angles, rad: the lower of the URDF's and the manufacturer's.
    pub max_position: Joints,
    /// Largest joint torques, N m.
    pub max_torque: Joints,
    /// No-load speeds of the joints, rad/s.
    pub max_velocity: Joints,
    /// Joint angles of the machine lying folded, rad.
    pub lying_position: Joints,
    /// Weight, N.
    pub weight_n: f64,
    /// Stance between trials.
    pub stand: StandSettings,
    /// Standing up.
    pub stand_up: RampSettings,
    /// Sitting down.
    pub sit_down: RampSettings,
    /// From approval to the impulse, standing still, s.
    pub countdown_s: f64,
    /// Time in which the gains change at the begin of the countdown and after a trial, s.
    pub blend_s: f64,
    /// End of a trial.
    pub settle: SettleSettings,
    /// Limits of a fall.
    pub fall: FallLimits,
    /// Largest absolute roll or pitch with no foot down, rad.
    pub flight_tilt_rad: f64,
    /// Least force of a contact when the simulator's true state is used, N.
    pub contact_force_n: f64,
    /// Source of the base's state.
    pub objective: ObjectiveSource,
    /// Weights of the sensors.
    pub estimator: EstimatorSettings,
    /// The last gate.
    pub gate: GateLimits,
    /// Real hardware: all arming checks apply.
    pub hardware: bool,
    /// Limits of the arming checks.
    pub arming: ArmingLimits,
    /// Conditions of a jump.
    pub ready: ReadyLimits,
    /// Limits of the consistency of sensors, clocks and commands.
    pub consistency: ConsistencyLimits,
    /// The remote control.
    pub remote: RemoteSettings,
    /// Expiry of an approval.
    pub approval: ApprovalLimits,
    /// Limits of the failsafes.
    pub failsafe: FailsafeLimits,
    /// Latest start of a tick, ms; zero only counts late ticks.
    pub late_ms: f64,
    /// Longest wait in READY or REVIEW, s; zero disables the limit.
    pub idle_s: f64,
}

impl ControlSettings {
    /// Whether the robot needs a remote control, and it does not answer.
    pub fn misses_remote(&self, state: &RobotState) -> bool {
        self.hardware && self.remote.needed && state.remote.is_none()
    }
}
