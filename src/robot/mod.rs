//! The machine as a controller sees it: what it reports, what it can be told, and the seam behind which a
//! Go1 or the simulator stands.
//!
//! Frames: **world** z up; **body** origin at the trunk's, x forward, y left, z up; **leg** origin at the leg's
//! hip joint, axes of the body. Legs are always in the order FR, FL, RR, RL; joints hip (abduction, about x),
//! thigh (about y), calf (about y). SI units and radians throughout.

pub mod description;
pub mod go1;
pub mod kinematics;
pub mod recent;

use nalgebra::{UnitQuaternion, Vector3};

/// Number of legs.
pub const LEGS: usize = 4;
/// Number of actuated joints, `3 * leg + joint`.
pub const JOINTS: usize = 12;
/// One number per joint, in motor order (FR, FL, RR, RL x hip, thigh, calf).
pub type Joints = [f64; JOINTS];
/// One number per leg, FR, FL, RR, RL.
pub type PerLeg<T> = [T; LEGS];

/// A leg; the discriminant is its index everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
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

    /// The two letters of the field, as in URDF link names.
    pub const fn name(self) -> &'static str {
        match self {
            Leg::FR => "FR",
            Leg::FL => "FL",
            Leg::RR => "RR",
            Leg::RL => "RL",
        }
    }

    /// +1 for a left leg, -1 for a right one: the sign `s` of the paper's leg geometry.
    pub const fn side(self) -> f64 {
        match self {
            Leg::FL | Leg::RL => 1.0,
            Leg::FR | Leg::RR => -1.0,
        }
    }

    /// +1 for a front leg, -1 for a rear one.
    pub const fn end(self) -> f64 {
        match self {
            Leg::FR | Leg::FL => 1.0,
            Leg::RR | Leg::RL => -1.0,
        }
    }
}

/// The names of a leg's joints in motor order.
pub const JOINT_NAMES: [&str; 3] = ["hip", "thigh", "calf"];

/// The name of joint `index` (0..12) as the URDF has it, for example `FR_thigh`.
pub fn joint_name(index: usize) -> String {
    format!("{}_{}", Leg::ALL[index / 3].name(), JOINT_NAMES[index % 3])
}

/// The three joint values of one leg as a vector.
pub fn leg_of(joints: &Joints, leg: usize) -> Vector3<f64> {
    Vector3::new(joints[3 * leg], joints[3 * leg + 1], joints[3 * leg + 2])
}

/// What the inertial unit reports.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imu {
    /// Rotation that takes body axes to world axes.
    pub orientation_world: UnitQuaternion<f64>,
    /// Angular velocity in body axes, rad/s.
    pub gyro_body: Vector3<f64>,
    /// Specific force (acceleration less gravity) in body axes, m/s^2; (0, 0, +9.81) at rest.
    pub accel_body: Vector3<f64>,
}

impl Default for Imu {
    fn default() -> Self {
        Imu { orientation_world: UnitQuaternion::identity(), gyro_body: Vector3::zeros(), accel_body: Vector3::zeros() }
    }
}

/// What only a simulator can know. Used for the objective in simulation and to judge the estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Position of the trunk's origin in the world, m.
    pub position_world: Vector3<f64>,
    /// Velocity of the trunk's origin in the world, m/s.
    pub velocity_world: Vector3<f64>,
    /// Rotation that takes body axes to world axes.
    pub orientation_world: UnitQuaternion<f64>,
    /// Angular velocity in body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Whether each foot touches something.
    pub foot_contact: PerLeg<bool>,
    /// Force of the ground on each foot, world axes, N.
    pub foot_force_world: PerLeg<Vector3<f64>>,
    /// Whether any part other than the feet touches something: the robot has fallen.
    pub body_contact: bool,
}

/// Battery as reported by its management system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Battery {
    /// State of charge, percent.
    pub charge_percent: f64,
    /// Pack voltage, V.
    pub voltage_v: f64,
    /// Current, A; negative while discharging.
    pub current_a: f64,
    /// Cell voltages, V; zero where there is no such cell.
    pub cell_v: [f64; 10],
}

/// Everything that the machine reports in one state message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotState {
    /// The robot's own clock, ms since its start; going backwards means that it rebooted.
    pub robot_time_ms: u32,
    /// Joint angles, rad.
    pub joint_position: Joints,
    /// Joint velocities, rad/s.
    pub joint_velocity: Joints,
    /// Joint torques as the motors estimate them, N m.
    pub joint_torque: Joints,
    /// Inertial unit.
    pub imu: Imu,
    /// Normal force at each foot's sensor, N.
    pub foot_force: PerLeg<f64>,
    /// Motor temperatures, degrees Celsius.
    pub motor_temperature_c: Joints,
    /// Whether each motor reports that it follows commands (servo mode).
    pub motor_enabled: [bool; JOINTS],
    /// Battery; none for a machine without one.
    pub battery: Option<Battery>,
    /// The simulator's own knowledge; none on hardware.
    pub truth: Option<Truth>,
}

/// By how much the robot's clock went on from `before_ms` to `now_ms`, ms; negative if it restarted. The clock runs for 49 days
/// before it begins anew: the difference is right across that, too.
pub fn robot_time_passed(now_ms: u32, before_ms: u32) -> i32 {
    now_ms.wrapping_sub(before_ms) as i32
}

impl Default for RobotState {
    fn default() -> Self {
        RobotState {
            robot_time_ms: 0,
            joint_position: [0.0; JOINTS],
            joint_velocity: [0.0; JOINTS],
            joint_torque: [0.0; JOINTS],
            imu: Imu::default(),
            foot_force: [0.0; LEGS],
            motor_temperature_c: [0.0; JOINTS],
            motor_enabled: [false; JOINTS],
            battery: None,
            truth: None,
        }
    }
}

/// What one motor is told: `torque + kp (position - q) + kd (velocity - dq)`, computed inside the motor.
///
/// A command with all gains and the torque zero leaves the joint free; `kp = 0, torque = 0, kd > 0,
/// velocity = 0` is damping.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorCommand {
    /// Desired angle, rad; ignored while `kp` is zero.
    pub position: f64,
    /// Desired velocity, rad/s; ignored while `kd` is zero.
    pub velocity: f64,
    /// Stiffness, N m/rad.
    pub kp: f64,
    /// Damping, N m s/rad.
    pub kd: f64,
    /// Feed-forward torque, N m.
    pub torque: f64,
}

impl MotorCommand {
    /// The torque that the motor's own law asks for at joint angle `q` and velocity `dq`, N m.
    pub fn torque_at(&self, q: f64, dq: f64) -> f64 {
        self.torque + self.kp * (self.position - q) + self.kd * (self.velocity - dq)
    }
}

/// One command to the whole machine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointCommand {
    /// One command per motor.
    pub motor: [MotorCommand; JOINTS],
}

impl JointCommand {
    /// Every joint damped with gain `kd` (N m s/rad): the safe command, energy only ever leaves.
    pub fn damping(kd: f64) -> Self {
        JointCommand { motor: [MotorCommand { kd, ..MotorCommand::default() }; JOINTS] }
    }

    /// Pure torques, N m.
    pub fn torques(torque: &Joints) -> Self {
        let mut command = JointCommand::default();
        for (motor, &torque) in command.motor.iter_mut().zip(torque) {
            motor.torque = torque;
        }
        command
    }
}

/// Where a machine is put before a trial. A simulator does it at once; for hardware the operator does it by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Joint angles to start from, rad.
    pub joint_position: Joints,
    /// Lying folded on the floor (before standing up) or standing with the feet touching it.
    pub lying: bool,
    /// Seed of everything random in this trial: sensor noise, terrain where it is random.
    pub seed: u64,
}

/// The state that `read` returned is not to be had, or the command could not be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RobotError {
    /// No valid state yet, or none for the given time.
    #[error("no state from the robot for {age_ms} ms")]
    Silent {
        /// Age of the newest valid state, ms.
        age_ms: u32,
    },
    /// The operating system refused to send.
    #[error("the command could not be sent to the robot (error {errno})")]
    Send {
        /// The system's error number.
        errno: i32,
    },
}

/// How the link to a robot is doing: what came, what did not, and what was not fit to use. Counts are since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStatus {
    /// Valid states that were newer than all before.
    pub received: u64,
    /// States that never came, from gaps in the robot's clock; one that comes late after all is not lost.
    pub lost: u64,
    /// Valid states that were older than the newest: overtaken on the way.
    pub late: u64,
    /// Valid states with the time of the newest one: sent twice, or by a robot whose clock stands still.
    pub duplicate: u64,
    /// Datagrams whose checksum is wrong.
    pub corrupt: u64,
    /// Datagrams too short for a state.
    pub wrong_length: u64,
    /// Datagrams with another header than a low-level state's.
    pub foreign: u64,
    /// How often the robot's clock began anew.
    pub reboots: u64,
    /// Commands handed to the network.
    pub sent: u64,
    /// Commands that the operating system refused to send.
    pub send_errors: u64,
    /// Age of the newest valid state, ms.
    pub state_age_ms: u32,
    /// Valid states in the last second: their rate, Hz.
    pub rate_hz: u32,
    /// Of the last five seconds: valid states.
    pub recent_received: u32,
    /// Of the last five seconds: lost states.
    pub recent_lost: u32,
    /// Of the last five seconds: corrupt datagrams.
    pub recent_corrupt: u32,
}

impl LinkStatus {
    /// Share of the states of the last five seconds that were lost, 0 to 1.
    pub fn loss_share(&self) -> f64 {
        let all = self.recent_received + self.recent_lost;
        if all == 0 { 0.0 } else { f64::from(self.recent_lost) / f64::from(all) }
    }
}

/// The machine: hardware or simulator. Both calls are made once per tick from the control thread and neither
/// allocates, locks nor blocks.
pub trait Robot: Send {
    /// The newest state.
    fn read(&mut self) -> Result<RobotState, RobotError>;

    /// Sends one command. For the simulator this advances time by one control period.
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError>;

    /// Puts the machine in place for a trial; false where only a person can (hardware).
    fn place(&mut self, placement: &Placement) -> bool;

    /// How the link is doing; none for a machine without one.
    fn link(&self) -> Option<LinkStatus> {
        None
    }

    /// Goes the way of `read` and `write` once, shortly before both are called and bound by the same rules: what the processor
    /// needs for them is then at hand. The robot hears nothing of it, and neither call answers otherwise for it.
    fn rehearse(&mut self) {}
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
    fn rehearse(&mut self) {
        (**self).rehearse();
    }
}
