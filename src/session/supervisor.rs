//! The session thread's work: an operator's intents in, commands to the control thread, events and measured ticks back,
//! records to the screen and the recording. Every intent is answered, carried out or refused and why.

mod unattended;

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender};

use super::arming_checklist::{ArmingChecklist, objections};
use super::experiment::{Experiment, RequestRefusal};
use super::operator_request::{OperatorRequest, StampedRequest};
use crate::control::mode::{self, Trigger};
use crate::realtime::channel::SessionEnd;
use crate::realtime::scheduling::{DeniedSetting, RealtimeSetting};
use crate::recording::record::{
    ArmingCheckRecord, LogLevel, LogRecord, Record, RequestRecord, SessionInfo, Stamped, Transition,
};
use crate::recording::recorder::{Handed, RecorderWatch, TrialTicks};
use crate::telemetry::{Command, Event, Mode, Permit, TransitionCause, TrialEnd};
use crate::trial::{ExperimentStage, Verdict};
use unattended::Unattended;

/// How often the counters are told to the screen and the recording, ns.
const COUNTERS_PERIOD_NS: u64 = 100_000_000;

/// Said of a recorder that broke down without a word.
const RECORDER_GONE: &str = "the recorder's thread has ended";
const GUARD_LOST: &str =
    "the guard process has ended: nothing damps the robot if quadfrog is killed; sit down, quit and start again";

/// Cautions are said no more often than this, ns.
const CAUTION_PERIOD_NS: u64 = 10_000_000_000;

/// How often the pre-arm list is shown again though no item changed its state, ns.
const PRE_ARM_PERIOD_NS: u64 = 500_000_000;
/// How often the study is looked at for what other programs have written, ns.
const LOOK_PERIOD_NS: u64 = 500_000_000;

/// How long the recorder may take to hand over a trial's ticks, ns.
const LONGEST_WAIT_FOR_TICKS_NS: u64 = 10_000_000_000;

/// Where the records go: the recorder and the screen receive the same.
pub struct RecordSinks {
    /// To the recorder.
    pub recorder: Sender<Stamped>,
    /// To the screen.
    pub screen: Sender<Stamped>,
}

impl RecordSinks {
    /// Whether the recorder took it. A screen that is gone takes nothing any more: the session ends with it, not because of it.
    fn put(&self, stamped: Stamped) -> bool {
        let _ = self.screen.send(stamped.clone());
        self.recorder.send(stamped).is_ok()
    }
}

/// What a session is made of.
pub struct SupervisorParts {
    /// The study's life.
    pub life: Experiment,
    /// To the control thread.
    pub control: SessionEnd,
    /// The ticks of each trial and of each fault, from the recorder.
    pub handed: Receiver<Handed>,
    /// Where the records go.
    pub outlets: RecordSinks,
    /// How the recorder is doing.
    pub recorder: RecorderWatch,
    /// What must hold before the robot is energised.
    pub pre_arm: ArmingChecklist,
    /// What this session is: its first record.
    pub info: SessionInfo,
}

/// A trial that is over.
#[derive(Debug, Clone, Copy)]
struct Ended {
    trial: u32,
    end: TrialEnd,
    /// How many ticks it has.
    ticks: u64,
    /// When it was heard of, ns: its ticks are not waited for for ever.
    time_ns: u64,
}

/// The session.
pub struct Supervisor {
    life: Experiment,
    control: SessionEnd,
    handed: Receiver<Handed>,
    outlets: RecordSinks,
    recorder: RecorderWatch,
    mode: Mode,
    cause: TransitionCause,
    /// How often the mode changed, as far as the session has heard.
    mode_changes: u64,
    /// An observer's robot was stopped and acknowledged: it is being let go of.
    letting_go: bool,
    /// The control thread knows that the session is over.
    leaving: bool,
    /// What forbade the next trial when that was said last.
    held: Option<String>,
    caution_ns: Option<u64>,
    /// The trial that ended, until its ticks have arrived too.
    ended: Option<Ended>,
    measured: VecDeque<TrialTicks>,
    recorder_complaint: Option<String>,
    /// The recorder's thread takes no records any more.
    recorder_gone: bool,
    guard_lost: bool,
    observe: bool,
    asked_for_control: bool,
    /// Signs of life of the screen when control was refused last: it is asked for again after the next.
    beats: u64,
    counters_ns: u64,
    pre_arm: ArmingChecklist,
    /// The list as it was shown last, and when.
    shown_list: Vec<ArmingCheckRecord>,
    shown_list_ns: u64,
    looked_ns: u64,
    unattended: Unattended,
}

impl Supervisor {
    /// A session over a study.
    pub fn new(parts: SupervisorParts, time_ns: u64) -> Supervisor {
        let SupervisorParts { life, control, handed, outlets, recorder, pre_arm, info } = parts;
        let observe = info.observe;
        let mut supervisor = Supervisor {
            life,
            control,
            handed,
            outlets,
            recorder,
            mode: Mode::Offline,
            cause: TransitionCause::Course,
            mode_changes: 0,
            letting_go: false,
            leaving: false,
            held: None,
            caution_ns: None,
            ended: None,
            measured: VecDeque::new(),
            recorder_complaint: None,
            recorder_gone: false,
            guard_lost: false,
            observe,
            asked_for_control: false,
            beats: 0,
            counters_ns: 0,
            pre_arm,
            shown_list: Vec::new(),
            shown_list_ns: 0,
            looked_ns: 0,
            unattended: Unattended::default(),
        };
        supervisor.say(Record::Session(info), time_ns);
        supervisor.publish(time_ns);
        supervisor
    }

    /// What the control thread got of what it asked of the system, and what it did not.
    pub fn tell_scheduling(&mut self, favours: &[RealtimeSetting], shortfalls: &[DeniedSetting], time_ns: u64) {
        if !favours.is_empty() {
            let granted: Vec<_> = favours.iter().map(ToString::to_string).collect();
            self.log(LogLevel::Info, format!("control thread: {}", granted.join(", ")), time_ns);
        }
        for shortfall in shortfalls {
            self.log(LogLevel::Warning, format!("control thread: {shortfall}"), time_ns);
        }
    }

    /// The guard process has ended: nobody damps the robot any more if this one does. Nothing new is begun with the robot.
    pub fn tell_guard_lost(&mut self, time_ns: u64) {
        self.guard_lost = true;
        self.log(LogLevel::Error, GUARD_LOST.to_owned(), time_ns);
    }

    /// The mode as far as the session has heard.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Takes in what happened since the last call; to be called every few milliseconds.
    pub fn attend(&mut self, time_ns: u64) {
        while let Ok(event) = self.control.events.pop() {
            self.event(event, time_ns);
        }
        let reboots = self.control.counters.read().link.map_or(0, |link| link.reboots);
        if self.pre_arm.robot_restarted(reboots) {
            let message = "the robot restarted: low-level mode and a clear area are to be confirmed again".to_owned();
            self.log(LogLevel::Warning, message, time_ns);
        }
        if !self.mode.energised()
            && let Some(message) = self.pre_arm.forget(time_ns)
        {
            self.log(LogLevel::Info, message, time_ns);
            self.shown_list_ns = 0;
        }
        while let Ok(handed) = self.handed.try_recv() {
            match handed {
                Handed::Trial(ticks) => self.measured.push_back(ticks),
                Handed::Fault(ticks) => self.say(Record::FaultTicks(ticks), time_ns),
            }
        }
        self.let_go();
        self.measure(time_ns);
        let complaint = self.recorder.get().error.or_else(|| self.recorder_gone.then(|| RECORDER_GONE.to_owned()));
        if complaint != self.recorder_complaint {
            if let Some(complaint) = &complaint {
                self.log(LogLevel::Error, format!("the recording failed: {complaint}"), time_ns);
            }
            self.recorder_complaint = complaint;
        }
        if time_ns >= self.counters_ns + COUNTERS_PERIOD_NS {
            self.counters_ns = time_ns;
            let counters = *self.control.counters.read();
            self.say(Record::Counters(counters), time_ns);
            self.show_pre_arm(time_ns);
            self.warn(time_ns);
        }
        if time_ns >= self.looked_ns + LOOK_PERIOD_NS {
            self.looked_ns = time_ns;
            if let Err(error) = self.life.look() {
                self.log(LogLevel::Error, format!("the study could not be read: {error}"), time_ns);
            }
        }
        self.publish(time_ns);
        self.act_by_itself(time_ns);
    }

    /// Carries out one wish, or says why not.
    pub fn carry_out(&mut self, wish: &StampedRequest, time_ns: u64) {
        let StampedRequest { intent, stops, .. } = wish;
        // The screen may have seen a change of mode that is still on its way here.
        self.attend(time_ns);
        let energises = matches!(intent, OperatorRequest::Arm | OperatorRequest::Approve { .. });
        // Who only looks may stop the robot, as everybody may, and then let go of it again.
        let answer = if self.observe && *intent != OperatorRequest::Acknowledge {
            Err("this session only observes".to_owned())
        } else if energises && self.control.stop.count() != *stops {
            Err("STOP was pressed after it".to_owned())
        } else if energises && self.guard_lost {
            Err(GUARD_LOST.to_owned())
        } else {
            self.noticed(intent);
            self.obey(wish)
        };
        let (accepted, answer) = match answer {
            Ok(answer) => (true, answer),
            Err(reason) => (false, reason),
        };
        self.say(Record::Request(RequestRecord { wish: describe(intent), accepted, answer }), time_ns);
        self.publish(time_ns);
    }

    /// The session ends: what was judged is told, and what nobody can judge any more is void if the rules call it so.
    pub fn close(&mut self, time_ns: u64) {
        if let Err(error) = self.life.leave().and_then(|()| self.life.close()) {
            self.log(LogLevel::Error, format!("the study could not be written: {error}"), time_ns);
        }
        self.publish(time_ns);
    }

    /// A robot that answers is taken control of once there is a screen, unless this session only looks.
    pub fn take_control(&mut self) {
        if !self.observe && !self.asked_for_control && self.control.heartbeat.count() > self.beats {
            self.asked_for_control = self.command(Command::TakeControl).is_ok();
        }
    }

    /// STOP, by the session itself, as its last word: what was heard of the mode may be old, and a command that energises
    /// still on its way. A robot that was never taken control of is not spoken to now either.
    pub fn stop(&self) {
        if !self.observe && self.mode.commanded() {
            self.control.stop.set();
        }
    }

    /// Nobody is there any more: a robot that stands sits down, one that jumps as soon as it has landed, and nothing is
    /// begun any more. False once no trial is under way and, if `sits_down`, nothing is energised.
    pub fn say_goodbye(&mut self, sits_down: bool) -> bool {
        if !self.leaving {
            self.unattended = Unattended::default();
            // A full ring is emptied a thousand times a second: the next call will get through.
            self.leaving = self.command(Command::Leave).is_ok();
        }
        let trial = matches!(self.mode, Mode::Countdown | Mode::Jump | Mode::Settle);
        // Also a trial of which nothing but its approval was heard, or whose ticks are still on their way here.
        let running = self.life.stage() == ExperimentStage::Running && !self.control.events.is_abandoned();
        trial || running || sits_down && self.mode.energised()
    }

    fn command(&mut self, command: Command) -> Result<(), String> {
        self.control.commands.push(command).map_err(|_| "the control thread does not take commands".to_owned())
    }

    fn obey(&mut self, wish: &StampedRequest) -> Result<String, String> {
        let words = |refusal: RequestRefusal| refusal.to_string();
        match &wish.intent {
            OperatorRequest::Arm if mode::next(self.mode, Trigger::Arm).is_some() => {
                let findings = self.control.readiness.read().findings;
                match objections(&self.pre_arm.look(&findings, &self.recorder.get())) {
                    Some(objections) => Err(objections),
                    None => {
                        let permit = Permit { mode_changes: self.mode_changes, given_ns: wish.time_ns };
                        self.ask(Trigger::Arm, Command::Arm(permit), "the robot stands up")
                    }
                }
            }
            OperatorRequest::Arm => Err(format!("not while the robot is {}", self.mode.name())),
            OperatorRequest::Confirm(check) if self.mode.energised() => {
                Err(format!("{} is asked before the robot is armed", check.check().name()))
            }
            OperatorRequest::Confirm(check) => {
                self.pre_arm.confirm(*check, wish.time_ns);
                self.shown_list_ns = 0;
                Ok("confirmed".to_owned())
            }
            OperatorRequest::SitDown => self.ask(Trigger::SitDown, Command::SitDown, "the robot sits down"),
            OperatorRequest::Acknowledge => self.ask(
                Trigger::Acknowledge,
                Command::Acknowledge { stops: wish.stops },
                "acknowledged; arm when ready",
            ),
            OperatorRequest::Cancel => self.ask(Trigger::Cancel, Command::Cancel, "the countdown is cancelled"),
            OperatorRequest::Approve { trial, revision } => {
                if self.mode != Mode::Ready {
                    return Err(format!("the robot is {}, not READY{}", self.mode.name(), way_to_ready(self.mode)));
                }
                if let Some(complaint) = &self.recorder_complaint {
                    return Err(format!(
                        "nothing is recorded ({complaint}); a jump without a recording is not measured"
                    ));
                }
                if let Some(hold) = self.hold() {
                    return Err(hold);
                }
                let spec = self.life.approve(*trial, *revision).map_err(words)?;
                let permit = Permit { mode_changes: self.mode_changes, given_ns: wish.time_ns };
                if let Err(reason) = self.command(Command::RunTrial(spec, permit)) {
                    self.life.ended(spec.trial, &TrialEnd::Cancelled, &[], 0);
                    return Err(reason);
                }
                Ok(format!("trial {} runs", spec.trial))
            }
            OperatorRequest::Skip => self.life.skip().map_err(words).map(|()| "skipped; here is another".to_owned()),
            OperatorRequest::Override { parameter, value } => {
                self.life.set_parameter(parameter, *value).map_err(words)?;
                Ok(format!("{parameter} will be {value}"))
            }
            OperatorRequest::ClearOverrides => {
                self.life.clear_overrides().map_err(words).map(|()| "as it was proposed".to_owned())
            }
            OperatorRequest::OverrideGain { gain, value } => {
                self.life.set_gain(gain, *value).map_err(words)?;
                Ok(format!("{gain} will be {value} in this trial"))
            }
            OperatorRequest::Fix { parameter, value, trials } => {
                self.life.fix(parameter, *value, *trials).map_err(words)?;
                Ok(format!("{parameter} is {value} for the next {trials} trials that count"))
            }
            OperatorRequest::Unfix { parameter } => {
                self.life.unfix(parameter).map_err(words)?;
                Ok(format!("{parameter} is searched again"))
            }
            OperatorRequest::NarrowBounds { parameter, low, high } => {
                self.life.narrow_bounds(parameter, *low, *high).map_err(words)?;
                Ok(format!("{parameter} is searched from {low} to {high}"))
            }
            OperatorRequest::ConfirmBest { repeats } => {
                let trials = self.life.confirm_best(*repeats).map_err(words)?;
                let trials: Vec<String> = trials.iter().map(u32::to_string).collect();
                Ok(match trials.len() {
                    0 => "no more repeats".to_owned(),
                    _ => format!("the points of trials {} are repeated, at most {repeats} times", trials.join(", ")),
                })
            }
            OperatorRequest::Judge(verdict) => {
                self.judge(*verdict, false)?;
                Ok("u takes it back until the next jump is approved".to_owned())
            }
            OperatorRequest::Rerun { trial: None } => {
                self.judge(Verdict::Void, true)?;
                Ok("void, and its parameters are on the table again".to_owned())
            }
            OperatorRequest::Rerun { trial: Some(trial) } => {
                self.life.repeat(*trial).map_err(words)?;
                Ok(format!("the parameters of trial {trial} are queued"))
            }
            OperatorRequest::Undo => self.life.undo().map_err(words).map(|()| "the verdict is taken back".to_owned()),
            OperatorRequest::HandValue(value) => {
                self.life.set_hand_value(*value).map_err(words)?;
                Ok(match value {
                    Some(value) => format!("{value} counts instead of the measured value"),
                    None => "the measured value counts".to_owned(),
                })
            }
            OperatorRequest::Note { trial, text } => {
                self.life.note(*trial, text).map_err(words)?;
                Ok("noted".to_owned())
            }
            OperatorRequest::Enqueue(parameters) => {
                self.life.enqueue(parameters).map_err(words)?;
                Ok("queued".to_owned())
            }
            OperatorRequest::Continue(trials) => {
                self.life.extend(*trials).map_err(words)?;
                Ok(format!("the study now has {} trials", self.life.budget()))
            }
        }
    }

    /// Sends `command` if the mode allows `request`.
    fn ask(&mut self, request: Trigger, command: Command, answer: &str) -> Result<String, String> {
        if mode::next(self.mode, request).is_none() {
            return Err(format!("not while the robot is {}", self.mode.name()));
        }
        self.command(command)?;
        Ok(answer.to_owned())
    }

    /// Judges the trial under review. Where another program has ended it, the review is over as well.
    fn judge(&mut self, verdict: Verdict, rerun: bool) -> Result<(), String> {
        let judged = self.life.judge(verdict, rerun);
        if matches!(judged, Ok(()) | Err(RequestRefusal::EndedElsewhere(_))) {
            self.end_review()?;
        }
        judged.map_err(|refusal| refusal.to_string())
    }

    /// The verdict is given: a standing robot is ready again, a fallen one is disarmed and must be armed anew.
    fn end_review(&mut self) -> Result<(), String> {
        let fallen = self.mode == Mode::Damped && matches!(self.cause, TransitionCause::Fell(_));
        if self.mode == Mode::Review || fallen { self.command(Command::EndReview) } else { Ok(()) }
    }

    fn event(&mut self, event: Event, time_ns: u64) {
        match event {
            Event::Mode { from, to, cause, time_ns } => {
                self.mode = to;
                self.cause = cause;
                self.mode_changes += 1;
                self.letting_go = false;
                self.pre_arm.mode_changed(from, to, &cause);
                self.shown_list.clear();
                self.unattended.mode_changed(to, cause);
                self.say(Record::Transition(Transition { from, to, cause: cause.to_string() }), time_ns);
            }
            Event::TrialEnded { trial, ticks, end } => {
                self.ended = Some(Ended { trial, end, ticks, time_ns });
            }
            Event::Refused { command, mode, because } => {
                let command_name = describe_command(&command);
                let message = format!("the control thread refused {command_name} while {}: {because}", mode.name());
                self.log(LogLevel::Warning, message, time_ns);
                match command {
                    Command::RunTrial(spec, _) => {
                        self.ended = Some(Ended { trial: spec.trial, end: TrialEnd::Cancelled, ticks: 0, time_ns });
                        self.measured.push_back(TrialTicks { trial: spec.trial, ticks: Vec::new() });
                    }
                    Command::Arm(_) => self.unattended.arming_refused(time_ns),
                    Command::TakeControl => {
                        self.asked_for_control = false;
                        self.beats = self.control.heartbeat.count();
                    }
                    _ => {}
                }
            }
        }
    }

    /// Once a trial has ended and its ticks are here, it is measured.
    fn measure(&mut self, time_ns: u64) {
        let Some(Ended { trial, end, ticks: whole, time_ns: ended_ns }) = self.ended else { return };
        let ticks = match self.measured.iter().position(|ticks| ticks.trial == trial) {
            Some(place) => self.measured.remove(place).map(|found| found.ticks).unwrap_or_default(),
            None if time_ns < ended_ns + LONGEST_WAIT_FOR_TICKS_NS => return,
            None => {
                self.log(LogLevel::Error, format!("the ticks of trial {trial} never came from the recorder"), time_ns);
                Vec::new()
            }
        };
        self.measured.clear();
        self.ended = None;
        self.life.ended(trial, &end, &ticks, whole);
        if self.life.stage() == ExperimentStage::Review && matches!(self.mode, Mode::Damped | Mode::Fault) {
            let message = format!("trial {trial} ended in {}: {}", self.mode.name(), self.cause);
            self.log(LogLevel::Warning, message, time_ns);
        }
    }

    /// What forbids the next trial, in words; none if nothing does.
    fn hold(&mut self) -> Option<String> {
        let hold = self.control.readiness.read().hold.map(|hold| hold.to_string());
        hold.or_else(|| self.pre_arm.disk_low())
    }

    /// What stands out, said once: what forbids the next trial, and what a watchdog will soon act on.
    fn warn(&mut self, time_ns: u64) {
        let hold = self.hold();
        if let Some(reason) = &hold
            && self.held.is_none()
        {
            self.log(LogLevel::Warning, format!("no further trial can be approved: {reason}"), time_ns);
        }
        self.held = hold;
        let due = self.caution_ns.is_none_or(|said_ns| time_ns >= said_ns + CAUTION_PERIOD_NS);
        if let Some(caution) = self.control.readiness.read().caution.filter(|_| due) {
            self.caution_ns = Some(time_ns);
            self.log(LogLevel::Warning, caution.to_string(), time_ns);
        }
    }

    /// An observer's STOP was acknowledged: the robot is whose it was.
    fn let_go(&mut self) {
        if self.observe && self.mode == Mode::Disarmed && !self.letting_go {
            self.letting_go = self.command(Command::Release).is_ok();
        }
    }

    /// The pre-arm list, while the robot is disarmed: to the screen twice a second, to both when an item changes its state.
    fn show_pre_arm(&mut self, time_ns: u64) {
        if self.mode != Mode::Disarmed || self.observe {
            return;
        }
        let findings = self.control.readiness.read().findings;
        let list = self.pre_arm.look(&findings, &self.recorder.get());
        let states = |list: &[ArmingCheckRecord]| list.iter().map(|item| item.state).collect::<Vec<_>>();
        let stamped = Stamped { time_ns, record: Record::ArmingChecks(list.clone()) };
        if states(&list) != states(&self.shown_list) {
            self.recorder_gone |= !self.outlets.put(stamped);
        } else if time_ns >= self.shown_list_ns + PRE_ARM_PERIOD_NS {
            let _ = self.outlets.screen.send(stamped);
        } else {
            return;
        }
        self.shown_list_ns = time_ns;
        self.shown_list = list;
    }

    /// What the study's life has to say.
    fn publish(&mut self, time_ns: u64) {
        for record in self.life.take_records() {
            self.recorder_gone |= !self.outlets.put(Stamped { time_ns, record });
        }
    }

    fn say(&mut self, record: Record, time_ns: u64) {
        self.recorder_gone |= !self.outlets.put(Stamped { time_ns, record });
    }

    fn log(&mut self, level: LogLevel, message: String, time_ns: u64) {
        self.say(Record::Log(LogRecord { level, source: "session".to_owned(), message }), time_ns);
    }
}

/// What leads to READY from here, in words.
fn way_to_ready(mode: Mode) -> &'static str {
    match mode {
        Mode::Disarmed => "; arm it first",
        Mode::Damped | Mode::Fault => "; acknowledge, then arm",
        Mode::Review => "; judge the last trial first",
        Mode::Offline => "; there is no robot",
        _ => "; wait until it is",
    }
}

fn describe(intent: &OperatorRequest) -> String {
    match intent {
        OperatorRequest::Arm => "arm".to_owned(),
        OperatorRequest::Confirm(check) => format!("confirm {}", check.check().name()),
        OperatorRequest::SitDown => "sit down".to_owned(),
        OperatorRequest::Acknowledge => "acknowledge".to_owned(),
        OperatorRequest::Approve { trial, .. } => format!("approve trial {trial}"),
        OperatorRequest::Cancel => "cancel the countdown".to_owned(),
        OperatorRequest::Skip => "skip the proposal".to_owned(),
        OperatorRequest::Override { parameter, value } => format!("override {parameter} = {value}"),
        OperatorRequest::OverrideGain { gain, value } => format!("set the gain {gain} = {value}"),
        OperatorRequest::ClearOverrides => "clear the overrides".to_owned(),
        OperatorRequest::Fix { parameter, value, trials } => format!("fix {parameter} = {value} for {trials} trials"),
        OperatorRequest::Unfix { parameter } => format!("search {parameter} again"),
        OperatorRequest::NarrowBounds { parameter, low, high } => format!("search {parameter} from {low} to {high}"),
        OperatorRequest::ConfirmBest { repeats: 0 } => "end the repeats".to_owned(),
        OperatorRequest::ConfirmBest { repeats } => format!("confirm the best with {repeats} repeats"),
        OperatorRequest::Judge(verdict) => verdict.name().to_owned(),
        OperatorRequest::Rerun { trial: None } => "re-run".to_owned(),
        OperatorRequest::Rerun { trial: Some(trial) } => format!("re-run trial {trial}"),
        OperatorRequest::Undo => "undo the verdict".to_owned(),
        OperatorRequest::HandValue(Some(value)) => format!("value measured by hand {value}"),
        OperatorRequest::HandValue(None) => "no value measured by hand".to_owned(),
        OperatorRequest::Note { trial, text } => format!("note on trial {trial}: {text}"),
        OperatorRequest::Enqueue(point) => {
            let words: Vec<_> = point.iter().map(|(name, value)| format!("{name} = {value}")).collect();
            format!("queue {}", words.join(", "))
        }
        OperatorRequest::Continue(trials) => format!("continue for {trials} trials"),
    }
}

fn describe_command(command: &Command) -> String {
    match command {
        Command::TakeControl => "to be controlled".to_owned(),
        Command::Release => "to be let go of".to_owned(),
        Command::Arm(_) => "to stand up".to_owned(),
        Command::Leave => "to be left".to_owned(),
        Command::SitDown => "to sit down".to_owned(),
        Command::RunTrial(spec, _) => format!("trial {}", spec.trial),
        Command::Cancel => "to cancel".to_owned(),
        Command::EndReview => "to end the review".to_owned(),
        Command::Acknowledge { .. } => "the acknowledgement".to_owned(),
    }
}
