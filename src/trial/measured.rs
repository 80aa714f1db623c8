//! Measured values of a trial, and the rule by which its objective follows from them.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

use super::{JudgedBy, Task, Verdict};

/// Part of the cause of a verdict that was changed after it had become final; the operator's reason stands before it. Earlier versions
/// began the cause with it.
pub const CHANGED: &str = "changed by the operator";

/// Rule for a trial in which the robot bounces on after its landing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, IntoStaticStr, VariantArray)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum BounceRule {
    /// J is the displacement at rest, however often the robot flew.
    #[default]
    Ignore,
    /// J is the displacement at the end of the first landing.
    FirstLanding,
    /// J is 0, as of a fall.
    Zero,
}

/// Computation of the objective J from the measured values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectiveRule {
    /// Direction of the displacement, or of the turn.
    pub task: Task,
    /// Jumps in a row, where the measured values hold no row of each.
    pub jumps: u32,
    /// Rule for a robot that bounces on.
    pub bounce: BounceRule,
    /// Whether J is per second instead of per jump.
    pub rate: bool,
}

impl ObjectiveRule {
    /// The rule of one jump of `task`, bounces ignored.
    pub fn single(task: Task) -> ObjectiveRule {
        ObjectiveRule { task, jumps: 1, bounce: BounceRule::Ignore, rate: false }
    }
}

/// Displacement and turn since the start of a trial, in the world frame turned so that the trial starts at yaw 0.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Displacement {
    /// Time since the start of the first impulse, s.
    pub time_s: f64,
    /// Forward, m.
    pub dx_m: f64,
    /// To the left, m.
    pub dy_m: f64,
    /// Turn, unwrapped, counterclockwise positive, rad.
    pub dyaw_rad: f64,
}

/// One jump of a trial: from the start of its impulse to the start of the next one; the last one to the end of the trial.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct JumpRow {
    /// Start of the impulse, s since the start of the first one.
    pub time_s: f64,
    /// Position at the start of the impulse, forward of that of the trial, m.
    pub x_m: f64,
    /// The same to the left, m.
    pub y_m: f64,
    /// Turn up to the start of the impulse, unwrapped, rad.
    pub yaw_rad: f64,
    /// Angle between the trunk's and the world's z axis at the start of the impulse, rad.
    pub tilt_rad: f64,
    /// Largest height of the trunk above its height at the start of the impulse, m.
    pub rise_m: f64,
    /// Longest flight that begins in this jump, s.
    pub air_s: f64,
    /// Share of this jump in the displacement or turn of the task, m or rad.
    pub value: f64,
}

/// Measured values of a trial, in the world frame turned so that the trial starts at yaw 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MeasuredJump {
    /// Forward displacement x_final - x_init, m.
    pub dx_m: f64,
    /// Displacement to the left y_final - y_init, m.
    pub dy_m: f64,
    /// Turn, unwrapped, counterclockwise positive, rad.
    pub dyaw_rad: f64,
    /// Highest rise of the trunk over its height at the start, m.
    pub apex_m: f64,
    /// Longest time without any foot on the ground, s.
    pub air_s: f64,
    /// Time from the start of the first impulse to the end of the trial, s; 0 in records of an older version.
    #[serde(default)]
    pub end_s: f64,
    /// Objective J of a robot that does not fall, in the unit of the study; none in records of an older version.
    #[serde(default)]
    pub measured_value: Option<f64>,
    /// Flights after the last impulse; more than one means that the robot bounced on.
    #[serde(default)]
    pub flights: u32,
    /// Displacement at the first touchdown after the last impulse; none if the robot did not fly or did not land.
    #[serde(default)]
    pub touchdown: Option<Displacement>,
    /// Displacement at the end of the first landing after the last impulse; none unless the robot bounced on.
    #[serde(default)]
    pub first_landing: Option<Displacement>,
    /// Every jump, in order; empty in records of an older version.
    #[serde(default)]
    pub jumps: Vec<JumpRow>,
}

impl MeasuredJump {
    /// Returns whether the robot was still in the air when the trial ended.
    pub fn ended_in_the_air(&self) -> bool {
        self.flights > 0 && self.touchdown.is_none()
    }
}

/// One rollout of a trial that has several.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RepeatRecord {
    /// Seed of its noise and terrain. Text in JSON: numbers of other programs do not hold 64 bits.
    #[serde(with = "seed_as_text")]
    pub seed: u64,
    /// Its verdict; a void repeat is done again.
    pub verdict: Option<Verdict>,
    /// Origin of its verdict; none in records of an earlier version.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged_by: Option<JudgedBy>,
    /// Its value: 0 for a fall, none for void.
    pub value: Option<f64>,
    /// Reason of the verdict.
    pub cause: String,
    /// Measured values.
    pub measured: Option<MeasuredJump>,
}

mod seed_as_text {
    use serde::{Deserialize, Deserializer, Serializer, de};

    pub fn serialize<S: Serializer>(seed: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(seed)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}
