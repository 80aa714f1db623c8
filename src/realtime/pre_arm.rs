//! The pre-arm list: what must hold before a robot is energised. Names and findings; who looks is `control::pre_arm` for
//! what a tick can know and `session::pre_arm` for the rest.

use serde::{Deserialize, Serialize};

/// One item of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Check {
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

impl Check {
    /// The checks that the control thread makes, in the order of the list.
    pub const CONTROL: [Check; 11] = [
        Check::StateFresh,
        Check::Loss,
        Check::Checksums,
        Check::Upright,
        Check::JointsInside,
        Check::LyingDown,
        Check::Battery,
        Check::MotorsCool,
        Check::MotorsFollow,
        Check::GyroStill,
        Check::OnTime,
    ];

    /// All checks, in the order of their numbers in a recording.
    pub const ALL: [Check; 17] = [
        Check::StateFresh,
        Check::Loss,
        Check::Checksums,
        Check::Upright,
        Check::JointsInside,
        Check::LyingDown,
        Check::Battery,
        Check::MotorsCool,
        Check::GyroStill,
        Check::OnTime,
        Check::Recorder,
        Check::Disk,
        Check::LowLevel,
        Check::Configuration,
        Check::AreaClear,
        Check::StopTested,
        Check::MotorsFollow,
    ];

    /// The words that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            Check::StateFresh => "state fresh",
            Check::Loss => "packet loss",
            Check::Checksums => "checksums",
            Check::Upright => "upright",
            Check::JointsInside => "joints inside limits",
            Check::LyingDown => "lying down",
            Check::Battery => "battery",
            Check::MotorsCool => "motors cool",
            Check::GyroStill => "gyro still",
            Check::OnTime => "loop on time",
            Check::Recorder => "recorder",
            Check::Disk => "disk space",
            Check::LowLevel => "low-level mode, damped",
            Check::Configuration => "configuration",
            Check::AreaClear => "area clear, remote in hand",
            Check::StopTested => "STOP tested",
            Check::MotorsFollow => "motors follow",
        }
    }

    /// Whether a simulated robot needs it too: it hurts nobody, and is carried to its mark in whatever pose it lies.
    pub const fn needed_in_simulation(self) -> bool {
        matches!(self, Check::StateFresh | Check::Recorder | Check::Disk)
    }
}

/// How a check stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum CheckState {
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

impl CheckState {
    /// All states.
    pub const ALL: [CheckState; 4] =
        [CheckState::Passed, CheckState::Failed, CheckState::Waiting, CheckState::NotNeeded];

    /// The words that the operator sees and that files hold.
    pub const fn name(self) -> &'static str {
        match self {
            CheckState::Passed => "passed",
            CheckState::Failed => "failed",
            CheckState::Waiting => "waiting",
            CheckState::NotNeeded => "not needed",
        }
    }

    /// Whether the robot may be armed as far as this check goes.
    pub const fn allows(self) -> bool {
        matches!(self, CheckState::Passed | CheckState::NotNeeded)
    }
}

/// What one check of the control thread found; in the check's own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// The check.
    pub check: Check,
    /// How it stands.
    pub state: CheckState,
    /// What was measured; not finite where nothing is known.
    pub measured: f64,
    /// What is allowed at most, or for the battery at least.
    pub allowed: f64,
    /// The joint that it is about, 0..12; none where it is about the whole robot.
    pub joint: Option<u8>,
}

/// A set of checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CheckSet(u32);

impl CheckSet {
    /// Without any check.
    pub const EMPTY: CheckSet = CheckSet(0);

    /// Adds `check`.
    pub fn insert(&mut self, check: Check) {
        self.0 |= 1 << check as u32;
    }

    /// Takes `check` out.
    pub fn remove(&mut self, check: Check) {
        self.0 &= !(1 << check as u32);
    }

    /// Whether `check` is in it.
    pub fn contains(self, check: Check) -> bool {
        self.0 & (1 << check as u32) != 0
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The checks in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = Check> {
        Check::ALL.into_iter().filter(move |check| self.contains(*check))
    }
}

impl std::fmt::Display for CheckSet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (place, check) in self.iter().enumerate() {
            write!(f, "{}{}", if place == 0 { "" } else { ", " }, check.name())?;
        }
        Ok(())
    }
}

/// What the control thread found last, in the order of [`Check::CONTROL`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Findings(pub [Finding; Check::CONTROL.len()]);

impl Default for Findings {
    /// Nothing is known yet, so nothing has passed.
    fn default() -> Findings {
        Findings(Check::CONTROL.map(|check| Finding {
            check,
            state: CheckState::Failed,
            measured: f64::NAN,
            allowed: f64::NAN,
            joint: None,
        }))
    }
}

impl Findings {
    /// The checks that forbid arming.
    pub fn failing(&self) -> CheckSet {
        let mut failing = CheckSet::EMPTY;
        for finding in self.0.iter().filter(|finding| !finding.state.allows()) {
            failing.insert(finding.check);
        }
        failing
    }

    /// What was found of `check`; none if it is not the control thread's.
    pub fn get(&self, check: Check) -> Option<&Finding> {
        self.0.iter().find(|finding| finding.check == check)
    }
}
