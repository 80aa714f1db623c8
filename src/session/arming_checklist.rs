//! The whole pre-arm list in words: what the control thread found, what the session sees, what the operator says.

use std::path::PathBuf;

use crate::control::settings::{ArmingLimits, ControlSettings};
use crate::recording::disk;
use crate::recording::record::ArmingCheckRecord;
use crate::recording::recorder::RecorderStatus;
use crate::robot::joint_name;
use crate::telemetry::{
    ArmingCheck, ArmingCheckSet, ArmingCheckState, ArmingFinding, ArmingFindings, Mode, TransitionCause,
};

use super::operator_request::OperatorCheck;

/// How far the test of the STOP key has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StopTest {
    Open,
    Pressed,
    Passed,
}

/// What the list is made with and what it remembers of this session.
#[derive(Debug, Clone)]
pub struct ArmingChecklist {
    limits: ArmingLimits,
    /// Free space that a trial needs, MB.
    trial_mb: u32,
    hardware: bool,
    /// Fingerprint of the configuration.
    configuration: String,
    /// Where the recording goes; none where nothing is kept.
    folder: Option<PathBuf>,
    /// What the operator has given their word on.
    words: ArmingCheckSet,
    /// When they gave it last on the area, ns.
    area_ns: u64,
    /// How often the robot has restarted, as far as the list has heard.
    reboots: u64,
    stop: StopTest,
}

impl ArmingChecklist {
    /// A list of which nothing is confirmed. `configuration` is shown beside the operator's word on it; `folder` is where
    /// the recording goes, none where nothing is kept.
    pub fn new(settings: &ControlSettings, configuration: String, folder: Option<PathBuf>) -> ArmingChecklist {
        ArmingChecklist {
            limits: settings.pre_arm,
            trial_mb: settings.watchdog.disk_free_mb,
            hardware: settings.hardware,
            configuration,
            folder,
            words: ArmingCheckSet::EMPTY,
            area_ns: 0,
            reboots: 0,
            stop: StopTest::Open,
        }
    }

    /// The operator gives their word.
    pub fn confirm(&mut self, check: OperatorCheck, time_ns: u64) {
        self.words.insert(check.check());
        if check == OperatorCheck::AreaClear {
            self.area_ns = time_ns;
        }
    }

    /// The robot is not armed yet at `time_ns`: a word that has grown old is taken back. Why, if one was.
    pub fn forget(&mut self, time_ns: u64) -> Option<String> {
        let age_s = time_ns.saturating_sub(self.area_ns) as f64 * 1e-9;
        let allowed_s = self.limits.area_clear_s;
        if age_s <= allowed_s || !self.words.contains(ArmingCheck::AreaClear) {
            return None;
        }
        self.words.remove(ArmingCheck::AreaClear);
        Some(format!(
            "the area was said to be clear more than {allowed_s:.0} s ago: look again, and give your word anew"
        ))
    }

    /// The mode changed: a word that the change makes worthless is taken back, and a STOP may have been a test.
    pub fn mode_changed(&mut self, from: Mode, to: Mode, cause: &TransitionCause) {
        if from.energised() && !to.energised() {
            // Somebody will now go to the robot.
            self.words.remove(ArmingCheck::AreaClear);
        }
        if let TransitionCause::Fault(fault) = cause
            && fault.voids_the_word()
        {
            self.take_back();
        }
        self.stop = match (self.stop, from, to, cause) {
            (StopTest::Open, Mode::Offline | Mode::Observe | Mode::Disarmed, Mode::Damped, TransitionCause::Stop) => {
                StopTest::Pressed
            }
            (StopTest::Pressed, Mode::Damped, Mode::Disarmed, _) => StopTest::Passed,
            (StopTest::Pressed, ..) => StopTest::Open,
            (state, ..) => state,
        };
    }

    /// The link has counted `reboots` restarts of the robot. True if there was one since the last call: in whatever mode it
    /// happened, also where it changed none, the operator's word is taken back.
    pub fn robot_restarted(&mut self, reboots: u64) -> bool {
        let restarted = reboots > self.reboots;
        self.reboots = reboots;
        if restarted {
            self.take_back();
        }
        restarted
    }

    /// A robot that restarted is not in low-level mode any more, and somebody may be at it.
    fn take_back(&mut self) {
        self.words.remove(ArmingCheck::LowLevel);
        self.words.remove(ArmingCheck::AreaClear);
    }

    /// How every item stands now.
    pub fn look(&self, findings: &ArmingFindings, recorder: &RecorderStatus) -> Vec<ArmingCheckRecord> {
        let found = findings.0.iter().map(|finding| self.words_of(finding));
        let own = [
            self.recorder(recorder),
            self.disk(),
            self.word(OperatorCheck::LowLevel, String::new(), "remote L2+A, L2+A, L2+B, L1+L2+START; your word"),
            self.word(OperatorCheck::Configuration, format!("{}, ", self.configuration), "your word on config/"),
            self.word(OperatorCheck::AreaClear, String::new(), "nobody within 2 m; your word"),
            self.stop_tested(),
        ];
        found.chain(own).collect()
    }

    /// Says so if the disk is too full for another trial.
    pub fn disk_low(&self) -> Option<String> {
        let free = disk::free_mb(self.folder.as_ref()?).ok()?;
        let needed = u64::from(self.trial_mb);
        (free < needed)
            .then(|| format!("{free} MB free where the recording goes, at least {needed} for a trial; make room"))
    }

    fn words_of(&self, finding: &ArmingFinding) -> ArmingCheckRecord {
        let ArmingFinding { check, state, measured, .. } = *finding;
        let limits = &self.limits;
        let joint = finding.joint.map(|joint| joint_name(joint as usize)).unwrap_or_default();
        let (found, needed) = match check {
            ArmingCheck::StateFresh => (format!("{measured:.0} ms old"), format!("at most {} ms", limits.state_age_ms)),
            ArmingCheck::Loss => {
                (format!("{:.1} % lost", measured * 100.0), format!("at most {} % in 5 s", limits.loss_share * 100.0))
            }
            ArmingCheck::Checksums => (format!("{measured:.0} corrupt"), format!("at most {} in 5 s", limits.corrupt)),
            ArmingCheck::Upright => {
                (format!("tilted {measured:.2} rad"), format!("at most {:.2} rad", limits.tilt_rad))
            }
            ArmingCheck::JointsInside => {
                let found = if measured > 0.0 { format!("{joint} {measured:.2} rad beyond") } else { "all".to_owned() };
                (found, format!("at most {:.2} rad beyond", limits.joint_margin_rad))
            }
            ArmingCheck::LyingDown => {
                (format!("{joint} {measured:.2} rad away"), format!("at most {:.2} rad", limits.lying_tolerance_rad))
            }
            ArmingCheck::Battery => (format!("{measured:.0} %"), format!("at least {:.0} %", limits.battery_percent)),
            ArmingCheck::MotorsCool => (format!("{joint} {measured:.0} C"), format!("at most {:.0} C", limits.motor_c)),
            ArmingCheck::MotorsFollow => {
                let found = if measured > 0.0 {
                    format!("{measured:.0} out of servo mode, {joint} first")
                } else {
                    "all in servo mode".to_owned()
                };
                (found, "every motor in servo mode".to_owned())
            }
            ArmingCheck::GyroStill => (
                format!("{measured:.2} rad/s"),
                format!("at most {:.2} rad/s for {} s", limits.gyro_rad_s, limits.still_s),
            ),
            ArmingCheck::OnTime => (
                format!("{:.1} % of ticks late", measured * 100.0),
                format!("at most {} % later than {} ms", limits.late_share * 100.0, limits.late_ms),
            ),
            _ => (String::new(), String::new()),
        };
        let found = if measured.is_finite() { found } else { "not known yet".to_owned() };
        self.item(check, state, found, needed)
    }

    fn recorder(&self, status: &RecorderStatus) -> ArmingCheckRecord {
        let (state, found) = match (&status.error, &self.folder) {
            (Some(error), _) => (ArmingCheckState::Failed, error.clone()),
            (None, Some(_)) if status.finished => (ArmingCheckState::Failed, "has ended".to_owned()),
            (None, Some(_)) => (ArmingCheckState::Passed, "recording".to_owned()),
            // Who asks for no recording of a simulation gets none; a real robot's jumps are always kept.
            (None, None) if self.hardware => (ArmingCheckState::Failed, "nothing is kept".to_owned()),
            (None, None) => (ArmingCheckState::NotNeeded, "nothing is to be kept".to_owned()),
        };
        self.item(ArmingCheck::Recorder, state, found, "every tick is recorded".to_owned())
    }

    fn disk(&self) -> ArmingCheckRecord {
        let needed = format!("at least {} MB", self.limits.disk_free_mb);
        let (state, found) = match &self.folder {
            None => (ArmingCheckState::NotNeeded, "nothing is to be kept".to_owned()),
            Some(folder) => match disk::free_mb(folder) {
                Ok(free) if free >= u64::from(self.limits.disk_free_mb) => {
                    (ArmingCheckState::Passed, format!("{free} MB"))
                }
                Ok(free) => (ArmingCheckState::Failed, format!("{free} MB")),
                Err(error) => (ArmingCheckState::Failed, error.to_string()),
            },
        };
        self.item(ArmingCheck::Disk, state, found, needed)
    }

    fn word(&self, check: OperatorCheck, about: String, needed: &str) -> ArmingCheckRecord {
        let check = check.check();
        let given = self.words.contains(check);
        let state = if given { ArmingCheckState::Passed } else { ArmingCheckState::Waiting };
        let found = format!("{about}{}", if given { "confirmed" } else { "not confirmed" });
        self.item(check, state, found, needed.to_owned())
    }

    fn stop_tested(&self) -> ArmingCheckRecord {
        let (state, found) = match self.stop {
            StopTest::Open => (ArmingCheckState::Waiting, "not in this session"),
            StopTest::Pressed => (ArmingCheckState::Waiting, "pressed, not acknowledged"),
            StopTest::Passed => (ArmingCheckState::Passed, "pressed and acknowledged"),
        };
        self.item(ArmingCheck::StopTested, state, found.to_owned(), "press STOP, then acknowledge".to_owned())
    }

    fn item(&self, check: ArmingCheck, state: ArmingCheckState, found: String, needed: String) -> ArmingCheckRecord {
        if self.hardware || check.needed_in_simulation() {
            ArmingCheckRecord { check, found, needed, state }
        } else {
            ArmingCheckRecord {
                check,
                found,
                needed: "not needed in simulation".to_owned(),
                state: ArmingCheckState::NotNeeded,
            }
        }
    }
}

/// What stands in the way of arming, all of it, in words; none if nothing does.
pub fn objections(list: &[ArmingCheckRecord]) -> Option<String> {
    let open: Vec<String> = list
        .iter()
        .filter(|item| !item.state.allows())
        .map(|item| format!("{}: {}, needed: {}", item.check.name(), item.found, item.needed))
        .collect();
    (!open.is_empty()).then(|| open.join("; "))
}
