//! Commands from the session to the control thread.

use nalgebra::Vector3;

use crate::trial::{Gains, JumpParameters, Task};

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
    /// Damping of Virtual Model Control, N s/m.
    pub attitude_rate_gain: f64,
    /// Time of the foot placement, s.
    pub foot_placement_s: f64,
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
