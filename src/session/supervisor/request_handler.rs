//! Execution of the operator's requests.

use super::unfinished::{ApprovalState, Asker, JobPurpose};
use super::{OTHER_FILE, Supervisor, study_requests};
use crate::control::mode::{self, Trigger};
use crate::realtime::channel::Lowering;
use crate::robot::CONTACT_S;
use crate::session::arming_checklist::refusals;
use crate::session::operator_request::{OperatorRequest, StampedRequest};
use crate::session::storage::JobOutput;
use crate::telemetry::{Command, Mode, Permit, TransitionCause};

impl Supervisor {
    /// Carries out a request. Returns its answer, or the reason of the refusal; none if the study answers.
    pub fn execute(&mut self, stamped: &StampedRequest, asker: Asker, time_ns: u64) -> Option<Result<String, String>> {
        match &stamped.request {
            OperatorRequest::Arm
            | OperatorRequest::Confirm(_)
            | OperatorRequest::SitDown
            | OperatorRequest::Acknowledge
            | OperatorRequest::TakeControl
            | OperatorRequest::Cancel => Some(self.execute_on_robot(stamped, time_ns)),
            OperatorRequest::Approve { trial, revision } => {
                self.approve(stamped, (*trial, *revision), asker, time_ns).err().map(Err)
            }
            request => {
                let request = request.clone();
                self.give(JobPurpose::Request(stamped.clone(), asker), time_ns, move |experiment| {
                    study_requests::carry_out(experiment, &request, asker)
                });
                None
            }
        }
    }

    fn execute_on_robot(&mut self, stamped: &StampedRequest, time_ns: u64) -> Result<String, String> {
        match &stamped.request {
            OperatorRequest::Arm => {
                self.require_allowed(Trigger::Arm)?;
                self.fresh(stamped.time_ns, time_ns)?;
                let findings = self.control.readiness.read().findings;
                if let Some(refusals) = refusals(&self.checklist.items(&findings, &self.recorder.get())) {
                    return Err(refusals);
                }
                let permit = self.permit(stamped);
                self.ask(Trigger::Arm, Command::Arm(permit), "the robot stands up")
            }
            OperatorRequest::Confirm(check) if self.mode.energised() => {
                Err(format!("{} is to be confirmed before the robot is armed", check.check().name()))
            }
            OperatorRequest::Confirm(check) => {
                self.checklist.confirm(*check, stamped.time_ns);
                self.checklist_ns = 0;
                Ok("confirmed".to_owned())
            }
            OperatorRequest::SitDown => self.lower(Lowering::SitDown),
            OperatorRequest::Acknowledge => self.ask(
                Trigger::Acknowledge,
                Command::Acknowledge { stops: stamped.stops },
                if self.observe { "nothing is sent any more" } else { "disarmed; arm when ready" },
            ),
            OperatorRequest::Cancel => self.lower(Lowering::Cancel),
            OperatorRequest::TakeControl => match self.mode {
                Mode::Offline => {
                    self.command(Command::Contact)?;
                    self.control_wanted = Some(stamped.clone());
                    Ok(format!(
                        "until states arrive, for at most {CONTACT_S} s, a Go1 is sent braking commands, a Go2 nothing; then damping"
                    ))
                }
                Mode::Observe => {
                    self.control_wanted = Some(stamped.clone());
                    Ok("damping is sent from now on".to_owned())
                }
                mode => Err(format!("the robot is {}: this session commands it already", mode.name())),
            },
            _ => Err("this is no request to the robot".to_owned()),
        }
    }

    /// Answers a request for control that has not led to it within [`CONTACT_S`]: a robot that is switched on later is sent nothing.
    pub(super) fn expire_control_request(&mut self, time_ns: u64) {
        let expires_ns =
            |request: &StampedRequest| request.time_ns.saturating_add(u64::from(CONTACT_S) * 1_000_000_000);
        if let Some(request) = self.control_wanted.take_if(|request| time_ns >= expires_ns(request)) {
            let missing = if self.mode == Mode::Offline { "state of the robot" } else { "heartbeat of the console" };
            let answer = format!("no {missing} for {CONTACT_S} s: nothing is sent to the robot; ask for control again");
            self.respond(&request, Asker::Operator, Err(answer), time_ns);
        }
    }

    /// Gives an approval to the study; the trial runs once the study has stored it, if the approval still holds.
    fn approve(
        &mut self,
        stamped: &StampedRequest,
        (trial, revision): (u32, u32),
        asker: Asker,
        time_ns: u64,
    ) -> Result<(), String> {
        if mode::next(self.mode, Trigger::Approve).is_none() {
            return Err(format!("the robot is {}, not READY{}", self.mode.name(), way_to_ready(self.mode)));
        }
        if let Some(error) = &self.recorder_error {
            return Err(format!("nothing is recorded ({error}); a jump without a recording is not measured"));
        }
        if let Some(warning) = &self.recorder_warning {
            return Err(format!("{OTHER_FILE} ({warning}); end the session and continue the study in a new one"));
        }
        if let Some(inhibit) = self.inhibit() {
            return Err(inhibit);
        }
        if let Some(unready) = self.control.readiness.read().unready {
            return Err(unready.to_string());
        }
        let state = ApprovalState { permit: self.permit(stamped), stops: stamped.stops };
        self.approval_holds(&state, time_ns)?;
        self.give(JobPurpose::Approve(stamped.clone(), asker, state), time_ns, move |experiment| {
            JobOutput::Approved(experiment.approve(trial, revision).map_err(|refusal| refusal.to_string()))
        });
        Ok(())
    }

    /// Answers a request to sit down or to cancel. One that has reached the control thread by its latch is not commanded again.
    fn lower(&mut self, lowering: Lowering) -> Result<String, String> {
        let (trigger, command, reached, text) = match lowering {
            Lowering::SitDown => (Trigger::SitDown, Command::SitDown, Mode::SitDown, "the robot sits down"),
            Lowering::Cancel => (Trigger::Cancel, Command::Cancel, Mode::Ready, "the countdown is cancelled"),
        };
        // As in `Cycle::handle_command`.
        let in_a_row = lowering == Lowering::SitDown && self.in_a_row && matches!(self.mode, Mode::Jump | Mode::Settle);
        let text = if in_a_row { "no further jump; the robot lands, then sits down" } else { text };
        let answered = &mut self.lowerings_answered[lowering as usize];
        if self.control.lowering.count(lowering) == *answered {
            return if in_a_row {
                self.command(command).map(|()| text.to_owned())
            } else {
                self.ask(trigger, command, text)
            };
        }
        *answered += 1;
        if self.mode != reached && !in_a_row {
            self.require_allowed(trigger)?;
        }
        Ok(text.to_owned())
    }

    /// Sends `command` if the mode allows `request`.
    fn ask(&mut self, request: Trigger, command: Command, answer: &str) -> Result<String, String> {
        self.require_allowed(request)?;
        self.command(command)?;
        Ok(answer.to_owned())
    }

    fn require_allowed(&self, request: Trigger) -> Result<(), String> {
        match mode::next(self.mode, request) {
            Some(_) => Ok(()),
            None => Err(format!("not while the robot is {}", self.mode.name())),
        }
    }

    fn permit(&self, stamped: &StampedRequest) -> Permit {
        Permit { mode_changes: self.mode_changes, given_ns: stamped.time_ns }
    }

    /// Ends the review: a standing robot is ready again. A person acknowledges a fall like any other stop; the automatic rule
    /// does it with its verdict, and leaves a STOP after the fall set.
    pub(super) fn end_review(&mut self, asker: Asker) -> Result<(), String> {
        let fell = self.mode == Mode::Damped && matches!(self.cause, TransitionCause::Fell(_));
        match self.mode {
            Mode::Review => self.command(Command::EndReview),
            _ if fell && asker == Asker::Rule => self.command(Command::Acknowledge { stops: 0 }),
            _ => Ok(()),
        }
    }
}

/// Returns the steps from `mode` to READY.
fn way_to_ready(mode: Mode) -> &'static str {
    match mode {
        Mode::Disarmed => "; arm it first",
        Mode::Damped | Mode::Fault => "; acknowledge, then arm",
        Mode::Review => "; judge the last trial first",
        Mode::Offline => "; there is no robot",
        _ => "; wait until it is",
    }
}
