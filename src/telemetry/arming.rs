//! The pre-arm list: what must hold before a robot is energised. Names and findings; who looks is `control::arming` for
//! what a tick can know and `session::arming_checklist` for the rest.

use serde::{Deserialize, Serialize};

/// One item of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ArmingCheck {
    /// The robot's newest state is new.
    StateFresh,
    /// Few states are lost on the way.
    Loss,
    /// No state arrives corrupt.
    Checksums,
    /// The trunk is level.
    Upright,
    /// Every joint is inside its limits.
    JointsInside,
    /// The joints are near the pose of lying folded, from which standing up begins.
    LyingDown,
    /// There is charge enough for a series of jumps.
    Battery,
    /// No motor is hot.
    MotorsCool,
    /// The robot does not move: its gyroscope's bias can be trusted.
    GyroStill,
    /// Ticks begin on time.
    OnTime,
    /// Everything is recorded.
    Recorder,
    /// There is room for the recording.
    Disk,
    /// The operator's word: the robot is in low-level mode and was damped with the remote before.
    LowLevel,
    /// The operator's word: this is the configuration that is meant.
    Configuration,
    /// The operator's word: nobody is near the robot, and the remote is in hand.
    AreaClear,
    /// The STOP key was pressed and acknowledged once in this session.
    StopTested,
    /// Every motor reports servo mode: all of them will do what they are told, or none is told.
    MotorsFollow,
}

impl ArmingCheck {
    /// The checks that the control thread makes, in the order of the list.
    pub const CONTROL: [ArmingCheck; 11] = [
        ArmingCheck::StateFresh,
        ArmingCheck::Loss,
        ArmingCheck::Checksums,
        ArmingCheck::Upright,
        ArmingCheck::JointsInside,
        ArmingCheck::LyingDown,
        ArmingCheck::Battery,
        ArmingCheck::MotorsCool,
        ArmingCheck::MotorsFollow,
        ArmingCheck::GyroStill,
        ArmingCheck::OnTime,
    ];

    /// All checks, in the order of their numbers in a recording.
    pub const ALL: [ArmingCheck; 17] = [
        ArmingCheck::StateFresh,
        ArmingCheck::Loss,
        ArmingCheck::Checksums,
        ArmingCheck::Upright,
        ArmingCheck::JointsInside,
        ArmingCheck::LyingDown,
        ArmingCheck::Battery,
        ArmingCheck::MotorsCool,
        ArmingCheck::GyroStill,
        ArmingCheck::OnTime,
        ArmingCheck::Recorder,
        ArmingCheck::Disk,
        ArmingCheck::LowLevel,
        ArmingCheck::Configuration,
        ArmingCheck::AreaClear,
        ArmingCheck::StopTested,
        ArmingCheck::MotorsFollow,
    ];

    /// The words that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            ArmingCheck::StateFresh => "state fresh",
            ArmingCheck::Loss => "packet loss",
            ArmingCheck::Checksums => "checksums",
            ArmingCheck::Upright => "upright",
            ArmingCheck::JointsInside => "joints inside limits",
            ArmingCheck::LyingDown => "lying down",
            ArmingCheck::Battery => "battery",
            ArmingCheck::MotorsCool => "motors cool",
            ArmingCheck::GyroStill => "gyro still",
            ArmingCheck::OnTime => "loop on time",
            ArmingCheck::Recorder => "recorder",
            ArmingCheck::Disk => "disk space",
            ArmingCheck::LowLevel => "low-level mode, damped",
            ArmingCheck::Configuration => "configuration",
            ArmingCheck::AreaClear => "area clear, remote in hand",
            ArmingCheck::StopTested => "STOP tested",
            ArmingCheck::MotorsFollow => "motors follow",
        }
    }

    /// Whether a simulated robot needs it too: it hurts nobody, and is carried to its mark in whatever pose it lies.
    pub const fn needed_in_simulation(self) -> bool {
        matches!(self, ArmingCheck::StateFresh | ArmingCheck::Recorder | ArmingCheck::Disk)
    }
}

/// How a check stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum ArmingCheckState {
    /// It holds.
    Passed,
    /// It does not hold.
    #[default]
    Failed,
    /// It waits for the operator's word, or for the operator to test STOP.
    Waiting,
    /// The simulator does not need it.
    NotNeeded,
}

impl ArmingCheckState {
    /// All states.
    pub const ALL: [ArmingCheckState; 4] =
        [ArmingCheckState::Passed, ArmingCheckState::Failed, ArmingCheckState::Waiting, ArmingCheckState::NotNeeded];

    /// The words that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            ArmingCheckState::Passed => "passed",
            ArmingCheckState::Failed => "failed",
            ArmingCheckState::Waiting => "waiting",
            ArmingCheckState::NotNeeded => "not needed",
        }
    }

    /// Whether the robot may be armed as far as this check goes.
    pub const fn allows(self) -> bool {
        matches!(self, ArmingCheckState::Passed | ArmingCheckState::NotNeeded)
    }
}

/// What one check of the control thread found; in the check's own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmingFinding {
    /// The check.
    pub check: ArmingCheck,
    /// How it stands.
    pub state: ArmingCheckState,
    /// What was measured; not finite where nothing is known.
    pub measured: f64,
    /// What is allowed at most, or for the battery at least.
    pub allowed: f64,
    /// The joint that it is about, 0..12; none where it is about the whole robot.
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

    /// Whether `check` is in it.
    pub fn contains(self, check: ArmingCheck) -> bool {
        self.0 & (1 << check as u32) != 0
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The checks in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = ArmingCheck> {
        ArmingCheck::ALL.into_iter().filter(move |check| self.contains(*check))
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

/// What the control thread found last, in the order of [`ArmingCheck::CONTROL`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmingFindings(pub [ArmingFinding; ArmingCheck::CONTROL.len()]);

impl Default for ArmingFindings {
    /// Nothing is known yet, so nothing has passed.
    fn default() -> ArmingFindings {
        ArmingFindings(ArmingCheck::CONTROL.map(|check| ArmingFinding {
            check,
            state: ArmingCheckState::Failed,
            measured: f64::NAN,
            allowed: f64::NAN,
            joint: None,
        }))
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

    /// What was found of `check`; none if it is not the control thread's.
    pub fn get(&self, check: ArmingCheck) -> Option<&ArmingFinding> {
        self.0.iter().find(|finding| finding.check == check)
    }
}
