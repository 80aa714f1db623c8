//! Record of one control tick, the counters and the newest snapshot.

use nalgebra::{UnitQuaternion, Vector3};

use super::{Mode, Phase};
use crate::robot::{JointCommand, Joints, LEGS, LinkStatus, PerLeg, RobotState};

/// Estimate of the base and the feet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Position of the trunk's origin, world, m.
    pub position_world: Vector3<f64>,
    /// Velocity of the trunk's origin, world, m/s.
    pub velocity_world: Vector3<f64>,
    /// Rotation that takes body axes to world axes.
    pub orientation_world: UnitQuaternion<f64>,
    /// Angular velocity, body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Roll, pitch and yaw (z-y-x Euler angles), rad; yaw is unwrapped: full turns count.
    pub roll_pitch_yaw: Vector3<f64>,
    /// Whether each foot is on the ground.
    pub contact: PerLeg<bool>,
    /// Feet in their leg frames, m.
    pub foot_position_leg: PerLeg<Vector3<f64>>,
}

impl Default for Estimate {
    fn default() -> Self {
        Estimate {
            position_world: Vector3::zeros(),
            velocity_world: Vector3::zeros(),
            orientation_world: UnitQuaternion::identity(),
            angular_velocity_body: Vector3::zeros(),
            roll_pitch_yaw: Vector3::zeros(),
            contact: [false; LEGS],
            foot_position_leg: [Vector3::zeros(); LEGS],
        }
    }
}

/// Durations of the stages of a tick, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StageTimes {
    /// From the planned start of the tick to its real start.
    pub lateness_ns: u32,
    /// Reading the robot.
    pub read_ns: u32,
    /// Estimate, failsafes, command, decision and limits.
    pub decide_ns: u32,
    /// Writing the command (for the simulator: its physics).
    pub write_ns: u32,
}

/// Record of one control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Count of ticks since the engine started.
    pub number: u64,
    /// Time since the engine started, ns.
    pub time_ns: u64,
    /// Mode in which the tick ended.
    pub mode: Mode,
    /// Phase of the jump.
    pub phase: Phase,
    /// Number of the trial that runs; none between trials.
    pub trial: Option<u32>,
    /// Time since the oscillator entered pi, s; negative before; zero between trials.
    pub trial_time_s: f64,
    /// Phase of the oscillator, rad.
    pub theta_rad: f64,
    /// State that the robot reported.
    pub state: RobotState,
    /// Estimate from that state.
    pub estimate: Estimate,
    /// Joint torques of the controller before the limits, N m.
    pub torque_demanded: Joints,
    /// The command as sent, after the limits.
    pub command: JointCommand,
    /// Bit `i` set: the last gate changed the command of joint `i`.
    pub limited: u16,
    /// Time per stage.
    pub stages: StageTimes,
}

impl Default for Tick {
    fn default() -> Self {
        Tick {
            number: 0,
            time_ns: 0,
            mode: Mode::Offline,
            phase: Phase::Stance,
            trial: None,
            trial_time_s: 0.0,
            theta_rad: 0.0,
            state: RobotState::default(),
            estimate: Estimate::default(),
            torque_demanded: Joints::default(),
            command: JointCommand::default(),
            limited: 0,
            stages: StageTimes::default(),
        }
    }
}

/// Counters since the engine started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Ticks that started more than half a period late.
    pub late_ticks: u64,
    /// Largest lateness of a tick, ns.
    pub worst_lateness_ns: u64,
    /// Ticks lost because the recorder's ring was full.
    pub ticks_not_recorded: u64,
    /// Ticks lost because the screen's ring was full.
    pub ticks_not_shown: u64,
    /// Refused commands.
    pub commands_refused: u64,
    /// Age of the robot's newest valid state, ms.
    pub state_age_ms: u32,
    /// The link to the robot; none for the simulator.
    pub link: Option<LinkStatus>,
}

/// The newest tick and the counters, for the screen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Snapshot {
    /// The newest tick.
    pub tick: Tick,
    /// Counters up to that tick.
    pub counters: Counters,
}
