//! Trial settings of a task, and the trials that follow from them.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::telemetry::{Cutoff, LandingTerms, TrialSpec};
use crate::trial::{BounceRule, Gains, JumpParameters, Task};

/// Trial settings of one task: section `[tasks.<task>]` of `config/control.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskControl {
    /// Cartesian stiffness, N/m.
    pub kp: f64,
    /// Cartesian damping, N s/m.
    pub kd: f64,
    /// Joint damping, N m s/rad.
    pub kd_joint: f64,
    /// Attitude gain, N/m.
    pub k_att: f64,
    /// Nominal foot of a left leg, leg frame, m.
    pub stance_m: [f64; 3],
    /// Virtual Model Control on or off.
    pub vmc: bool,
    /// Damping of Virtual Model Control, N s/m; zero in the paper.
    pub attitude_rate_gain: f64,
    /// Time T of the foot placement, s: a swing foot is placed T times the trunk's velocity ahead; zero in the paper.
    pub foot_placement_s: f64,
    /// End of the profile force of a foot.
    pub cutoff: Cutoff,
    /// Time without contact after which `cutoff` ends the profile force of a foot, s.
    pub cutoff_lost_s: f64,
    /// Outward shift of a swing foot's nominal position, m; zero in the paper.
    pub landing_spread_m: f64,
    /// Time after the touchdown of a foot in which its shift returns to zero, s.
    pub landing_spread_s: f64,
    /// Jumps in a row, where no duration is given.
    pub jumps: u32,
    /// Duration of jumps in a row, s: the last impulse begins before it. None: `jumps` counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// Longest wait of the oscillator at the end of a pause for all feet down and quiet, s; 0 for none.
    pub landing_wait_s: f64,
    /// Frequency between impulses, Hz.
    pub f1_hz: f64,
    /// Rule for a robot that bounces on after its landing.
    pub bounce: BounceRule,
    /// Whether the objective is per second instead of per jump.
    pub rate: bool,
    /// Rollouts of a trial, each with a seed of its own; its value is their mean.
    pub repeats: u32,
}

impl TaskControl {
    /// The gains.
    pub fn gains(&self) -> Gains {
        Gains { kp: self.kp, kd: self.kd, kd_joint: self.kd_joint, k_att: self.k_att }
    }

    /// The nominal foot of a left leg, leg frame, m.
    pub fn stance_leg(&self) -> Vector3<f64> {
        self.stance_m.into()
    }

    /// Landing terms.
    pub fn landing(&self) -> LandingTerms {
        LandingTerms {
            cutoff: self.cutoff,
            cutoff_lost_s: self.cutoff_lost_s,
            spread_m: self.landing_spread_m,
            spread_s: self.landing_spread_s,
        }
    }

    /// Unit of the objective of `task`.
    pub fn unit(&self, task: Task) -> &'static str {
        task.objective_unit(self.rate)
    }

    /// Most jumps of a trial with this force profile.
    pub fn jumps(&self, jump: &JumpParameters) -> u32 {
        self.duration_s.map_or(self.jumps, |duration_s| jump.within(duration_s))
    }

    /// A trial of `task` with this force profile, as configured: number 0 and seed 0.
    pub fn trial(&self, task: Task, jump: JumpParameters) -> TrialSpec {
        TrialSpec {
            trial: 0,
            task,
            jump,
            gains: self.gains(),
            stance_leg: self.stance_leg(),
            vmc: self.vmc,
            attitude_rate_gain: self.attitude_rate_gain,
            foot_placement_s: self.foot_placement_s,
            landing: self.landing(),
            jumps: self.jumps(&jump),
            duration_s: self.duration_s.unwrap_or(f64::INFINITY),
            landing_wait_s: self.landing_wait_s,
            bounce: self.bounce,
            rate: self.rate,
            seed: 0,
        }
    }
}
