//! Answers to the operator's requests.

use super::Supervisor;
use crate::control::mode::{self, Trigger};
use crate::session::arming_checklist::refusals;
use crate::session::experiment::RequestRefusal;
use crate::session::operator_request::{OperatorRequest, StampedRequest};
use crate::telemetry::{Command, Mode, Permit, TransitionCause, TrialEnd};
use crate::trial::Verdict;

impl Supervisor {
    /// Carries out a request. Returns its answer, or the reason of the refusal.
    pub fn answer(&mut self, stamped: &StampedRequest) -> Result<String, String> {
        let reason = |refusal: RequestRefusal| refusal.to_string();
        match &stamped.request {
            OperatorRequest::Arm => {
                self.require_allowed(Trigger::Arm)?;
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
            OperatorRequest::SitDown => self.ask(Trigger::SitDown, Command::SitDown, "the robot sits down"),
            OperatorRequest::Acknowledge => self.ask(
                Trigger::Acknowledge,
                Command::Acknowledge { stops: stamped.stops },
                "acknowledged; arm when ready",
            ),
            OperatorRequest::Cancel => self.ask(Trigger::Cancel, Command::Cancel, "the countdown is cancelled"),
            OperatorRequest::Approve { trial, revision } => {
                if mode::next(self.mode, Trigger::Approve).is_none() {
                    return Err(format!("the robot is {}, not READY{}", self.mode.name(), way_to_ready(self.mode)));
                }
                if let Some(error) = &self.recorder_error {
                    return Err(format!("nothing is recorded ({error}); a jump without a recording is not measured"));
                }
                if let Some(inhibit) = self.inhibit() {
                    return Err(inhibit);
                }
                if let Some(unready) = self.control.readiness.read().unready {
                    return Err(unready.to_string());
                }
                let spec = self.experiment.approve(*trial, *revision).map_err(reason)?;
                let permit = self.permit(stamped);
                if let Err(reason) = self.command(Command::RunTrial(spec, permit)) {
                    self.experiment.ended(spec.trial, &TrialEnd::Cancelled, &[], 0);
                    return Err(reason);
                }
                Ok(format!("trial {} runs", spec.trial))
            }
            OperatorRequest::Skip => {
                self.experiment.skip().map_err(reason).map(|()| "skipped; a new proposal follows".to_owned())
            }
            OperatorRequest::Override { parameter, value } => {
                self.experiment.set_parameter(parameter, *value).map_err(reason)?;
                Ok(format!("{parameter} will be {value}"))
            }
            OperatorRequest::ClearOverrides => {
                self.experiment.clear_overrides().map_err(reason).map(|()| "as it was proposed".to_owned())
            }
            OperatorRequest::OverrideGain { gain, value } => {
                self.experiment.set_gain(gain, *value).map_err(reason)?;
                Ok(format!("{gain} will be {value} in this trial"))
            }
            OperatorRequest::Fix { parameter, value, trials } => {
                self.experiment.fix(parameter, *value, *trials).map_err(reason)?;
                Ok(format!("{parameter} is {value} for the next {trials} trials that count"))
            }
            OperatorRequest::Unfix { parameter } => {
                self.experiment.unfix(parameter).map_err(reason)?;
                Ok(format!("{parameter} is searched again"))
            }
            OperatorRequest::NarrowBounds { parameter, low, high } => {
                self.experiment.narrow_bounds(parameter, *low, *high).map_err(reason)?;
                Ok(format!("{parameter} is searched from {low} to {high}"))
            }
            OperatorRequest::ConfirmBest { repeats } => {
                let trials = self.experiment.confirm_best(*repeats).map_err(reason)?;
                let trials: Vec<String> = trials.iter().map(u32::to_string).collect();
                Ok(match trials.len() {
                    0 => "no more repeats".to_owned(),
                    _ => format!("the points of trials {} are repeated, at most {repeats} times", trials.join(", ")),
                })
            }
            OperatorRequest::Judge(verdict) => {
                self.judge(*verdict, false)?;
                Ok("u takes it back until the next trial is approved or skipped".to_owned())
            }
            OperatorRequest::Rerun { trial: None } => {
                self.judge(Verdict::Void, true)?;
                Ok("void, and its parameters are proposed again".to_owned())
            }
            OperatorRequest::Rerun { trial: Some(trial) } => {
                self.experiment.repeat(*trial).map_err(reason)?;
                Ok(format!("the parameters of trial {trial} are queued"))
            }
            OperatorRequest::Undo => {
                self.experiment.undo().map_err(reason).map(|()| "the verdict is taken back".to_owned())
            }
            OperatorRequest::HandValue(value) => {
                self.experiment.set_hand_value(*value).map_err(reason)?;
                Ok(match value {
                    Some(value) => format!("{value} counts instead of the measured value"),
                    None => "the measured value counts".to_owned(),
                })
            }
            OperatorRequest::Note { trial, text } => {
                self.experiment.note(*trial, text).map_err(reason)?;
                Ok("noted".to_owned())
            }
            OperatorRequest::Enqueue(parameters) => {
                self.experiment.enqueue(parameters).map_err(reason)?;
                Ok("queued".to_owned())
            }
            OperatorRequest::Continue(trials) => {
                self.experiment.extend(*trials).map_err(reason)?;
                Ok(format!("the study now has {} trials", self.experiment.budget()))
            }
        }
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

    /// Judges the trial under review. If another program has ended it, the review is over as well.
    fn judge(&mut self, verdict: Verdict, rerun: bool) -> Result<(), String> {
        let judged = self.experiment.judge(verdict, rerun);
        if matches!(judged, Ok(()) | Err(RequestRefusal::EndedElsewhere(_))) {
            self.end_review()?;
        }
        judged.map_err(|refusal| refusal.to_string())
    }

    /// Ends the review: a standing robot is ready again, a fallen one is disarmed.
    fn end_review(&mut self) -> Result<(), String> {
        let fallen = self.mode == Mode::Damped && matches!(self.cause, TransitionCause::Fell(_));
        if self.mode == Mode::Review || fallen { self.command(Command::EndReview) } else { Ok(()) }
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
