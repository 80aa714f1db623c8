//! What may be asked of the control thread. Everything here is `Copy`: nothing can be freed inside a tick.

use nalgebra::Vector3;

use crate::robot::{LEGS, Leg, PerLeg};

/// What the robot is asked to learn; decides the signs of the force amplitudes and the objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Task {
    /// Jump forward.
    Forward,
    /// Jump to the left.
    LateralLeft,
    /// Jump to the right.
    LateralRight,
    /// Turn counterclockwise, seen from above.
    TwistCcw,
    /// Turn clockwise.
    TwistCw,
}

impl Task {
    /// All tasks.
    pub const ALL: [Task; 5] = [Task::Forward, Task::LateralLeft, Task::LateralRight, Task::TwistCcw, Task::TwistCw];

    /// The name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Task::Forward => "forward",
            Task::LateralLeft => "lateral-left",
            Task::LateralRight => "lateral-right",
            Task::TwistCcw => "twist-ccw",
            Task::TwistCw => "twist-cw",
        }
    }

    /// The task of that name.
    pub fn from_name(name: &str) -> Option<Task> {
        Task::ALL.into_iter().find(|task| task.name() == name)
    }

    /// The unit of the objective: metres, or radians for a twist.
    pub const fn unit(self) -> &'static str {
        match self {
            Task::Forward | Task::LateralLeft | Task::LateralRight => "m",
            Task::TwistCcw | Task::TwistCw => "rad",
        }
    }
}

/// The force profile of one jump: frequencies and amplitudes (paper, equations 1 and 2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JumpParameters {
    /// Frequency of the impulse phase, Hz: the impulse lasts 1 / (2 f0).
    pub f0_hz: f64,
    /// Frequency of the off phase, Hz, for continuous jumping: the pause lasts 1 / (2 f1). Zero for single jumps.
    pub f1_hz: f64,
    /// Amplitude along x, N per foot, positive.
    pub fx_n: f64,
    /// Amplitude along y, N per foot, positive.
    pub fy_n: f64,
    /// Amplitude along z, N per foot, positive.
    pub fz_n: f64,
}

impl JumpParameters {
    /// The amplitude `[Fx Fy Fz]` of each foot with the signs of `task` (`specs/method.md`, "Amplitude signs"),
    /// as the force that the foot exerts divided by sin(theta), leg frame, N.
    pub fn amplitudes_leg(&self, task: Task) -> PerLeg<Vector3<f64>> {
        let mut amplitudes = [Vector3::zeros(); LEGS];
        for (amplitude, leg) in amplitudes.iter_mut().zip(Leg::ALL) {
            *amplitude = match task {
                Task::Forward => Vector3::new(self.fx_n, 0.0, self.fz_n),
                Task::LateralLeft => Vector3::new(0.0, self.fy_n, self.fz_n),
                Task::LateralRight => Vector3::new(0.0, -self.fy_n, self.fz_n),
                Task::TwistCcw => Vector3::new(0.0, leg.end() * self.fy_n, self.fz_n),
                Task::TwistCw => Vector3::new(0.0, -leg.end() * self.fy_n, self.fz_n),
            };
        }
        amplitudes
    }
}

/// Gains of the leg controller (paper, equation 4 and the Virtual Model Control).
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Gains {
    /// Cartesian stiffness Kp, N/m, the same along all axes.
    pub kp: f64,
    /// Cartesian damping Kd, N s/m.
    pub kd: f64,
    /// Joint damping Kd,joint, N m s/rad.
    pub kd_joint: f64,
    /// Attitude gain of the Virtual Model Control k_att, N/m.
    pub k_att: f64,
}

/// Everything that a trial runs with; latched when the trial starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialSpec {
    /// Number of the trial in its study.
    pub trial: u32,
    /// The task.
    pub task: Task,
    /// The force profile.
    pub jump: JumpParameters,
    /// Controller gains.
    pub gains: Gains,
    /// Nominal foot position of a left leg in the leg frame, m; y is mirrored for right legs.
    pub stance_leg: Vector3<f64>,
    /// Whether Virtual Model Control is on.
    pub vmc: bool,
    /// How many jumps in a row make the trial; 1 for a single jump.
    pub jumps: u32,
    /// Seed of everything random in the trial, for a simulator.
    pub seed: u64,
}

/// What makes a key press that energises good once, now: it dies with any change of mode, and of age.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Permit {
    /// How often the mode had changed, as far as the session had heard when it was given.
    pub mode_changes: u64,
    /// When the operator gave it, ns since the engine started.
    pub given_ns: u64,
}

/// What the session asks of the control thread. STOP does not travel here: it has its own latch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// The operator takes control of a robot that was only observed: damping is sent from now on.
    TakeControl,
    /// Nothing is sent any more: back to observing.
    Release,
    /// Energise: checks, then stand up.
    Arm(Permit),
    /// Sit down and disarm.
    SitDown,
    /// Run this trial: countdown, jump, settle.
    RunTrial(TrialSpec, Permit),
    /// Cancel a countdown.
    Cancel,
    /// The verdict is given: the review is over.
    EndReview,
    /// Nobody is there any more: land, sit down, and never energise again. It holds until the thread ends.
    Leave,
    /// A damped or faulted robot has been looked at: back to disarmed.
    Acknowledge {
        /// How often STOP had been pressed by then; a later STOP outlives this.
        stops: u64,
    },
}
