//! The robot as the controller sees it: reported state, commands, and the trait [`Robot`] that the Go1 and the
//! simulator implement.
//!
//! Frames: **world** z up; **body** origin at the trunk's origin, x forward, y left, z up; **leg** origin at the leg's
//! hip joint, axes of the body. Legs are always in the order FR, FL, RR, RL; joints hip (abduction, about x),
//! thigh (about y), calf (about y). SI units and radians throughout.

pub mod crc;
pub mod description;
pub mod go1;
pub mod go2;
pub mod hardware;
pub mod kinematics;
pub mod link_settings;
pub mod recent_count;
pub mod remote;
pub mod rotation;
pub mod servo_grace;
pub mod state_counter;

use nalgebra::{UnitQuaternion, Vector3};
use remote::Remote;

/// Acceleration of free fall, m/s^2.
pub const GRAVITY: f64 = 9.81;
/// Period of the control cycle, s: a command holds for this long.
pub const CONTROL_PERIOD_S: f64 = 0.001;
/// Step of the damping of a motor in a Go1's datagram, N m s/rad (`docs/go1-wire.md`).
pub const MOTOR_DAMPING_STEP: f64 = 1.0 / 16.0;
/// Longest time for which a request for control of a silent robot holds, s: nothing is sent to a robot that is switched on later.
pub const CONTACT_S: u32 = 10;
/// Number of legs.
pub const LEGS: usize = 4;
/// Number of actuated joints; index `3 * leg + joint`.
pub const JOINTS: usize = 12;
/// One number per joint, in motor order (FR, FL, RR, RL x hip, thigh, calf).
pub type Joints = [f64; JOINTS];
/// One number per leg, FR, FL, RR, RL.
pub type PerLeg<T> = [T; LEGS];

/// Returns the number of control cycles in `seconds`, rounded.
pub fn ticks_in(seconds: f64) -> u32 {
    (seconds / CONTROL_PERIOD_S).round() as u32
}

/// A leg; the discriminant is its index, the variant's name that of URDF links.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, strum::IntoStaticStr)]
pub enum Leg {
    /// Front right.
    FR = 0,
    /// Front left.
    FL = 1,
    /// Rear right.
    RR = 2,
    /// Rear left.
    RL = 3,
}

impl Leg {
    /// All legs in index order.
    pub const ALL: PerLeg<Leg> = [Leg::FR, Leg::FL, Leg::RR, Leg::RL];

    /// Two letters, as in URDF link names.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// +1 for a left leg, -1 for a right one: the sign s in `docs/method.md`.
    pub const fn left_sign(self) -> f64 {
        match self {
            Leg::FL | Leg::RL => 1.0,
            Leg::FR | Leg::RR => -1.0,
        }
    }

    /// Returns a point of a left leg's frame as that of this leg: y is mirrored for a right leg.
    pub fn mirrored(self, point_leg: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(point_leg.x, self.left_sign() * point_leg.y, point_leg.z)
    }

    /// +1 for a front leg, -1 for a rear one.
    pub const fn front_sign(self) -> f64 {
        match self {
            Leg::FR | Leg::FL => 1.0,
            Leg::RR | Leg::RL => -1.0,
        }
    }
}

/// Names of a leg's joints in motor order.
pub const JOINT_NAMES: [&str; 3] = ["hip", "thigh", "calf"];

/// Returns the name of joint `index` (0..12), for example `FR_thigh`.
pub fn joint_name(index: usize) -> String {
    format!("{}_{}", Leg::ALL[index / 3].name(), JOINT_NAMES[index % 3])
}

/// Returns the three joint values of one leg.
pub fn leg_of(joints: &Joints, leg: usize) -> Vector3<f64> {
    Vector3::new(joints[3 * leg], joints[3 * leg + 1], joints[3 * leg + 2])
}

/// Measurement of the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Imu {
    /// Rotation from body axes to world axes.
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular velocity in body axes, rad/s.
    pub gyro_body: Vector3<f64>,
    /// Specific force (acceleration less gravity) in body axes, m/s^2; (0, 0, +9.81) at rest.
    pub accel_body: Vector3<f64>,
}

/// True state, known in simulation alone. Used for the objective in simulation and to evaluate the estimator.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Position of the trunk's origin in the world, m.
    pub position_world: Vector3<f64>,
    /// Velocity of the trunk's origin in the world, m/s.
    pub velocity_world: Vector3<f64>,
    /// Rotation from body axes to world axes.
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular velocity in body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Whether each foot is in contact.
    pub foot_contact: PerLeg<bool>,
    /// Force of the ground on each foot, world axes, N.
    pub foot_force_world: PerLeg<Vector3<f64>>,
    /// Whether a part other than the feet is in contact whose contact is a sign of a fall (`contact.fall_bodies`).
    pub body_contact: bool,
}

/// Battery as reported by its management system.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Battery {
    /// State of charge, percent.
    pub charge_percent: f64,
    /// Pack voltage, V.
    pub voltage_v: f64,
    /// Current, A; negative while discharging.
    pub current_a: f64,
    /// Cell voltages, V; zero for absent cells.
    pub cell_v: [f64; 10],
}

/// One state message.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RobotState {
    /// Clock of the robot, ms since its boot; it decreases when the robot has rebooted.
    pub robot_time_ms: u32,
    /// Joint angles, rad.
    pub joint_position_rad: Joints,
    /// Joint velocities, rad/s.
    pub joint_velocity_rad_s: Joints,
    /// Joint torques as the motors estimate them, N m.
    pub joint_torque_n_m: Joints,
    /// Inertial unit.
    pub imu: Imu,
    /// Normal force at each foot sensor, N.
    pub foot_force_n: PerLeg<f64>,
    /// Motor temperatures, degrees Celsius.
    pub motor_temperature_c: Joints,
    /// Whether each motor follows commands: it reports servo mode, or commands have not been sent for long enough to change it.
    pub motor_enabled: [bool; JOINTS],
    /// Battery; none if the robot has none.
    pub battery: Option<Battery>,
    /// True state; none on hardware.
    pub truth: Option<Truth>,
    /// Remote control; none if it does not answer, or the robot has none.
    pub remote: Option<Remote>,
}

/// Returns the time between two values of the robot's clock, ms; negative if the robot rebooted. Correct also when the
/// clock wraps around after 49 days.
pub fn robot_time_passed(now_ms: u32, before_ms: u32) -> i32 {
    now_ms.wrapping_sub(before_ms) as i32
}

/// Command to one motor: `torque + kp (position - q) + kd (velocity - dq)`, computed inside the motor.
///
/// A command with all gains and the torque zero leaves the joint free; `kp = 0, torque = 0, kd > 0,
/// velocity = 0` is damping.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorCommand {
    /// Desired angle, rad; ignored while `kp_joint` is zero.
    pub position_rad: f64,
    /// Desired velocity, rad/s; ignored while `kd_joint` is zero.
    pub velocity_rad_s: f64,
    /// Stiffness, N m/rad.
    pub kp_joint: f64,
    /// Damping, N m s/rad.
    pub kd_joint: f64,
    /// Feed-forward torque, N m.
    pub torque_n_m: f64,
}

impl MotorCommand {
    /// Returns the torque of the motor's control law at joint angle `q` and velocity `dq`, N m.
    pub fn torque_at(&self, q: f64, dq: f64) -> f64 {
        self.torque_n_m + self.kp_joint * (self.position_rad - q) + self.kd_joint * (self.velocity_rad_s - dq)
    }
}

/// Command to all motors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointCommand {
    /// Command per motor.
    pub motor: [MotorCommand; JOINTS],
}

impl JointCommand {
    /// Damps every joint with gain `kd` (N m s/rad): the safe command, which only dissipates energy.
    pub fn damping(kd: f64) -> Self {
        JointCommand { motor: [MotorCommand { kd_joint: kd, ..MotorCommand::default() }; JOINTS] }
    }

    /// Commands torques alone, N m.
    pub fn torques(torque: &Joints) -> Self {
        JointCommand { motor: torque.map(|torque| MotorCommand { torque_n_m: torque, ..MotorCommand::default() }) }
    }

    /// Commands torques, N m, of which the motors compute the damping: torque + kd (dq - dq) at the measured velocities, with `kd`
    /// rounded down to what a Go1's datagram holds. If no further command arrives, the joint stays damped.
    pub fn damped_torques(torque: &Joints, kd: f64, joint_velocity_rad_s: &Joints) -> Self {
        let kd_joint = (kd / MOTOR_DAMPING_STEP).floor() * MOTOR_DAMPING_STEP;
        let motor = |joint: usize| MotorCommand {
            torque_n_m: torque[joint] + kd_joint * joint_velocity_rad_s[joint],
            kd_joint,
            ..MotorCommand::default()
        };
        JointCommand { motor: std::array::from_fn(motor) }
    }

    /// Holds the joint angles `position` (rad) at rest with stiffness `kp` (N m/rad) and damping `kd` (N m s/rad).
    pub fn hold(position: &Joints, kp: f64, kd: f64) -> Self {
        JointCommand {
            motor: position.map(|position| MotorCommand {
                position_rad: position,
                kp_joint: kp,
                kd_joint: kd,
                ..MotorCommand::default()
            }),
        }
    }
}

/// Start position of a trial. A simulator takes it at once; on hardware the operator places the robot by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Initial joint angles, rad.
    pub joint_position: Joints,
    /// True for a robot that lies folded on the floor, false for one that stands.
    pub lying: bool,
    /// Seed of all random numbers in this trial: sensor noise, random terrain.
    pub seed: u64,
}

/// No state is available, or the command could not be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant, the name of a field holds its unit")]
pub enum RobotError {
    #[error("no state from the robot for {age_ms} ms")]
    NoNewState { age_ms: u32 },
    #[error("the command could not be sent to the robot (error {errno})")]
    Send { errno: i32 },
}

/// Statistics of the link to a robot. Counts are since the program's start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStatus {
    /// Valid states that were newer than all earlier ones.
    pub received: u64,
    /// Lost states, from gaps in the robot's clock; a state that arrives late is no longer counted.
    pub lost: u64,
    /// Valid states that were older than the newest one (overtaken).
    pub out_of_order: u64,
    /// Valid states with the time of an earlier one: duplicated datagrams, or a robot whose clock stands still.
    pub duplicate: u64,
    /// Datagrams with a wrong checksum.
    pub corrupt: u64,
    /// Datagrams too short for a state.
    pub wrong_length: u64,
    /// Datagrams with another header than a low-level state's.
    pub foreign: u64,
    /// Restarts of the robot's clock.
    pub reboots: u64,
    /// Commands passed to the network.
    pub sent: u64,
    /// Commands that the operating system did not send.
    pub send_errors: u64,
    /// Age of the newest valid state, ms.
    pub state_age_ms: u32,
    /// Rate of valid states in the last second, Hz.
    pub rate_hz: u32,
    /// Valid states in the last five seconds.
    pub recent_received: u32,
    /// Lost states in the last five seconds.
    pub recent_lost: u32,
    /// Corrupt datagrams in the last five seconds.
    pub recent_corrupt: u32,
    /// Age of the last rejected older state against the newest one, ms.
    pub older_by_ms: u32,
    /// Commands of other programs to the same robot, where the link shows them (DDS).
    pub foreign_commands: u64,
}

impl LinkStatus {
    /// Share of the states of the last five seconds that were lost, 0 to 1.
    pub fn loss_share(&self) -> f64 {
        let all = self.recent_received + self.recent_lost;
        if all == 0 { 0.0 } else { f64::from(self.recent_lost) / f64::from(all) }
    }
}

/// A robot: hardware or simulator. The control thread calls `read` and `write` once per tick; neither allocates, locks
/// or blocks.
pub trait Robot: Send {
    /// Returns the state that arrived since the last call, or [`RobotError::NoNewState`] with the age of the newest one.
    fn read(&mut self) -> Result<RobotState, RobotError>;

    /// Sends one command. A simulator advances by one control period.
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError>;

    /// Places the robot for a trial; returns false if only a person can (hardware).
    fn place(&mut self, placement: &Placement) -> bool;

    /// Returns the statistics of the link; none for a robot without a link.
    fn link(&self) -> Option<LinkStatus> {
        None
    }

    /// Whether the written commands leave this program, as far as the driver can see. While they do not, the control thread sends the
    /// guard no heartbeat, so that the guard damps the robot on its own way to it.
    fn delivers(&self) -> bool {
        true
    }

    /// Begins to call a robot that sends nothing until it is commanded, for at most [`CONTACT_S`] and until the first command. A robot
    /// that answers by itself ignores it.
    fn begin_contact(&mut self) {}

    /// Warms the caches for `read` and `write`, under the same real-time rules; see [`crate::control::control_loop`].
    /// Sends nothing to the robot, and changes no result of later calls.
    fn warm_up(&mut self) {}
}

impl<R: Robot + ?Sized> Robot for Box<R> {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        (**self).read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        (**self).write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        (**self).place(placement)
    }
    fn link(&self) -> Option<LinkStatus> {
        (**self).link()
    }
    fn delivers(&self) -> bool {
        (**self).delivers()
    }
    fn begin_contact(&mut self) {
        (**self).begin_contact();
    }
    fn warm_up(&mut self) {
        (**self).warm_up();
    }
}
