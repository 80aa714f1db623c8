//! The motor command of each mode, and the changes of mode as jump and ramp progress.

use super::Cycle;
use crate::control::leg::{self, LegTarget};
use crate::control::mode::Trigger;
use crate::control::ramp::RampProgress;
use crate::control::running_trial::{RunningTrial, TrialProgress};
use crate::robot::{JointCommand, Joints, LEGS};
use crate::telemetry::{Fault, Mode, TransitionCause, TrialEnd};
use crate::trial::Gains;
use nalgebra::Vector3;

impl Cycle {
    /// Returns the motor command of this mode, after the changes of mode that need no command.
    pub(super) fn decide(&mut self) -> JointCommand {
        self.follow_trial();
        self.follow_ramp();
        self.joint_command()
    }

    /// Changes the mode as the jump progresses.
    fn follow_trial(&mut self) {
        if self.holds_stance() {
            return;
        }
        self.hold_further_jumps();
        if let Some(jump) = &mut self.trial {
            let progress = match jump.update(&self.tick.state, &self.tick.estimate, &self.settings) {
                // After a fault the landing ends when the robot stands; rest is not required.
                TrialProgress::Settle if self.landing.is_some() && jump.landed_s() >= self.settings.failsafe.land_s => {
                    TrialProgress::Over(TrialEnd::NotQuiet)
                }
                progress => progress,
            };
            match (self.mode, progress) {
                (Mode::Countdown, TrialProgress::Jump | TrialProgress::Settle) => self.begin_impulse(),
                (Mode::Jump, TrialProgress::Settle) => self.trigger(Trigger::Landed, TransitionCause::StepFinished),
                (_, TrialProgress::Over(_)) if self.fault_landing.is_some() => self.end_fault_landing(),
                (_, TrialProgress::Over(TrialEnd::Fell(cause))) => {
                    self.trigger(Trigger::Fell, TransitionCause::Fell(cause))
                }
                (_, TrialProgress::Over(end)) => {
                    // A jump may end without SETTLE.
                    if self.mode == Mode::Jump {
                        self.trigger(Trigger::Landed, TransitionCause::StepFinished);
                    }
                    self.finish_trial(self.landing.map(TrialEnd::Fault).or(self.dropped).unwrap_or(end));
                    self.trigger(Trigger::Settled, TransitionCause::StepFinished);
                }
                _ => {}
            }
        }
    }

    /// Between jumps in a row, drops the further ones if something inhibits trials (HOLD).
    fn hold_further_jumps(&mut self) {
        if self.mode == Mode::Jump
            && let Some(inhibit) = self.inhibit()
        {
            self.drop_further_jumps(TrialEnd::Held(inhibit));
        }
    }

    /// Drops the jumps that have not begun, if any; the trial ends with `end` then, once the robot has landed.
    pub(super) fn drop_further_jumps(&mut self, end: TrialEnd) {
        if self.trial.as_mut().is_some_and(RunningTrial::land) {
            self.dropped.get_or_insert(end);
        }
    }

    /// Begins the impulse of a robot that is ready for it; otherwise cancels the countdown.
    fn begin_impulse(&mut self) {
        let Some(jump) = &self.trial else { return };
        let pose_rad = self.pose_of(&jump.spec().gains, &jump.spec().stance_leg);
        match self.inhibit().or_else(|| self.unready(&pose_rad)) {
            None => self.trigger(Trigger::CountdownOver, TransitionCause::StepFinished),
            Some(inhibit) => self.trigger(Trigger::Cancel, TransitionCause::NotReady(inhibit)),
        }
    }

    /// Changes the mode when a ramp has reached its pose or timed out.
    fn follow_ramp(&mut self) {
        if let Some(ramp) = &mut self.ramp {
            // The floor ends sitting down; a joint that it stops is not blocked.
            let watched = self.mode == Mode::StandUp || ramp.is_moving();
            if let Some(fault) = ramp.blocked(&self.tick.state, &self.settings).filter(|_| watched) {
                self.trigger(Trigger::Fault, TransitionCause::Fault(fault));
                return;
            }
            match ramp.progress(&self.tick.state.joint_position_rad) {
                RampProgress::Moving => {}
                RampProgress::Reached => self.trigger(Trigger::PoseReached, TransitionCause::StepFinished),
                RampProgress::TimedOut { .. } if self.mode == Mode::SitDown => {
                    // The floor may stop the robot short of the lying pose; damping is safe there.
                    self.trigger(Trigger::PoseReached, TransitionCause::StepFinished);
                }
                RampProgress::TimedOut { error_rad } => {
                    self.trigger(Trigger::Fault, TransitionCause::Fault(Fault::PoseTimeout { error_rad }));
                }
            }
        }
    }

    fn joint_command(&mut self) -> JointCommand {
        self.tick.torque_demanded = Joints::default();
        if let Some(hold) = self.fault_landing.as_mut().and_then(|landing| landing.hold.as_mut()) {
            return hold.command();
        }
        match (self.mode, &mut self.ramp, &self.trial) {
            (Mode::StandUp | Mode::SitDown, Some(ramp), _) => ramp.command(),
            (Mode::Countdown | Mode::Jump | Mode::Settle, _, Some(jump)) => {
                let mut target = jump.target(&self.tick.estimate);
                target.gains = self.blended(&target.gains);
                self.leg_command(&target)
            }
            (Mode::Ready | Mode::Review, _, _) => {
                let stand = self.settings.stand;
                let gains = self.blended(&stand.gains);
                self.leg_command(&LegTarget {
                    gains,
                    stance_leg: stand.stance_leg,
                    vmc: stand.vmc,
                    attitude_rate_gain: stand.attitude_rate_gain,
                    foot_offset_leg: [Vector3::zeros(); LEGS],
                    amplitudes_leg: [Vector3::zeros(); LEGS],
                    theta_rad: 0.0,
                })
            }
            _ => JointCommand::damping(self.settings.gate.damping_kd),
        }
    }

    fn leg_command(&mut self, target: &LegTarget) -> JointCommand {
        let (state, estimate) = (&self.tick.state, &self.tick.estimate);
        let torques = leg::torques(target, &self.feet, &state.joint_velocity_rad_s, estimate);
        self.tick.torque_demanded = torques;
        // The same law: tau + kd (0 - dq). A robot over a network stays damped if no further command arrives; a simulated one keeps the
        // torque of a tick, so that its results do not depend on this.
        if self.settings.hardware {
            JointCommand::damped_torques(&torques, target.gains.kd_joint, &state.joint_velocity_rad_s)
        } else {
            JointCommand::torques(&torques)
        }
    }

    /// Returns the gains of this tick on the way to `gains`. A simulated robot is placed with the gains of its trial.
    fn blended(&mut self, gains: &Gains) -> Gains {
        let settings = &self.settings;
        if settings.hardware {
            self.gains.next(gains, settings.blend_s.min(0.5 * settings.countdown_s))
        } else {
            *gains
        }
    }

    /// Joint angles of standing between trials, rad.
    pub(super) fn standing_pose(&self) -> Joints {
        self.pose_of(&self.settings.stand.gains, &self.settings.stand.stance_leg)
    }

    /// Joint angles of standing, rad: the nominal stance lowered by dz with 4 kp dz = m g, where the impedance carries the weight.
    /// The change from the ramp to impedance control then has no step of the pose; the torque of a joint steps, by 4.4 N m at a hip of
    /// the simulated Go1 with hardware-like motors.
    fn pose_of(&self, gains: &Gains, stance_leg: &Vector3<f64>) -> Joints {
        let sag = self.settings.weight_n / (LEGS as f64 * gains.kp);
        let foot_leg = stance_leg + Vector3::new(0.0, 0.0, sag);
        self.settings.geometry.stance(&foot_leg, &self.settings.lying_position)
    }
}
