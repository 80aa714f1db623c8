//! Commands from the session to the control thread.

use nalgebra::Vector3;

use super::LandingTerms;
use crate::trial::{BounceRule, Gains, JumpParameters, ObjectiveRule, Task};

/// Settings of one trial; latched when the trial starts.
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
    /// Landing terms.
    pub landing: LandingTerms,
    /// Jumps in a row; 1 for a single jump.
    pub jumps: u32,
    /// No impulse begins at this time since the first one or later, s; infinite without a limit.
    pub duration_s: f64,
    /// Longest wait of the oscillator at the end of a pause for all feet down and quiet, s; 0 for none.
    pub landing_wait_s: f64,
    /// Rule for a robot that bounces on.
    pub bounce: BounceRule,
    /// Whether the objective is per second instead of per jump.
    pub rate: bool,
    /// Seed of the simulator's random numbers.
    pub seed: u64,
}

impl TrialSpec {
    /// Computation of the trial's objective.
    pub fn objective(&self) -> ObjectiveRule {
        ObjectiveRule { task: self.task, jumps: self.jumps, bounce: self.bounce, rate: self.rate }
    }
}

/// Permit of one key press, or of the automatic rule, that energises; void after any change of mode, and after a time limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Permit {
    /// Changes of mode that the session had received when it handled the request.
    pub mode_changes: u64,
    /// Time of the key press, ns since the engine started.
    pub given_ns: u64,
}

/// A command of the session to the control thread. STOP has a latch of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the doc of the variant describes its field")]
pub enum Command {
    /// Take control of an observed robot: damping is sent from now on.
    TakeControl,
    /// Stop sending: back to OBSERVE.
    Release,
    /// Energise: checks, then stand up.
    Arm(Permit),
    /// Sit down and disarm.
    SitDown,
    /// Run this trial: countdown, jump, settle.
    RunTrial(TrialSpec, Permit),
    /// Cancel a countdown.
    Cancel,
    /// End the review: the verdict is given.
    EndReview,
    /// The session ends: land, sit down, and never energise again.
    Leave,
    /// Acknowledge DAMPED or FAULT and the first `stops` STOPs: back to DISARMED. A later STOP stays set.
    Acknowledge { stops: u64 },
    /// Call a robot that sends nothing until it is commanded; the operator has pressed a key for it.
    Contact,
}

impl std::fmt::Display for Command {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Command::TakeControl => f.write_str("to take control"),
            Command::Release => f.write_str("to release the robot"),
            Command::Arm(_) => f.write_str("to stand up"),
            Command::Leave => f.write_str("to end the session"),
            Command::SitDown => f.write_str("to sit down"),
            Command::RunTrial(spec, _) => write!(f, "trial {}", spec.trial),
            Command::Cancel => f.write_str("to cancel"),
            Command::EndReview => f.write_str("to end the review"),
            Command::Acknowledge { .. } => f.write_str("the acknowledgement"),
            Command::Contact => f.write_str("to call the robot"),
        }
    }
}
