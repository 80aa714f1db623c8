//! The work of the session thread: requests of the operator in, commands to the control thread, its events and ticks back,
//! records to the console and the recording. Every request is answered: carried out, or refused with the reason.

mod automatic;
mod jobs;
mod request_handler;
mod standing;
mod study_requests;
mod unattended;
mod unfinished;

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender};

use super::arming_checklist::ArmingChecklist;
use super::experiment::{Experiment, RequestRefusal};
use super::operator_request::{OperatorRequest, StampedRequest};
use super::storage::{ExperimentQueue, JobOutput};
use crate::control::settings::{ApprovalLimits, ControlSettings};
use crate::realtime::channel::SessionPorts;
use crate::realtime::scheduling::{DeniedSetting, RealtimeSetting};
use crate::recording::record::{ArmingCheckRecord, LogLevel, LogRecord, Record, SessionInfo, Stamped, Transition};
use crate::recording::recorder::{CollectedTicks, RecorderStatus, RecorderWatch, TrialTicks};
use crate::telemetry::{Command, Event, Mode, TransitionCause, TrialEnd};
use crate::trial::{Approval, ExperimentStage};
use unattended::Unattended;
use unfinished::{Asker, JobPurpose, UnfinishedJob};

/// Period of the counters' records, ns.
const COUNTERS_PERIOD_NS: u64 = 100_000_000;

const RECORDER_GONE: &str = "the recorder's thread has ended";
const OTHER_FILE: &str = "a file of the recording could not be begun or completed";
const GUARD_LOST: &str =
    "the guard process has ended: nothing damps the robot if quadfrog is killed; sit down, quit and start again";
const GUARD_STARTS: &str = "the guard process starts: wait until it answers";
const GUARD_SILENT: &str = "the guard process does not answer: nothing damps the robot if quadfrog is killed; continue the process if it is stopped (`kill -CONT`), otherwise sit down, quit and start again";

/// Period of reading the changes of other programs to the study, ns.
const REFRESH_PERIOD_NS: u64 = 500_000_000;

/// Longest wait for a trial's ticks from the recorder, ns.
const LONGEST_WAIT_FOR_TICKS_NS: u64 = 10_000_000_000;

/// Longest time between the STOP of an observer and the end of the trial that it has stopped, ns.
const ONE_STOP_NS: u64 = 1_000_000_000;

/// Receivers of the records: the recorder and the console get the same.
#[expect(missing_docs, reason = "the types say the rest")]
pub struct RecordSinks {
    pub recorder: Sender<Stamped>,
    pub console: Sender<Stamped>,
}

impl RecordSinks {
    /// Sends a record to both. Returns false if the recorder's thread has ended. A console that is gone ends the session
    /// elsewhere.
    fn send(&self, stamped: Stamped) -> bool {
        let _ = self.console.send(stamped.clone());
        self.recorder.send(stamped).is_ok()
    }
}

/// Parts of a session.
#[expect(missing_docs, reason = "the types say the rest")]
pub struct SupervisorParts {
    pub experiment: Experiment,
    pub control: SessionPorts,
    /// The ticks of each trial and of each fault, from the recorder.
    pub ticks: Receiver<CollectedTicks>,
    pub sinks: RecordSinks,
    pub recorder: RecorderWatch,
    pub checklist: ArmingChecklist,
    pub approval: ApprovalLimits,
    /// The session's record for the console; the recording begins with it already.
    pub info: SessionInfo,
}

#[derive(Debug, Clone, Copy)]
struct Ended {
    trial: u32,
    end: TrialEnd,
    /// Number of its ticks.
    ticks: u64,
    /// Time of its event, ns.
    time_ns: u64,
}

/// The session.
pub struct Supervisor {
    experiment: ExperimentQueue,
    /// Jobs on the experiment whose results were not taken yet, oldest first.
    unfinished: VecDeque<UnfinishedJob>,
    /// Time at which the job was given whose wait was logged, ns.
    waited_since_ns: Option<u64>,
    storage_lost: bool,
    closing: bool,
    control: SessionPorts,
    ticks: Receiver<CollectedTicks>,
    sinks: RecordSinks,
    recorder: RecorderWatch,
    mode: Mode,
    cause: TransitionCause,
    /// Number of mode changes that were reported to the session.
    mode_changes: u64,
    /// An observer's STOP was acknowledged: the release of the robot was commanded.
    releasing: bool,
    leaving: bool,
    /// Reason that forbids the next trial, as it was logged last.
    inhibited: Option<String>,
    warned_ns: Option<u64>,
    ended: Option<Ended>,
    /// Number of STOPs that a change of mode or the log reports.
    stops_reported: u64,
    /// The observer who has set STOP last, in words, and when.
    observer_stop: Option<(String, u64)>,
    unmeasured: VecDeque<TrialTicks>,
    recorder_error: Option<String>,
    /// Error of another file of the recording than the present one.
    recorder_warning: Option<String>,
    recorder_gone: bool,
    /// Reason for which the guard does not protect the robot; none while it does.
    guard_objection: Option<&'static str>,
    observe: bool,
    control_requested: bool,
    /// The operator's request for control of a real robot; none once control is taken, and after its time.
    control_wanted: Option<StampedRequest>,
    /// Heartbeats of the console when control was refused last: it is requested again after the next.
    heartbeats: u64,
    counters_ns: u64,
    checklist: ArmingChecklist,
    approval: ApprovalLimits,
    /// Presses of sit down and cancel that were answered.
    lowerings_answered: [u64; 2],
    /// The checklist as it was published last, and its time.
    published_checklist: Vec<ArmingCheckRecord>,
    checklist_ns: u64,
    refreshed_ns: u64,
    unattended: Unattended,
    /// Settings of the control thread, which name the limit that ended a trial.
    limits: Option<ControlSettings>,
    /// Whether the robot sits down when a trial is over.
    review_sits_down: bool,
    /// Whether the newest trial has several jumps in a row.
    in_a_row: bool,
    /// The robot was sent to sit down for the review: no interruption of the automatic rule.
    sitting_for_review: bool,
}

impl Supervisor {
    /// Starts the session of an experiment.
    pub fn new(parts: SupervisorParts, time_ns: u64) -> Supervisor {
        let SupervisorParts { experiment, control, ticks, sinks, recorder, checklist, approval, info } = parts;
        let observe = info.observe;
        let mut experiment = experiment;
        let records = experiment.take_records();
        let mut supervisor = Supervisor {
            experiment: ExperimentQueue::here(experiment),
            unfinished: VecDeque::new(),
            waited_since_ns: None,
            storage_lost: false,
            closing: false,
            control,
            ticks,
            sinks,
            recorder,
            mode: Mode::Offline,
            cause: TransitionCause::StepFinished,
            mode_changes: 0,
            releasing: false,
            leaving: false,
            inhibited: None,
            warned_ns: None,
            ended: None,
            stops_reported: 0,
            observer_stop: None,
            unmeasured: VecDeque::new(),
            recorder_error: None,
            recorder_warning: None,
            recorder_gone: false,
            guard_objection: None,
            observe,
            control_requested: false,
            control_wanted: None,
            heartbeats: 0,
            counters_ns: 0,
            checklist,
            approval,
            in_a_row: false,
            lowerings_answered: [0; 2],
            published_checklist: Vec::new(),
            checklist_ns: 0,
            refreshed_ns: 0,
            unattended: Unattended::default(),
            limits: None,
            review_sits_down: false,
            sitting_for_review: false,
        };
        // Not to the recorder: its file begins with this record.
        let _ = supervisor.sinks.console.send(Stamped { time_ns, record: Record::Session(info) });
        for record in records {
            supervisor.publish(record, time_ns);
        }
        supervisor
    }

    /// Returns the session with a robot that sits down at the end of each trial, if `sits_down`: a person may then go to it.
    pub fn sitting_down_for_review(mut self, sits_down: bool) -> Supervisor {
        self.review_sits_down = sits_down;
        self
    }

    /// Records the real-time settings that the control thread was granted and denied: arming checks on hardware.
    pub fn report_scheduling(&mut self, granted: &[RealtimeSetting], denied: &[DeniedSetting], time_ns: u64) {
        self.checklist.scheduled(granted, denied);
        if !granted.is_empty() {
            let granted: Vec<_> = granted.iter().map(ToString::to_string).collect();
            self.log(LogLevel::Info, format!("control thread: {}", granted.join(", ")), time_ns);
        }
        for setting in denied {
            self.log(LogLevel::Warning, format!("control thread: {setting}"), time_ns);
        }
    }

    /// Records that the guard process has ended. Nothing that energises the robot is begun any more: without the guard
    /// nothing damps the robot if this process is killed.
    pub fn report_guard_lost(&mut self, time_ns: u64) {
        self.guard_objection = Some(GUARD_LOST);
        self.log(LogLevel::Error, GUARD_LOST.to_owned(), time_ns);
    }

    /// Begins nothing that energises the robot until the guard process answers.
    pub fn await_guard(&mut self) {
        self.guard_objection = Some(GUARD_STARTS);
    }

    /// Records whether the guard process answers. While it does not, nothing that energises the robot is begun.
    pub fn report_guard_silent(&mut self, silent: bool, time_ns: u64) {
        let before = std::mem::replace(&mut self.guard_objection, silent.then_some(GUARD_SILENT));
        if silent {
            self.log(LogLevel::Error, GUARD_SILENT.to_owned(), time_ns);
        } else if before == Some(GUARD_SILENT) {
            self.log(LogLevel::Info, "the guard process answers again".to_owned(), time_ns);
        }
    }

    /// Returns the mode that was reported to the session last.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Records the events and ticks since the last call; to be called every few milliseconds.
    pub fn poll(&mut self, time_ns: u64) {
        while let Ok(event) = self.control.events.pop() {
            self.event(event, time_ns);
        }
        self.report_stop(time_ns);
        let reboots = self.control.counters.read().link.map_or(0, |link| link.reboots);
        if self.checklist.robot_restarted(reboots) {
            let message = "the robot restarted: confirm low-level mode and the clear area again".to_owned();
            self.log(LogLevel::Warning, message, time_ns);
        }
        if !self.mode.energised()
            && let Some(message) = self.checklist.expire(time_ns)
        {
            self.log(LogLevel::Info, message, time_ns);
            self.checklist_ns = 0;
        }
        while let Ok(collected) = self.ticks.try_recv() {
            match collected {
                CollectedTicks::Trial(ticks) => self.unmeasured.push_back(ticks),
                CollectedTicks::Fault(ticks) => self.publish(Record::FaultTicks(ticks), time_ns),
            }
        }
        self.release();
        self.expire_control_request(time_ns);
        self.measure(time_ns);
        let RecorderStatus { error, warning, .. } = self.recorder.get();
        if warning != self.recorder_warning {
            if let Some(warning) = &warning {
                self.log(LogLevel::Error, format!("{OTHER_FILE} ({warning}); the present one goes on"), time_ns);
            }
            self.recorder_warning = warning;
        }
        let error = error.or_else(|| self.recorder_gone.then(|| RECORDER_GONE.to_owned()));
        if error != self.recorder_error {
            if let Some(error) = &error {
                self.log(LogLevel::Error, format!("the recording failed: {error}"), time_ns);
            }
            self.recorder_error = error;
        }
        if time_ns >= self.counters_ns + COUNTERS_PERIOD_NS {
            self.counters_ns = time_ns;
            let counters = *self.control.counters.read();
            self.publish(Record::Counters(counters), time_ns);
            self.publish_checklist(time_ns);
            self.warn(time_ns);
        }
        let idle = self.unfinished.is_empty() && !self.closing;
        if idle && time_ns >= self.refreshed_ns + REFRESH_PERIOD_NS {
            self.refreshed_ns = time_ns;
            self.give(JobPurpose::Refresh, time_ns, |experiment| JobOutput::Done(experiment.refresh()));
        }
        self.finish_jobs(time_ns);
        self.act_unattended(time_ns);
    }

    /// Carries out one request and publishes the answer; that of the study comes with a later [`Supervisor::poll`] if the
    /// experiment has a thread of its own.
    pub fn handle_request(&mut self, stamped: &StampedRequest, time_ns: u64) {
        let StampedRequest { request, stops, .. } = stamped;
        // The console may have shown a change of mode whose event is still in the ring.
        self.poll(time_ns);
        let energises = matches!(request, OperatorRequest::Arm | OperatorRequest::Approve { .. });
        // An observer may stop the robot and release it again.
        let answer = if self.observe && *request != OperatorRequest::Acknowledge {
            Some(Err("this session only observes".to_owned()))
        } else if energises && self.control.stop.count() != *stops {
            Some(Err("STOP was pressed after it".to_owned()))
        } else if energises && let Some(objection) = self.guard_objection {
            Some(Err(objection.to_owned()))
        } else {
            self.unattended.requested(request);
            self.execute(stamped, Asker::Operator, time_ns)
        };
        if let Some(answer) = answer {
            self.respond(stamped, Asker::Operator, answer, time_ns);
        }
        self.finish_jobs(time_ns);
    }

    /// Ends the session: the pending verdict is reported, and a trial under review that is void by the rules is void.
    /// Complete once [`Supervisor::is_closed`].
    pub fn close(&mut self, time_ns: u64) {
        self.closing = true;
        self.experiment.prior_work().interrupt();
        self.give(JobPurpose::Close, time_ns, |experiment| {
            let closed = experiment.close_unreviewed().and_then(|()| experiment.close());
            JobOutput::Done(closed.map_err(RequestRefusal::from))
        });
        self.finish_jobs(time_ns);
    }

    /// Whether the study has stored everything; to be asked after [`Supervisor::close`].
    pub fn is_closed(&self) -> bool {
        self.unfinished.is_empty()
    }

    /// Takes control of a robot that answers, once there is a console, unless this session only observes.
    pub fn take_control(&mut self) {
        if !self.observe && !self.control_requested && self.control.heartbeat.count() > self.heartbeats {
            self.control_requested = self.command(Command::TakeControl).is_ok();
        }
    }

    /// Takes control of a robot that sends states: of a real one, which another program may command, only while a request of the operator
    /// holds.
    pub fn take_wanted_control(&mut self, hardware: bool) {
        if self.mode == Mode::Observe && (!hardware || self.control_wanted.is_some()) {
            self.take_control();
        }
    }

    /// STOP by the session at its end: the last reported mode may be old, and a command that energises the robot may still be
    /// in the ring. A robot that was never taken control of receives nothing.
    pub fn stop(&mut self) {
        if !self.observe && self.mode.commanded() {
            self.control.stop.set();
            self.stops_reported += 1;
        }
    }

    /// Winds the session down: a standing robot sits down, a jumping one after its landing, and nothing new begins. Returns
    /// false once no trial is under way and, if `sits_down`, nothing is energised.
    pub fn end_session_step(&mut self, sits_down: bool) -> bool {
        if !self.leaving {
            self.unattended = Unattended::default();
            // A full ring is emptied at 1 kHz: the next call succeeds.
            self.leaving = self.command(Command::Leave).is_ok();
        }
        let trial = matches!(self.mode, Mode::Countdown | Mode::Jump | Mode::Settle);
        // Also a trial that has not begun yet, or whose ticks have not arrived yet.
        let running = self.experiment.view().stage == ExperimentStage::Running && !self.control.events.is_abandoned();
        trial || running || sits_down && self.mode.energised()
    }

    fn command(&mut self, command: Command) -> Result<(), String> {
        self.control.commands.push(command).map_err(|_| "the control thread does not take commands".to_owned())
    }

    fn event(&mut self, event: Event, time_ns: u64) {
        match event {
            Event::Mode { from, to, cause, time_ns } => {
                self.mode = to;
                self.cause = cause;
                self.mode_changes += 1;
                self.releasing = false;
                if to.commanded() {
                    self.control_wanted = None;
                }
                if cause == TransitionCause::Stop {
                    self.stops_reported = self.control.stop.count();
                }
                self.checklist.mode_changed(from, to, &cause);
                self.record_checklist();
                if !(self.sitting_for_review && to == Mode::SitDown) {
                    self.unattended.mode_changed(to, cause);
                }
                // A full ring leaves the robot standing in REVIEW, where it may stand.
                self.sitting_for_review =
                    to == Mode::Review && self.review_sits_down && self.command(Command::SitDown).is_ok();
                self.publish(Record::Transition(Transition { from, to, cause: cause.to_string() }), time_ns);
                if let TransitionCause::NotReady(inhibit) = cause {
                    self.log(LogLevel::Warning, format!("the countdown was cancelled: {inhibit}"), time_ns);
                }
            }
            Event::TrialEnded { trial, ticks, end } => {
                self.log_limit(trial, &end, time_ns);
                self.ended = Some(Ended { trial, end, ticks, time_ns });
            }
            Event::SetUpright => {
                let message = "the simulated robot was laid upright and folded; a real one needs a person";
                let level = if self.unattended.approval == Approval::Auto { LogLevel::Info } else { LogLevel::Warning };
                self.log(level, message.to_owned(), time_ns);
            }
            Event::Refused { command, mode, because } => {
                let message = format!("the control thread refused {command} while {}: {because}", mode.name());
                self.log(LogLevel::Warning, message, time_ns);
                match command {
                    Command::RunTrial(spec, _) => {
                        self.ended = Some(Ended { trial: spec.trial, end: because.into(), ticks: 0, time_ns });
                        self.unmeasured.push_back(TrialTicks { trial: spec.trial, ticks: Vec::new() });
                    }
                    Command::Arm(_) => self.unattended.arming_refused(time_ns),
                    Command::Contact => self.control_wanted = None,
                    Command::TakeControl => {
                        self.control_requested = false;
                        self.heartbeats = self.control.heartbeat.count();
                    }
                    _ => {}
                }
            }
        }
    }

    /// Measures a trial that has ended, once its ticks have arrived.
    fn measure(&mut self, time_ns: u64) {
        let Some(Ended { trial, end, ticks: whole, time_ns: ended_ns }) = self.ended else { return };
        let ticks = match self.unmeasured.iter().position(|ticks| ticks.trial == trial) {
            Some(place) => self.unmeasured.remove(place).map(|found| found.ticks).unwrap_or_default(),
            None if time_ns < ended_ns + LONGEST_WAIT_FOR_TICKS_NS => return,
            None => {
                self.log(LogLevel::Error, format!("the recorder did not send the ticks of trial {trial}"), time_ns);
                Vec::new()
            }
        };
        self.unmeasured.clear();
        self.ended = None;
        let stop = self.observer_stop.take().filter(|(_, set_ns)| set_ns.abs_diff(ended_ns) < ONE_STOP_NS);
        self.give(JobPurpose::Measure(trial), time_ns, move |experiment| {
            let observer = stop.as_ref().map(|(observer, _)| observer.as_str());
            experiment.ended_by(trial, &end, &ticks, whole, observer);
            JobOutput::Done(Ok(()))
        });
        // By itself: the screen shows the trial even while another program holds the journal.
        self.give(JobPurpose::KeepMeasurement(trial), time_ns, |experiment| {
            JobOutput::Done(experiment.keep_measurement().map_err(RequestRefusal::from))
        });
    }

    fn publish(&mut self, record: Record, time_ns: u64) {
        self.recorder_gone |= !self.sinks.send(Stamped { time_ns, record });
    }

    /// Notes that an observer has set STOP; `observer` names it in words.
    pub fn stopped_by(&mut self, observer: String, time_ns: u64) {
        self.observer_stop = Some((observer, time_ns));
    }

    /// Writes a message to the log.
    pub fn log(&mut self, level: LogLevel, message: String, time_ns: u64) {
        self.publish(Record::Log(LogRecord { level, source: "session".to_owned(), message }), time_ns);
    }
}
