//! Commands of the session: carried out, or refused with the reason.

use super::{Cycle, TickInputs};
use crate::control::mode::{self, Trigger};
use crate::control::running_trial::RunningTrial;
use crate::robot::{Placement, Robot};
use crate::telemetry::{
    ArmingCheck, Command, CommandRefusal, Event, Mode, Permit, TransitionCause, TrialEnd, TrialSpec,
};

impl Cycle {
    /// Carries out a command, or reports its refusal as an event.
    pub(super) fn handle_command<R: Robot + ?Sized>(&mut self, command: &Command, inputs: &TickInputs, robot: &mut R) {
        let trigger = match command {
            Command::Contact => Trigger::Contact,
            Command::TakeControl => Trigger::TakeControl,
            Command::Release => Trigger::Release,
            Command::Arm(_) => Trigger::Arm,
            Command::SitDown => Trigger::SitDown,
            Command::RunTrial(..) => Trigger::Approve,
            Command::Cancel => Trigger::Cancel,
            Command::EndReview => Trigger::EndReview,
            Command::Acknowledge { .. } => Trigger::Acknowledge,
            // No trigger: from the next tick on the failsafes land an energised robot.
            Command::Leave => {
                self.session_left = true;
                return;
            }
        };
        if matches!(trigger, Trigger::SitDown | Trigger::Cancel) {
            self.lowered_ns = inputs.time_ns + inputs.lateness_ns;
        }
        // A jump cannot be sat down; of jumps in a row the further ones are dropped, and the robot sits down in REVIEW.
        let in_a_row = self.trial.as_ref().is_some_and(RunningTrial::is_in_a_row);
        if trigger == Trigger::SitDown && in_a_row && matches!(self.mode, Mode::Jump | Mode::Settle) {
            self.drop_further_jumps(TrialEnd::SatDown);
            self.sits_down_after.get_or_insert(TransitionCause::Command);
            return;
        }
        let refusal = self.refusal(command, trigger, inputs);
        if let Command::Arm(permit) | Command::RunTrial(_, permit) = command {
            self.answered_permit_ns = self.answered_permit_ns.max(Some(permit.given_ns));
        }
        if let Some(because) = refusal {
            self.events.push(Event::Refused { command: *command, mode: self.mode, because });
            return;
        }
        match command {
            Command::Contact => robot.begin_contact(),
            Command::RunTrial(spec, _) => {
                // A robot that was placed is in its stance; another one must be ready where it stands.
                if !self.place_for_trial(robot, spec)
                    && let Some(unready) = self.unready(&self.standing_pose())
                {
                    let because = CommandRefusal::Inhibited(unready);
                    self.events.push(Event::Refused { command: *command, mode: self.mode, because });
                    return;
                }
                self.trial = Some(RunningTrial::begin(spec, &self.settings));
                self.trial_ticks = 0;
                self.dropped = None;
                self.sits_down_after = None;
            }
            Command::Arm(_) => {
                // The robot may have been carried since the last arming, which voids position and velocity.
                self.estimator.reset();
                self.estimate();
                if self.needs_placing() {
                    let lying = Placement { joint_position: self.settings.lying_position, lying: true, seed: 0 };
                    if self.place(robot, &lying) {
                        self.events.push(Event::SetUpright);
                    }
                }
            }
            _ => {}
        }
        self.trigger(trigger, TransitionCause::Command);
    }

    /// The reason to refuse a command; none if it is carried out.
    ///
    /// 1. While STOP is set, every command but `Leave` is refused. An acknowledgement of the last STOP clears the latch before the tick.
    /// 2. `mode::next` must allow the trigger in the present mode.
    /// 3. Taking control and arming need an operator's console with a heartbeat, and a session that has not ended.
    /// 4. Arming and approval need a fresh permit.
    /// 5. Arming needs every arming check of the control thread, whatever the session says.
    /// 6. Approval needs that nothing inhibits trials. Whether the robot is ready for a jump is known after its placement alone.
    /// 7. An acknowledgement needs that no failsafe trips any more.
    fn refusal(&self, command: &Command, trigger: Trigger, inputs: &TickInputs) -> Option<CommandRefusal> {
        if inputs.stop {
            return Some(CommandRefusal::Stopped);
        }
        if mode::next(self.mode, trigger).is_none() {
            return Some(CommandRefusal::Mode);
        }
        match *command {
            Command::TakeControl => self.operator_absent(inputs),
            Command::Arm(permit) => {
                self.operator_absent(inputs).or_else(|| self.permit_expired(permit, inputs)).or_else(|| {
                    let failing = self.findings.failing();
                    (!failing.is_empty()).then_some(CommandRefusal::Checks(failing))
                })
            }
            Command::Acknowledge { .. } => self.tripped.map(CommandRefusal::FaultPersists),
            Command::RunTrial(_, permit) => {
                self.permit_expired(permit, inputs).or_else(|| self.inhibit().map(CommandRefusal::Inhibited))
            }
            _ => None,
        }
    }

    /// Refuses without a heartbeat of the operator's console, or after the end of the session.
    fn operator_absent(&self, inputs: &TickInputs) -> Option<CommandRefusal> {
        let (silent_ms, allowed_ms) = (inputs.operator_silent_ms, self.settings.failsafe.operator_silent_ms);
        if self.session_left {
            Some(CommandRefusal::Leaving)
        } else if silent_ms > allowed_ms {
            Some(CommandRefusal::OperatorSilent { silent_ms, allowed_ms })
        } else {
            None
        }
    }

    /// Refuses a permit that is older than a change of mode, a command to sit down or to cancel or another permit, or too old. One
    /// that was refused is used up: the robot must not move later for a key press that was answered with no.
    fn permit_expired(&self, Permit { mode_changes, given_ns }: Permit, inputs: &TickInputs) -> Option<CommandRefusal> {
        let age_s = inputs.time_ns.saturating_sub(given_ns) as f64 * 1e-9;
        let allowed_s = self.settings.approval.expires_s;
        if self.session_left {
            Some(CommandRefusal::Leaving)
        } else if mode_changes != self.mode_changes {
            Some(CommandRefusal::Stale)
        } else if given_ns < self.lowered_ns {
            Some(CommandRefusal::Lowered)
        } else if Some(given_ns) <= self.answered_permit_ns {
            Some(CommandRefusal::Answered)
        } else if age_s > allowed_s {
            Some(CommandRefusal::Expired { age_s, allowed_s })
        } else {
            None
        }
    }

    /// Whether the robot lies in an attitude, or with its legs in a pose, from which it cannot stand up.
    fn needs_placing(&self) -> bool {
        let folded = self.findings.get(ArmingCheck::LyingDown);
        let unfolded = folded.is_some_and(|finding| finding.measured > finding.allowed);
        self.tick.estimate.tilt_rad() > self.settings.failsafe.stance_tilt_rad || unfolded
    }

    /// Places a simulated robot at the origin, feet at the trial's stance. Returns false for a robot that only a person can place.
    fn place_for_trial<R: Robot + ?Sized>(&mut self, robot: &mut R, spec: &TrialSpec) -> bool {
        // The session has checked that the stance can be reached.
        let joint_position = self.settings.geometry.stance(&spec.stance_leg, &self.tick.state.joint_position_rad);
        self.place(robot, &Placement { joint_position, lying: false, seed: spec.seed })
    }

    fn place<R: Robot + ?Sized>(&mut self, robot: &mut R, placement: &Placement) -> bool {
        let placed = robot.place(placement);
        if placed {
            self.estimator.reset();
            self.consistency.reset();
            self.gate.reset();
            self.gains.reset();
            self.read(robot);
            self.estimate();
        }
        placed
    }
}
