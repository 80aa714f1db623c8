//! The files of a configuration folder as typed values.
#![expect(missing_docs, reason = "the files of config/ explain every key with its unit and source")]

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::control::settings::{
    ApprovalLimits, ArmingLimits, ConsistencyLimits, EstimatorSettings, FailsafeLimits, FallLimits, GateLimits,
    RampSettings, ReadyLimits, RemoteSettings, SettleSettings, TaskControl,
};
use crate::optimize::ask::SamplerConfig;
use crate::trial::HopEnvelope;

/// `control.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ControlFile {
    pub stand_up: RampSettings,
    pub sit_down: RampSettings,
    pub countdown: CountdownSettings,
    pub settle: SettleSettings,
    pub contact: ContactSettings,
    pub estimator: EstimatorSettings,
    pub realtime: RealtimeFile,
    pub recording: RecordingFile,
    pub tasks: BTreeMap<String, TaskControl>,
}

/// Scheduling of the control thread.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct RealtimeFile {
    /// Priority under SCHED_FIFO on hardware, 1 to 99; 0 requests none.
    pub hardware_priority: u8,
    pub simulator_priority: u8,
    /// Core of the thread; -1 leaves the choice to the system.
    pub core: i64,
    pub lock_memory: bool,
}

/// Rate of the ticks in a recording, and the limits of its files.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct RecordingFile {
    /// Whether every tick is recorded while the robot is disarmed, too.
    pub full_rate: bool,
    /// Size after which a recording continues in the next file, MB (10^6 bytes).
    pub rotate_mb: u32,
    pub rotate_minutes: f64,
}

/// Time from approval to impulse, in stance.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct CountdownSettings {
    pub simulator_s: f64,
    pub hardware_s: f64,
    pub blend_s: f64,
}

/// Contact of a foot, from the simulator's true forces.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct ContactSettings {
    pub force_n: f64,
}

/// `optimize.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct OptimizeFile {
    pub trials: u32,
    /// Source of the objective, `truth` or `estimate`; none for the default of the backend.
    pub objective: Option<String>,
    pub bounds: BTreeMap<String, [f64; 2]>,
    pub parameters: BTreeMap<String, Vec<String>>,
    pub sampler: SamplerConfig,
    /// Price of a fall in each task ([`SamplerConfig::fall_price`]).
    pub fall_price: BTreeMap<String, f64>,
    pub confirm: ConfirmFile,
    pub workers: WorkersFile,
    /// First point of a new study of each task, as `export to config` writes it.
    #[serde(default)]
    pub first: BTreeMap<String, BTreeMap<String, f64>>,
}

/// End of the repeats that confirm the best point.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct ConfirmFile {
    pub contenders: u32,
    pub confidence: f64,
}

/// Several programs on one study.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct WorkersFile {
    pub abandoned_s: f64,
}

/// `safety.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SafetyFile {
    pub fall: FallLimits,
    pub gate: GateLimits,
    #[serde(rename = "pre_arm")]
    pub arming: ArmingLimits,
    pub ready: ReadyLimits,
    pub approval: ApprovalLimits,
    pub hop_envelope: HopEnvelope,
    #[serde(rename = "watchdog")]
    pub failsafe: FailsafeLimits,
    pub consistency: ConsistencyLimits,
    pub remote: RemoteSettings,
    pub parameters: BTreeMap<String, [f64; 2]>,
    pub gains: BTreeMap<String, [f64; 2]>,
}
