//! Starts the threads of a session from a checked configuration and gives a console its [`EngineHandle`].

pub mod control_thread;
mod folder;
mod ground;
mod guard;
mod observers;
mod options;
mod prior;
mod recording;
mod rejudging;
mod session_thread;
mod stored;
mod study;
mod threads;
mod verify;

pub use folder::{
    STUDY_FILE, attachments, check_kept_config, fingerprint, kept_robot, newest_config, prepare_folder,
    running_session, study_files, utc_ns,
};
pub use ground::TrialGround;
pub use guard::{GUARD, Guard, GuardError, GuardHeartbeat, GuardOrders, GuardOutcome, run_guard, run_guard_with};
pub use observers::{
    FoundSessions, Observer, ObserverServer, ObserverStatus, RunningSession, SessionFacts, SessionNews, WHO_WATCHES,
    find_sessions, is_stop_of_observer,
};
pub use options::{EngineError, Options, Provenance};
pub use prior::{PRIOR_FILE, PriorFileError, PriorMaker, ReadyPrior, prior_plan};
pub use recording::create_recording;
pub use rejudging::{EstimateChange, RejudgeError, RejudgedTrial, Rejudging, changes_in_words, config_for_recorded};
pub use stored::{Opened, StoredStudy, has_journal, named_studies, open_stored, stored_studies, stored_study};
pub use study::{check_backend, check_budget, open_experiment, open_study, session_info, study_name};
pub use threads::{EngineThreads, ScheduledSettings};
pub use verify::{RecordedRun, TickDifference, Verification, VerifyError, attached_config, attached_robot, verify};

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use self::folder::LockedFolder;
use self::recording::show_unrecorded;
use self::study::open_without_prior;
use crate::control::settings::ControlSettings;
use crate::optimize::ask::SamplerKind;
use crate::optimize::journal::Durability;
use crate::printable::shell_word;
use crate::realtime::channel::{ConsolePorts, Heartbeat, Lowering, StopLatch, channels};
use crate::realtime::clock::{Clock, MonotonicClock};
use crate::realtime::scheduling::set_priority;
use crate::realtime::sleep_lock::{ALLOW_INHIBITOR, INHIBITOR, SleepLock};
use crate::realtime::system::descriptors;
use crate::recording::disk::FreeSpace;
use crate::recording::live::{LiveServer, LiveStatus};
use crate::recording::record::{LogLevel, Record, Stamped};
use crate::recording::recorder::{Recorder, RecorderHandle, RecorderStatus, RecorderWatch};
use crate::recording::session_files::unfinished_in;
use crate::robot::hardware::{Network, OpenedRobot};
use crate::robot::{Placement, Robot};
use crate::session::arming_checklist::ArmingChecklist;
use crate::session::operator_request::{OperatorRequest, StampedRequest};
use crate::session::parallel::cores;
use crate::session::storage::{StorageWait, StorageWatch};
use crate::session::supervisor::{RecordSinks, Supervisor, SupervisorParts};
use crate::sim::Simulator;
use crate::telemetry::{Snapshot, Tick};
use crate::trial::{Approval, Backend};

/// File descriptors of a session: some twenty for files, sockets, the terminal and the guard, and those of the robot's network.
const NEEDED_DESCRIPTORS: u64 = 32;

/// Distance of the priority of a robot's own threads to that of the control thread.
const BELOW_CONTROL: u8 = 10;

/// Starts the control, recorder and session threads.
///
/// # Errors
/// When the configuration, the study, the recording or the system does not allow it; no thread runs then.
pub fn start(options: Options) -> Result<EngineHandle, EngineError> {
    let hardware = options.backend == Backend::Hardware;
    if options.approve == Approval::Auto && hardware {
        return Err(EngineError::Unattended);
    }
    // Before a word goes to the robot.
    check_backend(&options)?;
    let settings = options.config.settings(&options.robot, options.task, options.backend)?;
    let of_network = options.network.as_ref().filter(|_| hardware).map_or(0, Network::descriptors);
    require_descriptors(NEEDED_DESCRIPTORS + of_network)?;
    let maker = match options.config.optimize.sampler.kind {
        SamplerKind::Sim if options.prior.is_none() => {
            Some(PriorMaker::new(&options.config, &options.robot, options.task, options.backend)?)
        }
        _ => None,
    };
    let (mut robot, guard) = open_robot_and_guard(&options, &settings)?;
    // A simulated robot begins like a real one: lying folded on its belly.
    robot.place(&Placement { joint_position: settings.lying_position, lying: true, seed: u64::from(options.seed) });
    let folder = prepare_folder(&options)?;
    // Of earlier sessions: that of this one does not exist yet.
    let unfinished = options.folder.as_deref().map(unfinished_in).unwrap_or_default();
    let recording = folder.recording.clone();
    let recording_name =
        recording.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned());
    let experiment = open_without_prior(&options, Durability::Synced, recording_name.as_deref().unwrap_or_default())?;
    let info = session_info(&options, &recording.as_ref().map(|p| p.display().to_string()).unwrap_or_default());
    let (guard, guard_heartbeat) = guard.unzip();
    let clock = MonotonicClock::start();
    let writer = match &recording {
        Some(path) => Some(create_recording(path, &options)?),
        None if options.live.is_some() => Some(show_unrecorded(&options)?),
        None => None,
    };

    let (control_end, session_end, console_end, tick_end) = channels();
    let (to_recorder, recorder_records) = channel();
    let (to_console, console_records) = channel();
    let (to_session, ticks) = channel();
    let recorder = Recorder::spawn(tick_end, recorder_records, writer, to_session)
        .map_err(EngineError::not_started("recorder's thread"))?;
    let status = recorder.watch();
    // After an error below the threads end: what they wait for is declared after them, and dropped before.
    let mut threads = EngineThreads::of(recorder);
    let sinks = RecordSinks { recorder: to_recorder, console: to_console };
    let scheduled = threads.spawn_control((robot, guard_heartbeat), control_end, &options, &settings, clock)?;

    let recorded_in = recording.as_ref().and(options.folder.clone());
    let space =
        recorded_in.map(FreeSpace::watch).transpose().map_err(EngineError::not_started("thread for the disk"))?;
    let checklist = ArmingChecklist::new(&settings, fingerprint(&options.config, &options.robot), space)
        .with_unseen_connection(options.unseen_connection.clone())
        .with_low_level(options.network.as_ref().map_or("none in the simulator", Network::low_level));
    let approval = settings.approval;
    let parts =
        SupervisorParts { experiment, control: session_end, ticks, sinks, recorder: status, checklist, approval, info };
    let mut supervisor = supervise(parts, maker, &options, settings, &clock)?;
    let storage = supervisor.storage_watch();
    for file in unfinished {
        let file = shell_word(&file);
        let message = format!(
            "an earlier session did not finish its recording. After this session: quadfrog recover {file} (replay and report read it as it is)"
        );
        supervisor.log(LogLevel::Warning, message, clock.now_ns());
    }
    if let Ok((granted, denied)) = scheduled.recv() {
        supervisor.report_scheduling(&granted, &denied, clock.now_ns());
    }
    let (report, news) = channel();
    let observers = match folder.recording.is_some().then(|| admit_observers(&options, &console_end.stop, report)) {
        Some(Err(error)) => {
            let message = format!("{error}: this session cannot be watched with quadfrog attach");
            supervisor.log(LogLevel::Warning, message, clock.now_ns());
            None
        }
        server => server.transpose().unwrap_or_default(),
    };
    let inhibits = hardware && !options.observe && SleepLock::available();
    let sleep_lock = match inhibits.then(|| SleepLock::take(Path::new(INHIBITOR))).transpose() {
        Ok(lock) => lock,
        Err(error) => {
            let message = format!("{INHIBITOR} cannot be run ({error}): the computer may suspend; {ALLOW_INHIBITOR}");
            supervisor.log(LogLevel::Warning, message, clock.now_ns());
            None
        }
    };
    let (to_supervisor, requests) = channel();
    let session = std::thread::Builder::new()
        .name("session".into())
        .spawn(move || session_thread::run(supervisor, guard, sleep_lock, &requests, &news, &clock, hardware))
        .map_err(EngineError::not_started("session thread"))?;

    Ok(EngineHandle {
        console: console_end,
        observe: options.observe,
        storage,
        recording,
        live: options.live,
        observers,
        _folder: folder,
        requests: Some(to_supervisor),
        clock,
        records: console_records,
        session: Some(session),
        threads,
    })
}

/// A robot, and the guard of a real one.
type GuardedRobot = (Box<dyn Robot>, Option<(Guard, GuardHeartbeat)>);

/// Returns the simulated robot, or the real one with its guard.
fn open_robot_and_guard(options: &Options, settings: &ControlSettings) -> Result<GuardedRobot, EngineError> {
    match options.backend {
        Backend::Simulator => Ok((Box::new(Simulator::new(&options.robot, &options.config.simulator)?), None)),
        Backend::Hardware => {
            let no_network = || EngineError::NoNetwork { robot: options.robot.name.clone() };
            let network = options.network.as_ref().ok_or_else(no_network)?;
            let priority = options.config.scheduling(options.backend).priority;
            let (robot, route) = open_robot(network, settings.gate.damping_kd, priority)?;
            let post = |program: &PathBuf| Guard::start(program, route, settings);
            let guard = options.guard.as_ref().map(post).transpose().map_err(EngineError::not_started("guard"))?;
            Ok((robot, guard))
        }
    }
}

/// Returns the session with the thread of its storage; `maker` makes the prior of its sampler behind it.
fn supervise(
    parts: SupervisorParts,
    maker: Option<PriorMaker>,
    options: &Options,
    settings: ControlSettings,
    clock: &MonotonicClock,
) -> Result<Supervisor, EngineError> {
    let hardware = options.backend == Backend::Hardware;
    let review_sits_down = hardware && options.config.safety.failsafe.hardware_review_sits_down;
    let mut supervisor = Supervisor::new(parts, clock.now_ns())
        .approving(options.approve, !hardware)
        .naming_limits(settings)
        .sitting_down_for_review(review_sits_down && !options.observe)
        .with_storage_thread()
        .map_err(EngineError::not_started("storage thread"))?;
    if let Some(maker) = maker {
        make_prior(&mut supervisor, maker, options, clock.now_ns());
    }
    Ok(supervisor)
}

/// Opens the robot in a thread below the control thread's `priority`: threads that a robot's library starts inherit it. The
/// arming check of the control thread reports a denied priority.
fn open_robot(network: &Network, damping_kd: f64, priority: u8) -> Result<OpenedRobot, EngineError> {
    let open = || {
        if priority > BELOW_CONTROL {
            let _denied = set_priority(priority - BELOW_CONTROL);
        }
        network.open(damping_kd)
    };
    std::thread::scope(|scope| {
        let opener = std::thread::Builder::new().name("robot".into()).spawn_scoped(scope, open);
        let opener = opener.map_err(EngineError::not_started("thread that opens the robot"))?;
        Ok(opener.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?)
    })
}

/// Finds or makes the prior of the sampler behind the session. One core is left to the control thread. An observer makes no
/// proposals and simulates nothing.
fn make_prior(supervisor: &mut Supervisor, maker: PriorMaker, options: &Options, time_ns: u64) {
    if options.observe {
        let message = "this session only observes: without a prior the sampler sim proposes nothing";
        return supervisor.log(LogLevel::Warning, message.to_owned(), time_ns);
    }
    let files = maker.files(options);
    supervisor.make_prior(time_ns, move |work, messages| {
        let progress = |progress| work.report(progress);
        let jobs = cores().saturating_sub(1).max(1);
        let mut notice = |text| messages.push((LogLevel::Warning, text));
        let found = maker.find_or_make(&files, jobs, &progress, work.interrupted(), &mut notice);
        let ready = found.map_err(|error| error.to_string())?;
        let source = match &ready.from {
            Some(file) => format!("the prior of the sampler sim is that of {}", file.display()),
            None => "the prior of the sampler sim is made".to_owned(),
        };
        messages.push((LogLevel::Info, source));
        if let Err(error) = ready.keep(&files) {
            let text = format!("{error}; the prior is used, and made again by the next session");
            messages.push((LogLevel::Warning, text));
        }
        Ok(ready.model)
    });
}

/// Opens the socket for observers of the session.
fn admit_observers(
    options: &Options,
    stop: &StopLatch,
    report: Sender<SessionNews>,
) -> std::io::Result<ObserverServer> {
    let folder = std::path::absolute(options.folder.as_deref().unwrap_or(Path::new(".")))?;
    let facts = SessionFacts {
        process: std::process::id(),
        folder,
        robot: options.robot.name.clone(),
        backend: options.backend.name().to_owned(),
        task: options.task.name().to_owned(),
        operator: options.provenance.operator.clone(),
        since: format!("{:.0}", jiff::Timestamp::now()),
    };
    ObserverServer::start(facts, stop.clone(), report)
}

/// Checks that the session, which opens `needed` file descriptors, will not run out of them while it drives a robot.
fn require_descriptors(needed: u64) -> Result<(), EngineError> {
    let lacking = |source| EngineError::System { what: "too few file descriptors".to_owned(), source };
    let (free, allowed) = match descriptors() {
        Ok(found) => found,
        // Without /proc they are not known.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(lacking(error)),
    };
    if free >= needed {
        return Ok(());
    }
    let reason = format!(
        "{free} of {allowed} are free, a session needs {needed}; raise the limit, for example `ulimit -n 1024`"
    );
    Err(lacking(std::io::Error::other(reason)))
}

/// Access of a console to a running engine. Dropping it ends the engine as `shutdown` does.
pub struct EngineHandle {
    console: ConsolePorts,
    observe: bool,
    storage: StorageWatch,
    recording: Option<PathBuf>,
    live: Option<LiveServer>,
    observers: Option<ObserverServer>,
    _folder: LockedFolder,
    requests: Option<Sender<StampedRequest>>,
    clock: MonotonicClock,
    records: Receiver<Stamped>,
    session: Option<JoinHandle<(Supervisor, Option<Guard>)>>,
    threads: EngineThreads,
}

impl EngineHandle {
    /// Stops the robot: damping in the next tick, in every mode. Neither waits nor fails.
    pub fn stop(&self) {
        self.console.stop.set();
    }

    /// Returns the stop latch, for a thread that must be able to stop without the console.
    pub fn stop_latch(&self) -> StopLatch {
        self.console.stop.clone()
    }

    /// Returns the recording of this session; none where nothing is kept.
    pub fn recording(&self) -> Option<&Path> {
        self.recording.as_deref()
    }

    /// Returns the recorder's status; none where nothing is kept.
    pub fn recorder(&self) -> Option<RecorderStatus> {
        self.recording.as_ref().and(self.threads.recorder()).map(|recorder| recorder.status())
    }

    /// Returns a view of the recorder's status that outlives the session; none where nothing is kept.
    pub fn recorder_watch(&self) -> Option<RecorderWatch> {
        self.recording.as_ref().and(self.threads.recorder()).map(RecorderHandle::watch)
    }

    /// Returns the state of the live view; none without one.
    pub fn live(&self) -> Option<LiveStatus> {
        self.live.as_ref().map(LiveServer::status)
    }

    /// Returns the number of observers that watch this session with the recording; none where it cannot be watched.
    pub fn observers(&self) -> Option<usize> {
        self.observers.as_ref().map(ObserverServer::observers)
    }

    /// Returns the wait of the session for the storage of its study; none while there is none worth showing.
    pub fn storage_wait(&self) -> Option<StorageWait> {
        self.storage.get(self.clock.now_ns())
    }

    /// Sends a heartbeat of the console; to be called at least ten times a second.
    pub fn send_heartbeat(&self) {
        self.console.heartbeat.beat();
    }

    /// Returns the heartbeat, for a console that sends it from another thread.
    pub fn heartbeat(&self) -> Heartbeat {
        self.console.heartbeat.clone()
    }

    /// Sends a request of the operator. The answer comes as a [`RequestRecord`](crate::recording::record::RequestRecord).
    pub fn request(&self, request: OperatorRequest) {
        if let Some(requests) = &self.requests {
            // A session that has ended does not answer; the console sees that its records end.
            let (stops, time_ns) = (self.console.stop.count(), self.clock.now_ns());
            // Straight to the control thread; the session answers.
            let lowering = match request {
                OperatorRequest::SitDown => Some(Lowering::SitDown),
                OperatorRequest::Cancel => Some(Lowering::Cancel),
                _ => None,
            };
            if let Some(lowering) = lowering.filter(|_| !self.observe) {
                self.console.lowering.press(lowering, time_ns);
            }
            let _ = requests.send(StampedRequest { request, stops, time_ns });
        }
    }

    /// Returns the newest tick and counters.
    pub fn snapshot(&mut self) -> Snapshot {
        *self.console.snapshot.read()
    }

    /// Takes the next of the ticks for charts, 200 a second.
    pub fn next_tick(&mut self) -> Option<Tick> {
        self.console.shown.pop().ok()
    }

    /// Takes the next record for the console.
    pub fn next_record(&mut self) -> Option<Stamped> {
        self.records.try_recv().ok()
    }

    /// Takes no further request, whereupon the session begins to end: a standing robot sits down. To be followed by
    /// [`EngineHandle::shutdown`].
    pub fn end_requests(&mut self) {
        self.requests = None;
    }

    /// Whether the session has ended after [`EngineHandle::end_requests`].
    pub fn session_has_ended(&self) -> bool {
        self.session.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Sits the robot down if it stands, closes the recording and ends the threads. Returns the records of the end.
    pub fn shutdown(mut self) -> Vec<Stamped> {
        self.end();
        self.records.try_iter().filter(|stamped| !matches!(stamped.record, Record::Counters(_))).collect()
    }

    fn end(&mut self) {
        self.end_requests();
        // Each thread ends after the one that feeds it: the session, then control, then the recorder. A panic was reported
        // when it happened.
        let session = self.session.take().map(JoinHandle::join);
        self.threads.end_control();
        // A STOP has no effect from here on, and none is confirmed.
        self.observers = None;
        if let Some(Ok((supervisor, guard))) = session {
            // The last sender to the recorder.
            drop(supervisor);
            if let Some(guard) = guard {
                guard.end();
            }
        }
        self.threads.end_recorder();
    }
}

impl Drop for EngineHandle {
    fn drop(&mut self) {
        self.end();
    }
}
