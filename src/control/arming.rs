//! The checks of the pre-arm list that a tick can make: from the newest state, the link and the pace of the last seconds.
//! `Cycle` refuses to arm while one of them fails, whatever the session says. List: `research/operators.md` D.4.

use super::limits::ticks;
use super::settings::ControlSettings;
use crate::robot::recent::Recent;
use crate::robot::{JOINTS, LinkStatus, RobotState};
use crate::telemetry::{ArmingCheck, ArmingCheckState, ArmingFinding, ArmingFindings, Estimate};

/// Fewer ticks than this say nothing about the pace.
const PACE_KNOWN_TICKS: u32 = 1000;

/// What the checks remember from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ArmingChecks {
    /// Ticks that began later than they may.
    late: Recent,
    /// New states in which the gyroscope has been still, since it last moved, fell silent or restarted.
    still: u32,
}

/// What one tick knows.
#[derive(Debug, Clone, Copy)]
pub struct ArmingInputs<'a> {
    /// The newest state.
    pub state: &'a RobotState,
    /// What the controller makes of it.
    pub estimate: &'a Estimate,
    /// Age of that state, ms.
    pub state_age_ms: u32,
    /// The link; none for a machine without one.
    pub link: Option<LinkStatus>,
}

impl ArmingChecks {
    /// Once per tick: the pace, and whether the robot lies still. An old state says nothing of it: the tick counts neither way,
    /// and what was seen before a silence that cuts, or before a restart, is forgotten.
    pub fn observe(
        &mut self,
        lateness_ns: u64,
        state: &RobotState,
        state_age_ms: u32,
        restarted: bool,
        settings: &ControlSettings,
    ) {
        let allowed = &settings.pre_arm;
        self.late.advance();
        self.late.add(u32::from(lateness_ns as f64 * 1e-6 > allowed.late_ms));
        let still = state.imu.gyro_body.norm() <= allowed.gyro_rad_s;
        if restarted || !still || state_age_ms > settings.watchdog.state_age_ms {
            self.still = 0;
        } else if state_age_ms == 0 {
            self.still = self.still.saturating_add(1);
        }
    }

    /// How each check stands now.
    pub fn findings(&self, seen: &ArmingInputs, settings: &ControlSettings) -> ArmingFindings {
        let mut findings = ArmingFindings(ArmingCheck::CONTROL.map(|check| self.find(check, seen, settings)));
        if !settings.hardware {
            for finding in findings.0.iter_mut().filter(|finding| !finding.check.needed_in_simulation()) {
                finding.state = ArmingCheckState::NotNeeded;
            }
        }
        findings
    }

    fn find(&self, check: ArmingCheck, seen: &ArmingInputs, settings: &ControlSettings) -> ArmingFinding {
        let allowed = &settings.pre_arm;
        let state = seen.state;
        let at_most = |measured: f64, allowed: f64| ArmingFinding {
            check,
            // Written so that what is not a number fails.
            state: if measured <= allowed { ArmingCheckState::Passed } else { ArmingCheckState::Failed },
            measured,
            allowed,
            joint: None,
        };
        // The joint that is worst by `value`.
        let worst = |value: &dyn Fn(usize) -> f64, allowed: f64| {
            let first = ArmingFinding { joint: Some(0), ..at_most(value(0), allowed) };
            (1..JOINTS).fold(first, |worst, joint| {
                let here = value(joint);
                // A number that is none stays the worst of all.
                if here <= worst.measured || worst.measured.is_nan() {
                    worst
                } else {
                    ArmingFinding { joint: Some(joint as u8), ..at_most(here, allowed) }
                }
            })
        };
        match check {
            ArmingCheck::StateFresh => at_most(f64::from(seen.state_age_ms), f64::from(allowed.state_age_ms)),
            // A machine without a link loses nothing on the way.
            ArmingCheck::Loss => at_most(seen.link.map_or(0.0, |link| link.loss_share()), allowed.loss_share),
            ArmingCheck::Checksums => {
                at_most(seen.link.map_or(0.0, |link| f64::from(link.recent_corrupt)), f64::from(allowed.corrupt))
            }
            ArmingCheck::Upright => {
                let [roll, pitch, _] = seen.estimate.roll_pitch_yaw.into();
                // `max` would prefer the number to the one that is none.
                let tilt = if (roll + pitch).is_nan() { f64::NAN } else { roll.abs().max(pitch.abs()) };
                at_most(tilt, allowed.tilt_rad)
            }
            ArmingCheck::JointsInside => {
                let beyond = |joint: usize| {
                    let q = state.joint_position[joint];
                    let (least, most) = (settings.min_position[joint], settings.max_position[joint]);
                    if q.is_nan() { q } else { (least - q).max(q - most) }
                };
                worst(&beyond, allowed.joint_margin_rad)
            }
            ArmingCheck::LyingDown => {
                let away = |joint: usize| (state.joint_position[joint] - settings.lying_position[joint]).abs();
                worst(&away, allowed.lying_tolerance_rad)
            }
            ArmingCheck::Battery => {
                let charge = state.battery.map_or(f64::NAN, |battery| battery.charge_percent);
                let passed = charge >= allowed.battery_percent;
                ArmingFinding {
                    state: if passed { ArmingCheckState::Passed } else { ArmingCheckState::Failed },
                    ..at_most(charge, allowed.battery_percent)
                }
            }
            ArmingCheck::MotorsCool => worst(&|joint| state.motor_temperature_c[joint], allowed.motor_c),
            ArmingCheck::GyroStill => {
                let finding = at_most(state.imu.gyro_body.norm(), allowed.gyro_rad_s);
                if self.still < ticks(allowed.still_s) {
                    ArmingFinding { state: ArmingCheckState::Failed, ..finding }
                } else {
                    finding
                }
            }
            ArmingCheck::OnTime => {
                let finding =
                    at_most(f64::from(self.late.sum()) / f64::from(self.late.span_ms().max(1)), allowed.late_share);
                if self.late.span_ms() < PACE_KNOWN_TICKS {
                    ArmingFinding { state: ArmingCheckState::Failed, measured: f64::NAN, ..finding }
                } else {
                    finding
                }
            }
            ArmingCheck::MotorsFollow => {
                // Servo mode is commanded while disarmed, too: who does not report it will not follow.
                let idle = state.motor_enabled.iter().filter(|enabled| !**enabled).count();
                let first = state.motor_enabled.iter().position(|enabled| !enabled);
                ArmingFinding { joint: first.map(|joint| joint as u8), ..at_most(idle as f64, 0.0) }
            }
            // Not this thread's: what is not looked at has not passed.
            ArmingCheck::Recorder
            | ArmingCheck::Disk
            | ArmingCheck::LowLevel
            | ArmingCheck::Configuration
            | ArmingCheck::AreaClear
            | ArmingCheck::StopTested => at_most(f64::NAN, f64::NAN),
        }
    }
}
