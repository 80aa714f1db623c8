//! Record of one control tick, the counters and the newest snapshot.

use nalgebra::{UnitQuaternion, Vector3};

use super::{Mode, Phase, TrialInhibit};
use crate::robot::{JointCommand, Joints, LinkStatus, PerLeg, RobotState};

/// Estimate of the base and the feet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// Position of the trunk's origin, world, m.
    pub position_world: Vector3<f64>,
    /// Velocity of the trunk's origin, world, m/s.
    pub velocity_world: Vector3<f64>,
    /// Rotation that takes body axes to world axes.
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular velocity, body axes, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Roll, pitch and yaw (z-y-x Euler angles), rad; yaw is unwrapped: full turns count.
    pub roll_pitch_yaw: Vector3<f64>,
    /// Whether each foot is on the ground.
    pub contact: PerLeg<bool>,
    /// Feet in their leg frames, m.
    pub foot_position_leg: PerLeg<Vector3<f64>>,
}

impl Estimate {
    /// The larger of roll and pitch without sign, rad; not a number if one of them is not.
    pub fn tilt_rad(&self) -> f64 {
        let [roll, pitch, _] = self.roll_pitch_yaw.into();
        // `f64::max` drops a NaN.
        if roll.is_nan() || pitch.is_nan() { f64::NAN } else { roll.abs().max(pitch.abs()) }
    }
}

/// Durations of the stages of a tick, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TickDurations {
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
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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
    pub stages: TickDurations,
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
    /// Ticks lost because the console's ring was full.
    pub ticks_not_shown: u64,
    /// Refused commands.
    pub commands_refused: u64,
    /// Age of the robot's newest valid state, ms.
    pub state_age_ms: u32,
    /// The link to the robot; none for the simulator.
    pub link: Option<LinkStatus>,
}

/// The largest lateness of a tick in the present second and in the one before, for the console, which does not see every tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecentLateness {
    /// The present second of [`Tick::time_ns`].
    pub second: u64,
    /// In that second, ns.
    pub present_ns: u64,
    /// In the second before, ns.
    pub before_ns: u64,
}

impl RecentLateness {
    /// Takes a tick into account.
    pub fn see(&mut self, time_ns: u64, lateness_ns: u64) {
        let second = time_ns / 1_000_000_000;
        if second != self.second {
            let before_ns = if second == self.second + 1 { self.present_ns } else { 0 };
            *self = RecentLateness { second, present_ns: 0, before_ns };
        }
        self.present_ns = self.present_ns.max(lateness_ns);
    }
}

/// The newest tick and the counters, for the console.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Snapshot {
    /// The newest tick.
    pub tick: Tick,
    /// Counters up to that tick.
    pub counters: Counters,
    /// The reason for which a trial would not be approved at present; none while one could be.
    pub unready: Option<TrialInhibit>,
    /// Lateness of the ticks of the last two seconds.
    pub lateness: RecentLateness,
}
