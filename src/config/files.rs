//! The files of a configuration folder as typed values.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::control::settings::{
    ApprovalLimits, ArmingLimits, EstimatorSettings, FailsafeLimits, FallLimits, GateLimits, RampSettings,
    SettleSettings, TaskControl,
};
use crate::optimize::ask::SamplerConfig;

/// `control.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ControlFile {
    /// Ramp of standing up.
    pub stand_up: RampSettings,
    /// Ramp of sitting down.
    pub sit_down: RampSettings,
    /// Time from approval to impulse.
    pub countdown: CountdownSettings,
    /// End of a trial.
    pub settle: SettleSettings,
    /// Contact of a foot, from the simulator's true forces.
    pub contact: ContactSettings,
    /// Estimator of the trunk's state.
    pub estimator: EstimatorSettings,
    /// Scheduling of the control thread.
    pub realtime: RealtimeFile,
    /// Controller of each task's trials, by name.
    pub tasks: BTreeMap<String, TaskControl>,
}

/// Scheduling of the control thread.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct RealtimeFile {
    /// Priority under SCHED_FIFO on hardware, 1 to 99; 0 requests none.
    pub hardware_priority: u8,
    /// The same on the simulator.
    pub simulator_priority: u8,
    /// Core of the thread; -1 leaves the choice to the system.
    pub core: i64,
    /// Whether the program's memory is locked.
    pub lock_memory: bool,
}

/// Time from approval to impulse, in stance.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct CountdownSettings {
    /// On the simulator, s.
    pub simulator_s: f64,
    /// On hardware, s.
    pub hardware_s: f64,
}

/// Contact of a foot, from the simulator's true forces.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct ContactSettings {
    /// Least ground force of a foot in contact, N.
    pub force_n: f64,
}

/// `optimize.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct OptimizeFile {
    /// Trials that count (accepted or fallen).
    pub trials: u32,
    /// Source of the objective, `truth` or `estimate`; none for the default of the backend.
    pub objective: Option<String>,
    /// Bounds of each parameter, in its unit.
    pub bounds: BTreeMap<String, [f64; 2]>,
    /// Parameters that each task optimizes.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// The sampler.
    pub sampler: SamplerConfig,
    /// Repeats of the best points.
    pub confirm: ConfirmFile,
    /// Several programs on one study.
    pub workers: WorkersFile,
    /// First point of a new study of each task, as `export to config` writes it.
    #[serde(default)]
    pub first: BTreeMap<String, BTreeMap<String, f64>>,
}

/// End of the repeats that confirm the best point.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct ConfirmFile {
    /// Points that are repeated, 2 to 10.
    pub contenders: u32,
    /// Probability that the leading point is the best, 0.5 to 1.
    pub confidence: f64,
}

/// Several programs on one study.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct WorkersFile {
    /// Time without a change after which a running trial of another worker is closed, s.
    pub abandoned_s: f64,
}

/// `safety.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SafetyFile {
    /// Limits beyond which the robot has fallen.
    pub fall: FallLimits,
    /// Limits of the last gate before the motors.
    pub gate: GateLimits,
    /// Limits of the arming checks.
    pub pre_arm: ArmingLimits,
    /// Lifetime of an approval.
    pub approval: ApprovalLimits,
    /// Limits of the failsafe.
    pub watchdog: FailsafeLimits,
    /// Widest bounds of each parameter, in its unit.
    pub parameters: BTreeMap<String, [f64; 2]>,
    /// Allowed range of each gain of the controller, in its unit.
    pub gains: BTreeMap<String, [f64; 2]>,
}
