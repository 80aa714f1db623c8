//! Arming checks: names and findings. `control::arming` makes those of the control thread, `session::arming_checklist` the others.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

/// An arming check: a condition that must hold before the robot is energised. The order is the number in recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
#[expect(missing_docs, reason = "`control::arming` and `session::arming_checklist` describe each check")]
pub enum ArmingCheck {
    #[strum(serialize = "state fresh")]
    StateFresh,
    #[strum(serialize = "packet loss")]
    Loss,
    Checksums,
    Upright,
    #[strum(serialize = "joints inside limits")]
    JointsInside,
    #[strum(serialize = "lying down")]
    LyingDown,
    Battery,
    #[strum(serialize = "motors cool")]
    MotorsCool,
    #[strum(serialize = "gyro still")]
    GyroStill,
    #[strum(serialize = "loop on time")]
    OnTime,
    Recorder,
    #[strum(serialize = "disk space")]
    Disk,
    #[strum(serialize = "low-level mode, damped")]
    LowLevel,
    Configuration,
    #[strum(serialize = "area clear, remote in hand")]
    AreaClear,
    #[strum(serialize = "STOP tested")]
    StopTested,
    #[strum(serialize = "motors follow")]
    MotorsFollow,
    #[strum(serialize = "inertial unit live")]
    InertialLive,
    #[strum(serialize = "gravity")]
    Gravity,
    #[strum(serialize = "orientation")]
    Orientation,
    #[strum(serialize = "foot sensors")]
    FootSensors,
    #[strum(serialize = "robot clock")]
    RobotClock,
    #[strum(serialize = "joint velocity")]
    JointVelocity,
    #[strum(serialize = "remote answers")]
    Remote,
    #[strum(serialize = "real-time priority")]
    Priority,
    #[strum(serialize = "locked memory")]
    LockedMemory,
    #[strum(serialize = "operator's connection")]
    Connection,
    #[strum(serialize = "link delay")]
    LinkDelay,
}

impl ArmingCheck {
    /// The checks of the control thread, in the order of the list.
    pub const CONTROL: [ArmingCheck; 19] = [
        ArmingCheck::StateFresh,
        ArmingCheck::Loss,
        ArmingCheck::LinkDelay,
        ArmingCheck::Checksums,
        ArmingCheck::Upright,
        ArmingCheck::JointsInside,
        ArmingCheck::LyingDown,
        ArmingCheck::Battery,
        ArmingCheck::MotorsCool,
        ArmingCheck::MotorsFollow,
        ArmingCheck::GyroStill,
        ArmingCheck::OnTime,
        ArmingCheck::InertialLive,
        ArmingCheck::Gravity,
        ArmingCheck::Orientation,
        ArmingCheck::FootSensors,
        ArmingCheck::RobotClock,
        ArmingCheck::JointVelocity,
        ArmingCheck::Remote,
    ];

    /// All values in order.
    pub const ALL: &'static [ArmingCheck] = Self::VARIANTS;

    /// Name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether the simulator needs the check too: a simulated robot is harmless, and is placed whatever its pose.
    pub const fn needed_in_simulation(self) -> bool {
        matches!(self, ArmingCheck::StateFresh | ArmingCheck::Recorder | ArmingCheck::Disk)
    }
}

/// State of an arming check. The order is the number in recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum ArmingCheckState {
    /// The condition holds.
    Passed,
    /// The condition does not hold.
    #[default]
    Failed,
    /// Waits for the operator's confirmation, or for the test of STOP.
    Waiting,
    /// The simulator does not need it.
    #[strum(serialize = "not needed")]
    NotNeeded,
}

impl ArmingCheckState {
    /// All values in order.
    pub const ALL: &'static [ArmingCheckState] = Self::VARIANTS;

    /// Name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether the check permits arming.
    pub const fn allows(self) -> bool {
        matches!(self, ArmingCheckState::Passed | ArmingCheckState::NotNeeded)
    }
}

/// Finding of one check of the control thread, in the check's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmingFinding {
    /// The check.
    pub check: ArmingCheck,
    /// Its state.
    pub state: ArmingCheckState,
    /// Measured value; not finite where it is not known.
    pub measured: f64,
    /// Limit: the largest value, for the battery the smallest.
    pub allowed: f64,
    /// Index of the joint, 0..12; none for a finding about the whole robot.
    pub joint: Option<u8>,
}

/// A set of checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ArmingCheckSet(u32);

impl ArmingCheckSet {
    /// Without any check.
    pub const EMPTY: ArmingCheckSet = ArmingCheckSet(0);

    /// Adds `check`.
    pub fn insert(&mut self, check: ArmingCheck) {
        self.0 |= 1 << check as u32;
    }

    /// Takes `check` out.
    pub fn remove(&mut self, check: ArmingCheck) {
        self.0 &= !(1 << check as u32);
    }

    /// Whether the set holds `check`.
    pub fn contains(self, check: ArmingCheck) -> bool {
        self.0 & (1 << check as u32) != 0
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The checks in the order of their numbers in recordings.
    pub fn iter(self) -> impl Iterator<Item = ArmingCheck> {
        ArmingCheck::ALL.iter().copied().filter(move |check| self.contains(*check))
    }
}

impl std::fmt::Display for ArmingCheckSet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (place, check) in self.iter().enumerate() {
            write!(f, "{}{}", if place == 0 { "" } else { ", " }, check.name())?;
        }
        Ok(())
    }
}

/// Latest findings of the control thread, in the order of [`ArmingCheck::CONTROL`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmingFindings(pub [ArmingFinding; ArmingCheck::CONTROL.len()]);

impl Default for ArmingFindings {
    /// Nothing measured yet: every check fails.
    fn default() -> ArmingFindings {
        let (state, measured, allowed) = (ArmingCheckState::Failed, f64::NAN, f64::NAN);
        ArmingFindings(ArmingCheck::CONTROL.map(|check| ArmingFinding { check, state, measured, allowed, joint: None }))
    }
}

impl ArmingFindings {
    /// The checks that forbid arming.
    pub fn failing(&self) -> ArmingCheckSet {
        let mut failing = ArmingCheckSet::EMPTY;
        for finding in self.0.iter().filter(|finding| !finding.state.allows()) {
            failing.insert(finding.check);
        }
        failing
    }

    /// The finding of `check`; none for a check of the session.
    pub fn get(&self, check: ArmingCheck) -> Option<&ArmingFinding> {
        self.0.iter().find(|finding| finding.check == check)
    }
}
